"""Time scales as int64 nanoseconds: GPS time since 1980-01-06 (the program's own), UTC and TAI since 1970-01-01.

UTC here is POSIX time (a leap second is not a count of its own). Source of the table: IERS Bulletin C; a newer table in the
format of the IERS file ``leap-seconds.list`` replaces it without a release (`load_leap_seconds`).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navreplay.timeline import LogError, Times

__all__ = [
    "GPS_EPOCH_UNIX_S",
    "LEAP_SECONDS",
    "WEEK_S",
    "LeapSeconds",
    "earth_rotation_angle",
    "gps_from_tai",
    "gps_from_utc",
    "gps_from_week_tow",
    "load_leap_seconds",
    "utc_from_gps",
    "week_tow_from_gps",
]

GPS_EPOCH_UNIX_S = 315_964_800
WEEK_S = 604_800
_S = 1_000_000_000
_TAI_MINUS_GPS_S = 19
_NTP_MINUS_UNIX_S = 2_208_988_800
_J2000_UNIX_S = 946_728_000
_DAY_S = 86_400


@dataclass(frozen=True, slots=True)
class LeapSeconds:
    """utc_s: POSIX seconds from which each offset holds, ascending. tai_minus_utc_s: the offsets."""

    utc_s: tuple[int, ...]
    tai_minus_utc_s: tuple[int, ...]


LEAP_SECONDS = LeapSeconds(
    utc_s=(
        63072000,
        78796800,
        94694400,
        126230400,
        157766400,
        189302400,
        220924800,
        252460800,
        283996800,
        315532800,
        362793600,
        394329600,
        425865600,
        489024000,
        567993600,
        631152000,
        662688000,
        709948800,
        741484800,
        773020800,
        820454400,
        867715200,
        915148800,
        1136073600,
        1230768000,
        1341100800,
        1435708800,
        1483228800,
    ),
    tai_minus_utc_s=tuple(range(10, 38)),
)


def load_leap_seconds(path: str | Path) -> LeapSeconds:
    """Reads a table in the format of the IERS ``leap-seconds.list`` (NTP seconds, TAI-UTC; ``#`` starts a comment).

    Raises LogError when the file cannot be read or holds no rows.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot read the leap-second table: {error.strerror}") from error
    rows = [line.split("#")[0].split() for line in text.splitlines()]
    try:
        pairs = sorted((int(row[0]) - _NTP_MINUS_UNIX_S, int(row[1])) for row in rows if row)
    except (ValueError, IndexError) as error:
        raise LogError(f"{path}: not a leap-second table in the format of the IERS leap-seconds.list ({error})") from error
    if not pairs:
        raise LogError(f"{path}: the leap-second table holds no rows")
    return LeapSeconds(tuple(p[0] for p in pairs), tuple(p[1] for p in pairs))


def _tai_minus_utc_ns(utc_ns: Times, table: LeapSeconds) -> Times:
    starts = np.array(table.utc_s, dtype=np.int64) * _S
    index = np.clip(np.searchsorted(starts, utc_ns, side="right") - 1, 0, None)
    return np.array(table.tai_minus_utc_s, dtype=np.int64)[index] * _S


def gps_from_utc(utc_ns: Times, table: LeapSeconds = LEAP_SECONDS) -> Times:
    """GPS nanoseconds (n,) from POSIX nanoseconds (n,)."""
    utc_ns = np.asarray(utc_ns, dtype=np.int64)
    return utc_ns + _tai_minus_utc_ns(utc_ns, table) - (_TAI_MINUS_GPS_S + GPS_EPOCH_UNIX_S) * _S


def utc_from_gps(t_ns: Times, table: LeapSeconds = LEAP_SECONDS) -> Times:
    """POSIX nanoseconds (n,) from GPS nanoseconds (n,); the inverse of `gps_from_utc` outside leap seconds."""
    tai_like = np.asarray(t_ns, dtype=np.int64) + (_TAI_MINUS_GPS_S + GPS_EPOCH_UNIX_S) * _S
    starts = (np.array(table.utc_s, dtype=np.int64) + np.array(table.tai_minus_utc_s, dtype=np.int64)) * _S
    index = np.clip(np.searchsorted(starts, tai_like, side="right") - 1, 0, None)
    return tai_like - np.array(table.tai_minus_utc_s, dtype=np.int64)[index] * _S


def gps_from_tai(tai_ns: Times) -> Times:
    """GPS nanoseconds (n,) from TAI nanoseconds since 1970-01-01 (n,)."""
    return np.asarray(tai_ns, dtype=np.int64) - (_TAI_MINUS_GPS_S + GPS_EPOCH_UNIX_S) * _S


def gps_from_week_tow(week: np.ndarray | int, tow_s: np.ndarray) -> Times:
    """GPS nanoseconds (n,) from full GPS weeks and seconds of week (n,), rounded to a nanosecond."""
    tow_s = np.asarray(tow_s, dtype=np.float64)
    whole = np.floor(tow_s)
    fraction_ns = np.rint((tow_s - whole) * 1e9).astype(np.int64)
    return (np.asarray(week, dtype=np.int64) * WEEK_S + whole.astype(np.int64)) * _S + fraction_ns


def week_tow_from_gps(t_ns: Times) -> tuple[np.ndarray, np.ndarray]:
    """Full GPS weeks (n,) int64 and seconds of week (n,) float64."""
    t_ns = np.asarray(t_ns, dtype=np.int64)
    week = t_ns // (WEEK_S * _S)
    return week, (t_ns - week * WEEK_S * _S) / 1e9


def earth_rotation_angle(t_ns: Times, ut1_utc: float = 0.0) -> np.ndarray:
    """Angle (n,) [rad] by which the Earth has turned from the celestial to the terrestrial origin of longitude at t_ns (n,).

    ut1_utc [s]: UT1 - UTC, which the IERS publishes; a second of it is 15 arcseconds. Source: IERS Conventions (2010), (5.15).
    """
    since_j2000_ns = utc_from_gps(t_ns) - _J2000_UNIX_S * _S + round(ut1_utc * 1e9)
    whole, rest_ns = np.divmod(since_j2000_ns, _DAY_S * _S)
    fraction = rest_ns / (_DAY_S * 1e9)
    turns = 0.7790572732640 + 0.00273781191135448 * (whole + fraction) + fraction
    return np.asarray(2 * np.pi * (turns % 1))
