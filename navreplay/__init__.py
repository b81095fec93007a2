"""The core: timeline, filters and what they stand on, in arrays. Uses numpy, scipy and numba, and no file format.

    timeline = Timeline(imu=ImuSeries(t_ns, gyro, accel), fixes=GnssFixSeries(...))
    solution = run_filter(timeline, build_method("fixed"), FilterOptions())

The public names below are loaded when they are first used. A newcomer looks in `filters/run.py` for passes over a timeline, in
`filters/epochs.py` for the epoch loop and in `filters/presets.py` for the methods by name; files and reports are in
`pipelines`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navreplay.evaluation.metrics import Evaluation, evaluate
    from navreplay.filters.presets import build_method
    from navreplay.filters.run import run_filter
    from navreplay.options import GRADES, FilterOptions
    from navreplay.solution import Solution
    from navreplay.timeline import AttitudeSeries, GnssFixSeries, ImuSeries, LogError, RangeSeries, Timeline, Trajectory

__all__ = [
    "GRADES",
    "AttitudeSeries",
    "Evaluation",
    "FilterOptions",
    "GnssFixSeries",
    "ImuSeries",
    "LogError",
    "RangeSeries",
    "Solution",
    "Timeline",
    "Trajectory",
    "build_method",
    "evaluate",
    "run_filter",
]

_HOME = {
    "GRADES": "navreplay.options",
    "Evaluation": "navreplay.evaluation.metrics",
    "FilterOptions": "navreplay.options",
    "Solution": "navreplay.solution",
    "build_method": "navreplay.filters.presets",
    "evaluate": "navreplay.evaluation.metrics",
    "run_filter": "navreplay.filters.run",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'navreplay' has no attribute {name!r}")
    return getattr(import_module(_HOME.get(name, "navreplay.timeline")), name)


def __dir__() -> list[str]:
    return sorted(__all__)
