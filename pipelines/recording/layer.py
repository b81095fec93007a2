"""A recording as a layer of a segment, beside others of the same drive, and what a catalogue shows of it without opening it."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr

from navreplay.timeline import Floats, Times
from pipelines.drive.headline import FIGURES, headline
from pipelines.drive.result import RunResult
from pipelines.recording.paint import time_columns
from pipelines.report.content import outage_errors

__all__ = ["LayerStream", "send_outages", "send_properties"]

_TYPES = {"str": str, "float": float, "int": int}


class LayerStream(rr.RecordingStream):
    """A recording whose entities all lie under one, so that those of other layers do not mix with them."""

    def __init__(self, application: str, recording_id: str, under: str) -> None:
        super().__init__(application, recording_id=recording_id, send_properties=False)
        self._under = under

    def log(self, entity_path: str | list[object], entity: Any, *extra: Any, static: bool = False, **options: Any) -> None:
        """See `rerun.RecordingStream.log`."""
        super().log(f"{self._under}{entity_path}", entity, *extra, static=static, **options)

    def send_columns(self, entity_path: str, indexes: Iterable[Any], columns: Iterable[Any], **options: Any) -> None:
        """See `rerun.RecordingStream.send_columns`."""
        super().send_columns(f"{self._under}{entity_path}", indexes, columns, **options)


def send_properties(recording: rr.RecordingStream, result: RunResult, name: str, summary: str) -> None:
    """The headline figures, the verdict's summary and the texts of the findings as a property, whose parts a catalogue shows
    as columns; unknown figures are left out."""
    figures = {key: _TYPES[FIGURES[key]](value) for key, value in headline(result).items() if value is not None}
    texts = [f"{finding.level}: {finding.text}" for finding in result.findings if finding.level != "info"]
    recording.send_property(name, rr.AnyValues(**figures, summary=summary, **({"finding_texts": texts} if texts else {})))


def send_outages(recording: rr.RecordingStream, result: RunResult) -> None:
    """A row at the end of each outage: its length [s] and way [m] and, where a reference tells them, the horizontal error and
    the NEES of position before the next fix corrects; and that NEES over time."""
    solution, outages = result.solution, outage_errors(result)
    rows = {"length_s": [one.length_s for one in outages], "distance_m": [one.distance_m for one in outages]}
    if result.evaluation is not None:
        t_ns, nees = result.evaluation.t_ns, result.evaluation.errors["position"].nees
        recording.send_columns("/nees/position", time_columns(t_ns, solution), rr.Scalars.columns(scalars=nees))
        rows["end_horizontal_m"] = [one.end_horizontal for one in outages]
        rows["end_nees"] = [_last_inside(t_ns, nees, one.outage.start_ns, one.outage.end_ns) for one in outages]
    if outages:
        times = time_columns(np.array([one.outage.end_ns for one in outages]), solution)
        recording.send_columns("/outages", times, rr.AnyValues.columns(**{key: np.array(v) for key, v in rows.items()}))


def _last_inside(t_ns: Times, values: Floats, start_ns: int, end_ns: int) -> float:
    inside = values[(t_ns > start_ns) & (t_ns < end_ns)]
    return float(inside[-1]) if len(inside) else float("nan")
