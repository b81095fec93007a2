"""The inertial sensor of u-blox receivers as messages: ESF-MEAS and ESF-RAW of ublox_msgs and ublox_ubx_msgs.

Data words and scales as in `importers.ublox.sensors`. The ticks of the sensor are tied to the stamps of the messages, or to the
recorder's clock where they have none.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from importers.rows.log import Table
from importers.rows.message_fields import either_spelling
from importers.ublox.sensors import samples_of_data, signed_field, unwrapped_ticks
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import LogError

__all__ = ["ESF_NOTE", "esf_samples"]

ESF_NOTE = (
    "its samples are stamped by the clock of the sensor, tied to that of their messages with the mean delay; "
    "input.imu.time_offset_s corrects the rest"
)
_FEWEST = 10


def esf_samples(table: Table, leap: LeapSeconds) -> Table:
    """Samples of angular rate [rad/s] and specific force [m/s^2] in the axes of the sensor, one per tick of the gyroscope.
    Raises LogError where there are too few to tie them to a clock, or fields are missing."""
    columns = either_spelling(table.columns)
    if "blocks" not in columns and not columns.keys() >= {"data", "time_tag"}:
        raise LogError(f"its messages have neither blocks nor time_tag and data, but {', '.join(columns)}")
    message, tick, word = _words(columns)
    stamps = np.asarray(columns.get("header.stamp", table.log_time_ns), dtype=np.int64)
    tick = unwrapped_ticks(tick)
    if len(np.unique(tick)) < _FEWEST:
        raise LogError(f"only {len(np.unique(tick))} samples of the inertial sensor; too few to time them")
    first = int(stamps[0])
    slope, offset = np.polyfit(tick.astype(float), (stamps[message] - first).astype(float), 1)
    start = int(gps_from_utc(np.array([first + round(float(offset))]), leap)[0])
    found = samples_of_data(tick, (word >> 24) & 0x3F, signed_field(word), start, float(slope))
    return Table(found["t_gps_ns"], found, len(found["t_gps_ns"]) + sum(table.rejected.values()), table.rejected)


def _words(columns: Any) -> tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.int64]]:
    """For every datum: its message, its tick, and its word (type in the upper 8 bits)."""
    rows = []
    if "blocks" in columns:
        for message, blocks in enumerate(columns["blocks"].tolist()):
            rows += [(message, int(getattr(block, "s_t_tag", getattr(block, "sTtag", 0))), int(block.data)) for block in blocks]
    else:
        tags = columns["time_tag"].astype(np.int64).tolist()
        for message, data in enumerate(list(columns["data"])):
            rows += [(message, tags[message], _word(datum)) for datum in data]
    table = np.array(rows, dtype=np.int64).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _word(datum: Any) -> int:
    """A data word, or one whose type stands apart."""
    return int(datum.data_field) | int(datum.data_type) << 24 if hasattr(datum, "data_field") else int(datum)
