"""Outages: stretches without a used position, and how far a solution drifted in them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.evaluation.statistics import Statistics, summarise
from navreplay.geodesy.earth import ned_between
from navreplay.solution import Outage, OutageCause, Solution
from navreplay.timeline import Floats, Times, Trajectory

__all__ = ["OutageErrors", "assess_outages", "count_outages", "find_outages", "mark_unaided", "summarise_outages"]

_END_TOLERANCE_S = 1.5
"""An outage's end error counts at the last reference epoch within this time before its end."""

_TOLERANCE_NS = 1_000_000
"""Epochs this close are one: the ends of simulated windows are typed by hand."""
_UNKNOWN = (float("nan"),) * 4
_POSITIONING = ("position", "range")
"""Kinds of measurements that bound the position; a single range already does so, along its line of sight."""


@dataclass(frozen=True, slots=True)
class OutageErrors:
    """One outage. length_s, distance_m: duration and way travelled. end_horizontal, end_3d [m]: errors at the end, before the
    next fix corrects. max_horizontal, max_3d [m]: largest errors inside. NaN where the reference does not tell."""

    outage: Outage
    length_s: float
    distance_m: float
    end_horizontal: float
    end_3d: float
    max_horizontal: float
    max_3d: float


def _position_times(solution: Solution, used_only: bool = True) -> Times:
    positions = [series for series in solution.innovations if series.kind in _POSITIONING]
    times = [series.t_ns[series.used] if used_only else series.t_ns for series in positions]
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *times]))


def find_outages(
    solution: Solution, simulated: Iterable[tuple[int, int]] = (), min_length_s: float = 3.0
) -> tuple[Outage, ...]:
    """Stretches of at least min_length_s [s], and of 1.5 usual fix intervals, without a used position.

    An outage starts at the last used fix (or the first row) and ends at the next one (or the last row); where a simulated
    window (start_ns, end_ns] lies in it and the next fix after the window was used, it ends with the window. Its cause is
    ``fixes rejected`` where refused fixes leave no stretch of that length without any.
    """
    if len(solution) == 0:
        return ()
    used, offered = _position_times(solution), _position_times(solution, used_only=False)
    edges = np.unique(np.concatenate([solution.t_ns[:1], used, solution.t_ns[-1:]]))
    usual_ns = float(np.median(np.diff(used))) if len(used) > 1 else 0.0
    limit_ns = max(min_length_s * 1e9, 1.5 * usual_ns)
    windows = tuple(simulated)
    outages = []
    for start, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if end - start < limit_ns:
            continue
        inside = [stop for begin, stop in windows if begin < end and stop > start]
        prompt = [stop for stop in inside if stop < end and end - stop < limit_ns]
        tried = np.array([start, *offered[(offered > start) & (offered < end)].tolist(), end])
        missing = bool((np.diff(tried) >= limit_ns).any())
        cause: OutageCause = "simulated" if inside else "no fixes" if missing else "fixes rejected"
        outages.append(Outage(start, max(prompt, default=end), cause))
    return tuple(outages)


def _next_used_time(solution: Solution, outage: Outage) -> int:
    """Of the first fix used after the outage began, or behind the solution where there is none."""
    used = _position_times(solution)
    later = used[used > outage.start_ns + _TOLERANCE_NS]
    return int(later[0]) if len(later) else int(solution.t_ns[-1]) + 1


def mark_unaided(t_ns: Times, solution: Solution, outages: Iterable[Outage]) -> NDArray[np.bool_]:
    """(k,) whether t_ns (k,) lies behind the start of an outage and before the next fix that was used.

    Stretches in which the filter refused fixes do not count: they are its own doing, and differ from filter to filter.
    """
    mask = np.zeros(len(t_ns), dtype=np.bool_)
    for outage in outages:
        if outage.cause == "fixes rejected":
            continue
        mask |= (t_ns > outage.start_ns + _TOLERANCE_NS) & (t_ns < _next_used_time(solution, outage))
    return mask


def _last_unaided_time(solution: Solution, outage: Outage) -> int:
    """Of the last row that no fix has corrected yet, at most the end of the outage."""
    rows = solution.t_ns[solution.t_ns < _next_used_time(solution, outage)]
    return min(int(rows[-1]), outage.end_ns + _TOLERANCE_NS) if len(rows) else outage.start_ns


def _travelled(lla: Floats) -> float:
    return float(np.linalg.norm(ned_between(lla[:-1], lla[1:]), axis=1).sum()) if len(lla) > 1 else float("nan")


def assess_outages(
    solution: Solution,
    outages: Iterable[Outage],
    reference: Trajectory | None = None,
    t_ns: Times | None = None,
    error: Floats | None = None,
) -> tuple[OutageErrors, ...]:
    """Length and distance of each outage and, given position errors (k, 3) at t_ns (k,), the errors at its end and inside.

    The distance is the reference's where one is given, else the solution's own.
    """
    path = solution if reference is None else reference
    assessed = []
    for outage in outages:
        on_way = (path.t_ns >= outage.start_ns) & (path.t_ns <= outage.end_ns)
        figures = _UNKNOWN
        if t_ns is not None and error is not None:
            last = _last_unaided_time(solution, outage)
            rows = np.flatnonzero((t_ns > outage.start_ns + _TOLERANCE_NS) & (t_ns <= last))
            figures = _measure_outage(error[rows], bool(len(rows)) and outage.end_ns - t_ns[rows[-1]] <= _END_TOLERANCE_S * 1e9)
        length_s = (outage.end_ns - outage.start_ns) / 1e9
        assessed.append(OutageErrors(outage, length_s, _travelled(path.lla[on_way]), *figures))
    return tuple(assessed)


def _measure_outage(error: Floats, reaches_end: bool) -> tuple[float, float, float, float]:
    if len(error) == 0:
        return _UNKNOWN
    horizontal, total = np.linalg.norm(error[:, :2], axis=1), np.linalg.norm(error, axis=1)
    end = (float(horizontal[-1]), float(total[-1])) if reaches_end else (float("nan"), float("nan"))
    return *end, float(horizontal.max()), float(total.max())


def count_outages(outages: Iterable[OutageErrors]) -> tuple[OutageErrors, ...]:
    """Those a summary counts: the simulated ones where there are any, else those the log brings; never those in which the
    filter refused fixes, lest methods be judged on different stretches."""
    outages = tuple(outages)
    simulated = tuple(errors for errors in outages if errors.outage.cause == "simulated")
    return simulated or tuple(errors for errors in outages if errors.outage.cause == "no fixes")


def summarise_outages(outages: Iterable[OutageErrors]) -> dict[str, Statistics]:
    """Statistics of end_horizontal, end_3d, max_horizontal and max_3d over the outages that `count_outages` keeps."""
    outages = count_outages(outages)
    names = ("end_horizontal", "end_3d", "max_horizontal", "max_3d")
    return {name: summarise(np.array([getattr(outage, name) for outage in outages], dtype=np.float64)) for name in names}
