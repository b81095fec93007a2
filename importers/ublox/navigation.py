"""The receiver's own fixes and attitudes: NAV-PVT with NAV-HPPOSLLH and NAV-COV, HNR-PVT, NAV-ATT.

Source: u-blox F9 HPG 1.32 interface description (UBX-22008968), 3.15; u-blox M8 interface description (UBX-13003221), 32.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import WEEK_S, LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, Floats, Times

__all__ = [
    "ATTITUDE",
    "COVARIANCE",
    "HIGH_PRECISION",
    "HIGH_RATE",
    "POSITION",
    "SOLUTION",
    "STATUS",
    "VELOCITY",
    "Epochs",
    "attitudes",
    "high_rate",
    "precise_positions",
    "separate_solutions",
    "solutions",
    "state_times",
]

_DATE = [("year", "<u2")] + [(name, "u1") for name in ("month", "day", "hour", "min", "sec", "valid")]
SOLUTION = np.dtype(
    [("iTOW", "<u4"), *_DATE, ("tAcc", "<u4"), ("nano", "<i4"), ("fixType", "u1"), ("flags", "u1"), ("flags2", "u1")]
    + [("numSV", "u1"), ("lon", "<i4"), ("lat", "<i4"), ("height", "<i4"), ("hMSL", "<i4"), ("hAcc", "<u4"), ("vAcc", "<u4")]
    + [("vel", "<i4", 3), ("gSpeed", "<i4"), ("headMot", "<i4"), ("sAcc", "<u4"), ("headAcc", "<u4"), ("pDOP", "<u2")]
    + [("flags3", "<u2")]
)
"""NAV-PVT up to flags3; what follows differs between versions."""
HIGH_PRECISION = np.dtype(
    [("version", "u1"), ("reserved", "V2"), ("flags", "u1"), ("iTOW", "<u4"), ("lon", "<i4"), ("lat", "<i4")]
    + [("height", "<i4"), ("hMSL", "<i4"), ("lonHp", "i1"), ("latHp", "i1"), ("heightHp", "i1"), ("hMSLHp", "i1")]
    + [("hAcc", "<u4"), ("vAcc", "<u4")]
)
COVARIANCE = np.dtype(
    [("iTOW", "<u4"), ("version", "u1"), ("posCovValid", "u1"), ("velCovValid", "u1"), ("reserved", "V9")]
    + [("pos", "<f4", 6), ("vel", "<f4", 6)]
)
HIGH_RATE = np.dtype(
    [("iTOW", "<u4"), *_DATE, ("nano", "<i4"), ("fixType", "u1"), ("flags", "u1"), ("reserved1", "V2"), ("lon", "<i4")]
    + [("lat", "<i4"), ("height", "<i4"), ("hMSL", "<i4"), ("gSpeed", "<i4"), ("speed", "<i4"), ("headMot", "<i4")]
    + [("headVeh", "<i4"), ("hAcc", "<u4"), ("vAcc", "<u4"), ("sAcc", "<u4"), ("headAcc", "<u4"), ("reserved2", "V4")]
)
POSITION = np.dtype(
    [("iTOW", "<u4"), ("lon", "<i4"), ("lat", "<i4"), ("height", "<i4"), ("hMSL", "<i4"), ("hAcc", "<u4"), ("vAcc", "<u4")]
)
VELOCITY = np.dtype(
    [
        ("iTOW", "<u4"),
        ("vel", "<i4", 3),
        ("speed", "<u4"),
        ("gSpeed", "<u4"),
        ("heading", "<i4"),
        ("sAcc", "<u4"),
        ("cAcc", "<u4"),
    ]
)
STATUS = np.dtype([("iTOW", "<u4"), ("fTOW", "<i4"), ("week", "<i2"), ("gpsFix", "u1"), ("flags", "u1"), ("rest", "V36")])
"""NAV-POSLLH, NAV-VELNED and NAV-SOL, which receivers before the eighth generation send in place of NAV-PVT. vel: [cm/s]."""
ATTITUDE = np.dtype([("iTOW", "<u4"), ("version", "u1"), ("reserved", "V3"), ("angles", "<i4", 3), ("accuracies", "<u4", 3)])
_DATED = 0b11
_POSITION_INVALID = 1
_WEEK_AND_TIME = 0b1100
_FIX_OK, _DIFFERENTIAL = 1, 2
_CARRIER = {1: int(FixStatus.FLOAT), 2: int(FixStatus.FIXED)}
_NO_POSITION = (0, 5)
_DEAD_RECKONING = 1
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


class Epochs:
    """Times of the receiver's navigation epochs, by which messages that tell only the time of week are dated."""

    def __init__(self, t_ns: Times) -> None:
        self._t_ns = np.sort(t_ns[t_ns > 0])

    def dated(self, itow_ms: NDArray[np.integer]) -> Times:
        """GPS time (n,) of times of week (n,) [ms], in the week nearest to the epochs; 0 where there are no epochs."""
        if len(self._t_ns) == 0:
            return np.zeros(len(itow_ms), dtype=np.int64)
        return _near(itow_ms.astype(np.int64) * 10**6, np.full(len(itow_ms), self._t_ns[len(self._t_ns) // 2]))


def _near(tow_ns: Times, near_ns: Times) -> Times:
    """Times of week (n,) in the weeks that bring them nearest to times (n,)."""
    week_ns = WEEK_S * 10**9
    return near_ns + (tow_ns - near_ns + week_ns // 2) % week_ns - week_ns // 2


def _epoch_times(rows: NDArray[np.void], leap: LeapSeconds) -> Times:
    """GPS time (n,) of dated rows, exact to the nanosecond where date and time of week agree; 0 where there is no date yet."""
    dated = ((rows["valid"] & _DATED) == _DATED) & (rows["month"] >= 1) & (rows["month"] <= 12) & (rows["day"] >= 1)
    dated &= (rows["year"] >= 1990) & (rows["year"] < 2200) & (rows["iTOW"] < WEEK_S * 1000)
    year, month = rows["year"].astype(np.int64), np.where(dated, rows["month"], 1).astype(np.int64)
    months = (np.where(dated, year, 2000) - 1970) * 12 + month - 1
    days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) + rows["day"] - 1
    seconds = days * 86_400 + rows["hour"].astype(np.int64) * 3600 + rows["min"].astype(np.int64) * 60 + rows["sec"]
    by_date = gps_from_utc(seconds * 10**9, leap) + rows["nano"].astype(np.int64)
    by_week = _near(rows["iTOW"].astype(np.int64) * 10**6, by_date)
    return np.where(dated, np.where(np.abs(by_date - by_week) < 10**6, by_date, by_week), 0)


def _statuses(rows: NDArray[np.void], carrier: NDArray[np.integer]) -> NDArray[np.int8]:
    """Kinds of fix (n,). carrier: (n,) 0 without, 1 float, 2 fixed."""
    status = np.where(rows["flags"] & _DIFFERENTIAL, int(FixStatus.DIFFERENTIAL), int(FixStatus.SINGLE))
    for code, kind in _CARRIER.items():
        status[carrier == code] = kind
    status[rows["fixType"] == _DEAD_RECKONING] = int(FixStatus.DEAD_RECKONING)
    status[np.isin(rows["fixType"], _NO_POSITION) | ((rows["flags"] & _FIX_OK) == 0)] = NO_FIX
    return status.astype(np.int8)


def _geodetic(rows: NDArray[np.void]) -> Floats:
    """Positions (n, 3) [rad, rad, m above the ellipsoid]."""
    degrees = np.column_stack([rows["lat"], rows["lon"]]) * 1e-7
    return np.column_stack([np.radians(degrees), rows["height"] * 1e-3])


def _accuracy(horizontal_m: Floats, vertical_m: Floats) -> Floats:
    """Covariances (n, 3, 3) of accuracies (n,)."""
    return diagonal_covariance(np.column_stack([horizontal_m, horizontal_m, vertical_m]))


def solutions(
    rows: NDArray[np.void], precise: NDArray[np.void], covariances: NDArray[np.void], leap: LeapSeconds
) -> dict[str, np.ndarray]:
    """Columns of NAV-PVT (n,): ``lla``, ``vel_n``, ``cov_pos``, ``cov_vel``, ``status``, with the position of NAV-HPPOSLLH and
    the covariances of NAV-COV of the same epoch in place of its own."""
    lla, vel = _geodetic(rows), rows["vel"] * 1e-3
    cov_pos = _accuracy(rows["hAcc"] * 1e-3, rows["vAcc"] * 1e-3)
    cov_vel = _accuracy(rows["sAcc"] * 1e-3, rows["sAcc"] * 1e-3)
    own, other = _same_epoch(rows, precise[(precise["flags"] & _POSITION_INVALID) == 0])
    lla[own], cov_pos[own] = _precise(other)
    for name, into in (("pos", cov_pos), ("vel", cov_vel)):
        own, other = _same_epoch(rows, covariances[covariances[f"{name}CovValid"] == 1])
        into[own] = other[name].astype(np.float64)[:, _SYMMETRIC]
    lla[(rows["flags3"] & _POSITION_INVALID) != 0] = np.nan
    columns: dict[str, np.ndarray] = {"t_gps_ns": _epoch_times(rows, leap), "lla": lla, "vel_n": vel}
    return columns | {"cov_pos": cov_pos, "cov_vel": cov_vel, "status": _statuses(rows, rows["flags"] >> 6)}


def _precise(rows: NDArray[np.void]) -> tuple[Floats, Floats]:
    """Positions (n, 3) and covariances (n, 3, 3) of NAV-HPPOSLLH."""
    degrees = np.column_stack([rows["lat"] * 1e-7 + rows["latHp"] * 1e-9, rows["lon"] * 1e-7 + rows["lonHp"] * 1e-9])
    lla = np.column_stack([np.radians(degrees), rows["height"] * 1e-3 + rows["heightHp"] * 1e-4])
    return lla, _accuracy(rows["hAcc"] * 1e-4, rows["vAcc"] * 1e-4)


def _same_epoch(rows: NDArray[np.void], other: NDArray[np.void]) -> tuple[NDArray[np.intp], NDArray[np.void]]:
    """Rows that others share their time of week with, and those others."""
    _, own, theirs = np.intersect1d(rows["iTOW"], other["iTOW"], return_indices=True)
    return own, other[theirs]


def precise_positions(rows: NDArray[np.void], epochs: Epochs) -> dict[str, np.ndarray]:
    """Columns of NAV-HPPOSLLH (n,) alone."""
    lla, cov = _precise(rows)
    lla[(rows["flags"] & _POSITION_INVALID) != 0] = np.nan
    return {"t_gps_ns": epochs.dated(rows["iTOW"]), "lla": lla, "cov_pos": cov}


def separate_solutions(
    rows: NDArray[np.void], velocities: NDArray[np.void], states: NDArray[np.void], epochs: Epochs
) -> dict[str, np.ndarray]:
    """Columns of NAV-POSLLH (n,), with the velocity of NAV-VELNED and the kind of fix of NAV-SOL of the same epoch."""
    n = len(rows)
    vel, cov_vel = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    own, other = _same_epoch(rows, velocities)
    vel[own], cov_vel[own] = other["vel"] * 1e-2, _accuracy(other["sAcc"] * 1e-2, other["sAcc"] * 1e-2)
    status = np.zeros(n, dtype=np.int8)
    own, other = _same_epoch(rows, states)
    kinds = np.zeros(len(other), dtype=[("fixType", "u1"), ("flags", "u1")])
    kinds["fixType"], kinds["flags"] = other["gpsFix"], other["flags"]
    status[own] = _statuses(kinds, np.zeros(len(other), dtype=np.int64))
    columns: dict[str, np.ndarray] = {"t_gps_ns": epochs.dated(rows["iTOW"]), "lla": _geodetic(rows), "vel_n": vel}
    return columns | {"cov_pos": _accuracy(rows["hAcc"] * 1e-3, rows["vAcc"] * 1e-3), "cov_vel": cov_vel, "status": status}


def state_times(rows: NDArray[np.void]) -> Times:
    """GPS time (n,) of NAV-SOL, 0 where the receiver does not know it yet."""
    known = ((rows["flags"] & _WEEK_AND_TIME) == _WEEK_AND_TIME) & (rows["week"] > 0) & (rows["iTOW"] < WEEK_S * 1000)
    t_ns = rows["week"].astype(np.int64) * WEEK_S * 10**9 + rows["iTOW"].astype(np.int64) * 10**6
    return np.where(known, t_ns, 0)


def high_rate(rows: NDArray[np.void], leap: LeapSeconds) -> dict[str, np.ndarray]:
    """Columns of HNR-PVT (n,): what the receiver's own fusion with its inertial sensor says, without vertical velocity."""
    return {
        "t_gps_ns": _epoch_times(rows, leap),
        "lla": _geodetic(rows),
        "cov_pos": _accuracy(rows["hAcc"] * 1e-3, rows["vAcc"] * 1e-3),
        "status": _statuses(rows, np.zeros(len(rows), dtype=np.int64)),
    }


def attitudes(rows: NDArray[np.void], epochs: Epochs) -> Mapping[str, np.ndarray]:
    """Columns of NAV-ATT (n,): attitude of the vehicle against north, east, down; one whose accuracy is 0 is unknown."""
    angles, std = np.radians(rows["angles"] * 1e-5), np.radians(rows["accuracies"] * 1e-5)
    std[:, :2] = std[:, :2].max(axis=1, keepdims=True)  # about north and east, whatever the heading
    known = (rows["accuracies"] > 0).all(axis=1)
    q_nb = np.where(known[:, None], quat_from_euler(*angles.T), np.nan)
    return {"t_gps_ns": epochs.dated(rows["iTOW"]), "q_nb": q_nb, "cov_att": diagonal_covariance(std)}
