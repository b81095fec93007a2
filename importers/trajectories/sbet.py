"""SBET, the smoothed best estimate of trajectory of Applanix POSPac, as a reference.

Records of 17 doubles: seconds of the GPS week, latitude and longitude [rad], height [m], velocity along x, y, z of the
platform, roll, pitch, platform heading and wander angle [rad], then accelerations and rates, which are not read. The platform's
x axis is turned from north by minus the wander angle: true heading = platform heading - wander angle (Applanix POSPac MMS).
"""

import numpy as np

from importers.containers.file_bytes import map_file
from importers.rows.clock import unwrap_weeks
from importers.rows.log import Table
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import WEEK_S, gps_from_week_tow

__all__ = ["is_sbet", "read_sbet"]

_RECORD = np.dtype(
    [("seconds", "<f8"), ("lla", "<f8", 3), ("vel", "<f8", 3), ("roll", "<f8"), ("pitch", "<f8"), ("heading", "<f8")]
    + [("wander", "<f8"), ("rest", "<f8", 6)]
)
_LOOKED_AT, _LONGEST_STEP_S = 10, 10.0
_LIMITS = np.array([np.pi / 2, 2 * np.pi, 1e5])


def is_sbet(head: bytes, size: int) -> bool:
    """Whether a file of size bytes that begins so is one: whole records of plausible positions, in the order of time."""
    rows = np.frombuffer(head[: len(head) // _RECORD.itemsize * _RECORD.itemsize], _RECORD)[:_LOOKED_AT]
    if size % _RECORD.itemsize or len(rows) == 0:
        return False
    values = np.column_stack([rows["seconds"], rows["lla"], rows["vel"], rows["roll"], rows["pitch"], rows["heading"]])
    if not np.isfinite(values).all() or (rows["seconds"] < 0).any() or (rows["seconds"] >= 2 * WEEK_S).any():
        return False
    step = np.diff(rows["seconds"])
    inside = (np.abs(rows["lla"]) <= _LIMITS).all() and (np.abs(values[:, 7:]) <= 2 * np.pi).all()
    return bool(inside and (step > 0).all() and (step < _LONGEST_STEP_S).all() and (rows["lla"][:, :2] != 0).any())


def read_sbet(path: str, gps_week: int | None) -> Table:
    """Positions, velocities and attitudes. gps_week: of the first record. Raises LogError where it is not known."""
    rows = map_file(path, b"", "an SBET").view(_RECORD)
    seconds = rows["seconds"]
    timed = np.isfinite(seconds) & (seconds >= 0) & (seconds < 2 * WEEK_S)
    rows, seconds = rows[timed], seconds[timed]
    t_ns = gps_from_week_tow(unwrap_weeks(gps_week, seconds, path), seconds)
    wander = rows["wander"]
    x, y = rows["vel"][:, 0], rows["vel"][:, 1]
    with np.errstate(invalid="ignore", over="ignore"):  # of damaged numbers, which are screened later
        north, east = x * np.cos(wander) + y * np.sin(wander), y * np.cos(wander) - x * np.sin(wander)
        columns = {
            "t_gps_ns": t_ns,
            "lla": rows["lla"].astype(np.float64),
            "vel_n": np.column_stack([north, east, rows["vel"][:, 2]]),
            "q_nb": quat_from_euler(rows["roll"], rows["pitch"], rows["heading"] - wander),
        }
    rejected = {} if timed.all() else {"no time": int((~timed).sum())}
    return Table(t_ns, columns, len(timed), rejected)
