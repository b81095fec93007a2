"""Fixes and ranges withheld from a filter on purpose: thinning to a lower rate and simulated outages."""

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.time_scales import gps_from_week_tow, week_tow_from_gps
from navreplay.timeline import GnssFixSeries, LogError, RangeSeries, Times
from pipelines.config.sections import OutageSection

__all__ = ["outage_windows", "withhold_fixes", "withhold_ranges"]

_TOLERANCE_NS = 1_000_000
_RANGE_WIDE = ("ionosphere_removed", "troposphere_removed", "klobuchar", "klobuchar_system")
_RANGE_COLUMNS = tuple(field.name for field in fields(RangeSeries) if field.name not in _RANGE_WIDE)


def outage_windows(section: OutageSection, t_ns: Times) -> tuple[tuple[int, int], ...]:
    """The simulated windows as (start, end) in GPS nanoseconds; without a week they count from the week of t_ns[0]."""
    week = int(week_tow_from_gps(t_ns[:1])[0][0]) if section.week is None else section.week
    edges = gps_from_week_tow(week, np.array(section.windows_gps_tow, dtype=np.float64).reshape(-1, 2))
    return tuple((int(start), int(end)) for start, end in edges)


def withhold_fixes(fixes: GnssFixSeries, section: OutageSection) -> GnssFixSeries:
    """The fixes a filter is to see: one per interval, none with start < t <= end of a window (to a millisecond).

    Raises LogError when none would be left, or when a window meets no fix at all (a wrong week or time of week).
    """
    kept = _thin_fixes(fixes, section)
    for inside in _inside_windows(fixes.t_ns, section, "fix", "fixes"):
        kept &= ~inside
    if not kept.any():
        raise LogError("outages: the windows withhold every fix of the log; nothing is left to navigate with")
    return GnssFixSeries(
        fixes.t_ns[kept], fixes.lla[kept], fixes.vel_n[kept], fixes.cov_pos[kept], fixes.cov_vel[kept], fixes.status[kept]
    )


def withhold_ranges(ranges: RangeSeries, section: OutageSection) -> RangeSeries:
    """The same for epochs of ranges; in a window the satellites seen most in it stay, as many as the section keeps.

    Raises LogError when none would be left, or when a window meets no epoch at all.
    """
    kept = _thin(ranges.t_ns, section)
    for inside in _inside_windows(ranges.t_ns, section, "range", "ranges"):
        names, counts = np.unique(ranges.sat[inside], return_counts=True)
        staying = names[np.argsort(-counts, kind="stable")[: section.satellites_kept]]
        kept &= ~inside | np.isin(ranges.sat, staying)
    if not kept.any():
        raise LogError("outages: the windows withhold every range of the log; nothing is left to navigate with")
    if kept.all():
        return ranges
    return replace(ranges, **{name: getattr(ranges, name)[kept] for name in _RANGE_COLUMNS})


def _thin_fixes(fixes: GnssFixSeries, section: OutageSection) -> NDArray[np.bool_]:
    """(n,) what one position per interval leaves; a velocity that stands alone goes with the nearest position."""
    rows = np.flatnonzero(fixes.has_position)
    if len(rows) in (0, len(fixes)):
        return _thin(fixes.t_ns, section)
    t_ns = fixes.t_ns[rows]
    behind = np.clip(np.searchsorted(t_ns, fixes.t_ns), 1, max(len(rows) - 1, 1))
    nearer = fixes.t_ns - t_ns[behind - 1] < t_ns[np.minimum(behind, len(rows) - 1)] - fixes.t_ns
    return _thin(t_ns, section)[np.where(nearer, behind - 1, np.minimum(behind, len(rows) - 1))]


def _thin(t_ns: Times, section: OutageSection) -> NDArray[np.bool_]:
    """(n,) what one epoch per interval leaves."""
    if section.fix_interval_s is None:
        return np.ones(len(t_ns), dtype=np.bool_)
    epochs, epoch = np.unique(t_ns, return_inverse=True)
    return _first_of_each_interval(epochs, section.fix_interval_s)[epoch]


def _inside_windows(t_ns: Times, section: OutageSection, one: str, many: str) -> Iterator[NDArray[np.bool_]]:
    """(n,) per window, which of the times lie in it. Raises LogError when a window holds none."""
    for start, end in outage_windows(section, t_ns):
        inside = (t_ns > start + _TOLERANCE_NS) & (t_ns <= end + _TOLERANCE_NS)
        if not inside.any():
            raise LogError(
                f"outages: no {one} lies in the window {_describe_window(start, end)}, but the {many} span "
                f"{_describe_window(int(t_ns[0]), int(t_ns[-1]))}; check outages.windows_gps_tow and outages.week"
            )
        yield inside


def _first_of_each_interval(t_ns: Times, interval_s: float) -> NDArray[np.bool_]:
    interval = (t_ns - t_ns[0] + _TOLERANCE_NS) // round(interval_s * 1e9)
    return np.concatenate([[True], np.diff(interval) > 0])


def _describe_window(start_ns: int, end_ns: int) -> str:
    week, tow = week_tow_from_gps(np.array([start_ns, end_ns]))
    return f"{tow[0]:.3f} to {tow[1]:.3f} s of week {week[0]}"
