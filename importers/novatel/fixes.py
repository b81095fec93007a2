"""BESTPOS and BESTVEL and their relatives as fixes and velocities."""

import numpy as np
from numpy.typing import NDArray

from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.timeline import FixStatus, Times

__all__ = ["POSITION", "VELOCITY", "positions", "velocities"]

POSITION = np.dtype(
    [("status", "<u4"), ("type", "<u4"), ("lat", "<f8"), ("lon", "<f8"), ("height", "<f8"), ("undulation", "<f4")]
    + [("datum", "<u4"), ("std", "<f4", 3), ("station", "S4"), ("diff_age", "<f4"), ("sol_age", "<f4"), ("satellites", "u1")]
    + [("used", "u1"), ("used_l1", "u1"), ("used_multi", "u1"), ("reserved", "u1"), ("extended", "u1"), ("gal_bds", "u1")]
    + [("gps_glo", "u1")]
)
VELOCITY = np.dtype(
    [("status", "<u4"), ("type", "<u4"), ("latency", "<f4"), ("age", "<f4"), ("speed", "<f8"), ("track", "<f8"), ("up", "<f8")]
    + [("reserved", "<f4")]
)
_COMPUTED = 0
_SINGLE, _DIFFERENTIAL = int(FixStatus.SINGLE), int(FixStatus.DIFFERENTIAL)
_FLOAT, _FIXED = int(FixStatus.FLOAT), int(FixStatus.FIXED)
_TYPES = (
    {1: _FIXED, 2: _SINGLE, 16: _SINGLE, 53: _SINGLE, 19: int(FixStatus.DEAD_RECKONING)}
    | dict.fromkeys((17, 18, 20, 52, 54), _DIFFERENTIAL)
    | dict.fromkeys((32, 33, 34, 55, 68, 69, 73, 74, 77, 78, 79, 80), _FLOAT)
    | dict.fromkeys((48, 49, 50, 51, 56), _FIXED)
)
"""Kind of fix of each position type; precise point positioning counts as float."""


def positions(rows: NDArray[np.void], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns of positions (n,); heights above the ellipsoid."""
    codes, inverse = np.unique(rows["type"], return_inverse=True)
    status = np.array([_TYPES.get(int(code), NO_FIX) for code in codes] or [0], dtype=np.int8)[inverse]
    status[rows["status"] != _COMPUTED] = NO_FIX
    height = rows["height"] + rows["undulation"].astype(np.float64)
    return {
        "t_gps_ns": t_ns,
        "lla": np.column_stack([np.radians(rows["lat"]), np.radians(rows["lon"]), height]),
        "cov_pos": diagonal_covariance(rows["std"].astype(np.float64)),
        "status": status,
    }


def velocities(rows: NDArray[np.void], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns of velocities (n,) north, east, down, at the time they are of: their latency is subtracted."""
    course = np.radians(rows["track"])
    vel = np.column_stack([rows["speed"] * np.cos(course), rows["speed"] * np.sin(course), -rows["up"]])
    computed = (rows["status"] == _COMPUTED) & (rows["type"] != 0)
    latency = np.where(np.abs(rows["latency"]) < 2.0, rows["latency"], 0.0).astype(np.float64)
    return {
        "t_gps_ns": t_ns - np.rint(latency * 1e6).astype(np.int64) * 1000,
        "vel_n": vel,
        "status": np.where(computed, 0, NO_FIX).astype(np.int8),
    }
