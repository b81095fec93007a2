"""INSPVA and INSPVAX: the inertial solution of SPAN receivers, as a reference."""

import numpy as np
from numpy.typing import NDArray

from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import Times

__all__ = ["INSPVA", "INSPVAX", "inertial_solution"]

INSPVA = np.dtype(
    [("week", "<u4"), ("seconds", "<f8"), ("lat", "<f8"), ("lon", "<f8"), ("height", "<f8"), ("vel", "<f8", 3)]
    + [("angles", "<f8", 3), ("ins", "<u4")]
)
"""vel: north, east, up [m/s]. angles: roll, pitch, azimuth [deg]. height above the ellipsoid."""
INSPVAX = np.dtype(
    [("ins", "<u4"), ("type", "<u4"), ("lat", "<f8"), ("lon", "<f8"), ("height", "<f8"), ("undulation", "<f4")]
    + [("vel", "<f8", 3), ("angles", "<f8", 3), ("std", "<f4", 9), ("extended", "<u4"), ("update", "<u2")]
)
"""The same with a height above mean sea level, and standard deviations."""
_SOLVED = (2, 3, 6, 7)
"""High variance, good, free, alignment complete."""


def inertial_solution(rows: NDArray[np.void], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns of solutions (n,) of either layout; those before the alignment have no fix."""
    extended = "undulation" in (rows.dtype.names or ())
    height = rows["height"] + (rows["undulation"].astype(np.float64) if extended else 0.0)
    columns = {
        "t_gps_ns": t_ns if extended else _own_times(rows),
        "lla": np.column_stack([np.radians(rows["lat"]), np.radians(rows["lon"]), height]),
        "vel_n": rows["vel"] * [1.0, 1.0, -1.0],
        "q_nb": quat_from_euler(*np.radians(rows["angles"]).T),
        "status": np.where(np.isin(rows["ins"], _SOLVED), 0, NO_FIX).astype(np.int8),
    }
    if extended:
        columns["cov_pos"] = diagonal_covariance(rows["std"][:, :3].astype(np.float64))
    return columns


def _own_times(rows: NDArray[np.void]) -> Times:
    seconds = np.where((rows["seconds"] >= 0) & (rows["seconds"] < 604_801), rows["seconds"], -1e9)
    return gps_from_week_tow(np.minimum(rows["week"], 9999).astype(np.int64), seconds)
