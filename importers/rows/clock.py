"""Counts, weeks and stamps as GPS time."""

import numpy as np
from numpy.typing import NDArray

from importers.settings import TimeBase
from navreplay.geodesy.time_scales import (
    GPS_EPOCH_UNIX_S,
    LEAP_SECONDS,
    LeapSeconds,
    gps_from_tai,
    gps_from_utc,
    load_leap_seconds,
)
from navreplay.timeline import LogError, Times

__all__ = [
    "LONGEST_ON_NS",
    "NOMINAL_NS",
    "count_ns",
    "gps_from_gps_unix",
    "gps_from_stamps",
    "is_nominal",
    "is_time",
    "leap_seconds",
    "unwrap_weeks",
]

LONGEST_ON_NS = 4 * 365 * 86_400 * 10**9
"""What a count from power-on stays below."""
NOMINAL_NS = 2087 * 604_800 * 10**9
"""A day that stands for the unknown one of such a count, 2020-01-05, in GPS time."""
_LONGEST_COUNT_NS = 50 * 86_400 * 10**9
_UNIT_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_HALF_WEEK_S = 302_400
_CENTURY_S = 3_200_000_000


def leap_seconds(path: object | None) -> LeapSeconds:
    """The table of a file in the IERS format, or the built-in one. Raises LogError."""
    return LEAP_SECONDS if path is None else load_leap_seconds(str(path))


def count_ns(count: np.ndarray, unit: str) -> Times:
    """Nanoseconds (n,) of counts (n,) of ``s``, ``ms``, ``us`` or ``ns``: whole counts exactly, fractions of seconds to a
    microsecond (a double that counts seconds since 1970 holds no more)."""
    scale = _UNIT_NS[unit]
    if count.dtype.kind in "iu":
        return count.astype(np.int64) * scale
    whole = np.floor(count)
    steps = min(scale, 10**6)
    fraction = np.rint((count - whole) * steps).astype(np.int64) * (scale // steps)
    return np.asarray(whole.astype(np.int64) * scale + fraction)


def is_time(count: np.ndarray, unit: str = "s") -> NDArray[np.bool_]:
    """Which counts (n,) are a time within a century of their zero."""
    return np.asarray(np.abs(count.astype(np.float64)) < _CENTURY_S * (10**9 / _UNIT_NS[unit]))


def unwrap_weeks(gps_week: int | None, tow_s: np.ndarray, place: str) -> np.ndarray:
    """Weeks (n,) of seconds of week (n,) that begin in gps_week. Raises LogError, naming place, where it is None."""
    if gps_week is None:
        raise LogError(f"{place} has seconds of week without a week; set input.gps_week (or time.week_column of a mapping)")
    if len(tow_s) == 0:
        return np.empty(0, dtype=np.int64)
    return np.asarray(gps_week + np.concatenate([[0], np.cumsum(np.diff(tow_s) < -_HALF_WEEK_S)]), dtype=np.int64)


def is_nominal(t_ns: Times) -> bool:
    """Whether times (n,) may be counts from power-on told on their nominal day: within the 50 days of a 32-bit millisecond."""
    return len(t_ns) > 0 and bool(t_ns[0] >= NOMINAL_NS and t_ns[-1] < NOMINAL_NS + _LONGEST_COUNT_NS)


def gps_from_gps_unix(count: Times) -> Times:
    """GPS nanoseconds (n,) from nanoseconds counted since 1970 without leap seconds (n,)."""
    return np.asarray(count, dtype=np.int64) - GPS_EPOCH_UNIX_S * 10**9


def gps_from_stamps(stamps: Times, base: TimeBase, leap: LeapSeconds) -> Times:
    """GPS nanoseconds (n,) from nanoseconds since 1970 (n,) in a time base; ``auto`` is UTC, and ``boot`` keeps the count."""
    if base == "gps":
        return gps_from_gps_unix(stamps)
    if base == "tai":
        return gps_from_tai(stamps)
    return stamps if base == "boot" else gps_from_utc(stamps, leap)
