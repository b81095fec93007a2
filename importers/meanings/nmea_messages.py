"""NMEA sentences published as messages (nmea_msgs/Sentence)."""

from datetime import UTC, datetime

import numpy as np

from importers.nmea.fixes import read_sentences
from importers.rows.log import Table
from navreplay.geodesy.time_scales import LeapSeconds
from navreplay.timeline import LogError

__all__ = ["sentence_fixes"]


def sentence_fixes(table: Table, leap: LeapSeconds) -> Table:
    """The fixes in the sentences of all messages; where no sentence has a date, the recorder's clock tells it. Raises LogError
    where there is no position among them."""
    if "sentence" not in table.columns:
        raise LogError(f"its messages have no field 'sentence', but {', '.join(table.columns)}")
    lines = [str(sentence).strip() for sentence in table.columns["sentence"].tolist()]
    day = datetime.fromtimestamp(int(np.min(table.log_time_ns)) / 1e9, tz=UTC).date()
    return read_sentences("the sentences", "\n".join(lines).encode() + b"\n", day, leap)
