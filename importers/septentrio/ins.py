"""INSNavGeod: the inertial solution of the receiver, as a reference."""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import records
from importers.rows.tables import diagonal_covariance
from importers.septentrio.fixes import known, status_of
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.timeline import Floats, Times

__all__ = ["inertial_solution"]

_HEAD = np.dtype(
    [("mode", "u1"), ("error", "u1"), ("info", "<u2"), ("age", "<u2"), ("lat", "<f8"), ("lon", "<f8"), ("height", "<f8")]
    + [("undulation", "<f4"), ("accuracy", "<u2"), ("latency", "<u2"), ("datum", "u1"), ("reserved", "u1"), ("parts", "<u2")]
)
_PART = np.dtype([("values", "<f4", 3)])
_POSITION_STD, _ATTITUDE, _VELOCITY = 0, 1, 3
"""Bits of the parts that follow the head, each of three floats, in the order of the bits."""
_PARTS = 8


def inertial_solution(buffer: Buffer, start: Offsets, size: NDArray[np.int64], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns of solutions (n,) of blocks at start (n,)."""
    whole = size >= _HEAD.itemsize
    start, size, t_ns = start[whole], size[whole], t_ns[whole]
    rows = records(buffer, start, _HEAD)
    position_std, attitude, velocity = (
        _part(buffer, start, size, rows["parts"], bit) for bit in (_POSITION_STD, _ATTITUDE, _VELOCITY)
    )
    heading, pitch, roll = np.radians(attitude.T)
    return {
        "t_gps_ns": t_ns,
        "lla": np.column_stack([known(rows[name]) for name in ("lat", "lon", "height")]),
        "vel_n": velocity[:, [1, 0, 2]] * [1.0, 1.0, -1.0],
        "q_nb": quat_from_euler(roll, pitch, heading),
        "cov_pos": diagonal_covariance(position_std),
        "status": status_of(np.where(rows["mode"] & 15, rows["mode"], 1), rows["error"]),
    }


def _part(buffer: Buffer, start: Offsets, size: NDArray[np.int64], parts: NDArray[np.uint16], bit: int) -> Floats:
    """The three numbers (n, 3) of a part; NaN where the block has none."""
    before = sum(((parts >> lower) & 1).astype(np.int64) for lower in range(bit)) + np.zeros(len(start), dtype=np.int64)
    place = _HEAD.itemsize + before * _PART.itemsize
    there = ((parts >> bit) & 1).astype(bool) & (place + _PART.itemsize <= size)
    values = known(records(buffer, start + place, _PART)["values"])
    return np.where(there[:, None], values, np.nan)
