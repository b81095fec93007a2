"""Colours, timelines and single series of a recording."""

import rerun as rr

from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.solution import Solution
from navreplay.timeline import Floats, Times

__all__ = ["BLUE", "GREEN", "GREY", "ORANGE", "PALE", "RED", "Color", "send_dots", "send_line", "time_columns"]

Color = tuple[int, int, int]
BLUE, GREY, RED, PALE = (88, 140, 255), (150, 160, 176), (235, 70, 70), (120, 135, 175)
ORANGE, GREEN = (235, 130, 40), (30, 185, 140)


def time_columns(t_ns: Times, solution: Solution) -> list[rr.TimeColumn]:
    """The two timelines at t_ns (k,)."""
    return [
        rr.TimeColumn("elapsed", duration=(t_ns - solution.t_ns[0]).astype("timedelta64[ns]")),
        rr.TimeColumn("time", timestamp=utc_from_gps(t_ns).astype("datetime64[ns]")),
    ]


def send_line(
    recording: rr.RecordingStream, path: str, times: list[rr.TimeColumn], values: Floats, name: str, color: Color
) -> None:
    """Values (k,) as a line, styled once."""
    recording.log(path, rr.SeriesLines(colors=color, names=name, widths=1.0 if color == PALE else 1.5), static=True)
    recording.send_columns(path, indexes=times, columns=rr.Scalars.columns(scalars=values))


def send_dots(
    recording: rr.RecordingStream, path: str, times: list[rr.TimeColumn], values: Floats, name: str, color: Color
) -> None:
    """Values (k,) as dots, or crosses where they are of what was rejected."""
    marker = "cross" if name == "rejected" else "circle"
    recording.log(path, rr.SeriesPoints(colors=color, names=name, markers=marker, marker_sizes=2.5), static=True)
    recording.send_columns(path, indexes=times, columns=rr.Scalars.columns(scalars=values))
