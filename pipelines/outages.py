"""Fixes withheld from a filter on purpose: thinning to a lower rate and simulated outages."""

import numpy as np
from numpy.typing import NDArray

from navreplay.time_scales import gps_from_week_tow, week_tow_from_gps
from navreplay.timeline import GnssFixSeries, LogError, Times
from pipelines.sections import OutageSection

__all__ = ["outage_windows", "withhold_fixes"]

_TOLERANCE_NS = 1_000_000


def outage_windows(section: OutageSection, t_ns: Times) -> tuple[tuple[int, int], ...]:
    """The simulated windows as (start, end) in GPS nanoseconds; without a week they count from the week of t_ns[0]."""
    week = int(week_tow_from_gps(t_ns[:1])[0][0]) if section.week is None else section.week
    edges = gps_from_week_tow(week, np.array(section.windows_gps_tow, dtype=np.float64).reshape(-1, 2))
    return tuple((int(start), int(end)) for start, end in edges)


def withhold_fixes(fixes: GnssFixSeries, section: OutageSection) -> GnssFixSeries:
    """The fixes a filter is to see: one per interval, none with start < t <= end of a window (to a millisecond).

    Raises LogError when none would be left, or when a window meets no fix at all (a wrong week or time of week).
    """
    kept = np.ones(len(fixes), dtype=np.bool_)
    if section.fix_interval_s is not None:
        kept &= _first_of_each_interval(fixes.t_ns, section.fix_interval_s)
    for start, end in outage_windows(section, fixes.t_ns):
        inside = (fixes.t_ns > start + _TOLERANCE_NS) & (fixes.t_ns <= end + _TOLERANCE_NS)
        if not inside.any():
            raise LogError(
                f"outages: no fix lies in the window {_describe_window(start, end)}, but the fixes span "
                f"{_describe_window(int(fixes.t_ns[0]), int(fixes.t_ns[-1]))}; check outages.windows_gps_tow and outages.week"
            )
        kept &= ~inside
    if not kept.any():
        raise LogError("outages: the windows withhold every fix of the log; nothing is left to navigate with")
    return GnssFixSeries(
        fixes.t_ns[kept], fixes.lla[kept], fixes.vel_n[kept], fixes.cov_pos[kept], fixes.cov_vel[kept], fixes.status[kept]
    )


def _first_of_each_interval(t_ns: Times, interval_s: float) -> NDArray[np.bool_]:
    interval = (t_ns - t_ns[0] + _TOLERANCE_NS) // round(interval_s * 1e9)
    return np.concatenate([[True], np.diff(interval) > 0])


def _describe_window(start_ns: int, end_ns: int) -> str:
    week, tow = week_tow_from_gps(np.array([start_ns, end_ns]))
    return f"{tow[0]:.3f} to {tow[1]:.3f} s of week {week[0]}"
