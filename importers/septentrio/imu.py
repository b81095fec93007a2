"""ExtSensorMeas: accelerations and angular rates of the IMU in or at the receiver."""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather, records
from navreplay.timeline import Floats, LogError, Times

__all__ = ["sensor_samples"]

_PART = np.dtype([("source", "u1"), ("model", "u1"), ("type", "u1"), ("info", "u1"), ("values", "<f8", 3)])
_ACCELERATION, _ANGULAR_RATE = 0, 1
_UNKNOWN = -2e10


def sensor_samples(buffer: Buffer, start: Offsets, size: NDArray[np.int64], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns ``gyro`` and ``accel`` (n, 3) of the blocks (n,) that hold both, in the axes of the sensor. Raises LogError where
    none does."""
    head = gather(buffer, start, 2).astype(np.int64)
    count, width = head[:, 0], head[:, 1]
    usable = (width >= _PART.itemsize) & (size >= 2 + count * width)
    message = np.repeat(np.flatnonzero(usable), count[usable])
    within = np.arange(len(message)) - np.repeat(np.cumsum(count[usable]) - count[usable], count[usable])
    rows = records(buffer, start[message] + 2 + within * width[message], _PART)
    accel = _of_type(rows, message, _ACCELERATION, len(start))
    gyro = np.radians(_of_type(rows, message, _ANGULAR_RATE, len(start)))
    both = np.isfinite(accel).all(axis=1) & np.isfinite(gyro).all(axis=1)
    if len(start) and not both.any():
        raise LogError("none of its blocks holds both accelerations and angular rates")
    return {"t_gps_ns": t_ns[both], "gyro": gyro[both], "accel": accel[both]}


def _of_type(rows: NDArray[np.void], message: NDArray[np.intp], kind: int, n: int) -> Floats:
    """The values (n, 3) of the parts of a type, by the block (n,) they are in; NaN where it has none."""
    own = rows["type"] == kind
    values = np.full((n, 3), np.nan)
    values[message[own]] = np.where(rows["values"][own] > _UNKNOWN / 2, rows["values"][own], np.nan)
    return values
