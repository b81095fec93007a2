"""Means of the angular rates that an IMU senses."""

import numpy as np

from navreplay.timeline import Floats, ImuSeries, Times

__all__ = ["mean_rates"]


def mean_rates(imu: ImuSeries, start_ns: Times, end_ns: Times) -> Floats:
    """(e, 3) means of the gyro's samples from start_ns to end_ns (e,), with the nearest sample where there is none [rad/s]."""
    starts = np.searchsorted(imu.t_ns, start_ns)
    ends = np.maximum(np.searchsorted(imu.t_ns, end_ns, side="right"), starts + 1)
    ends = np.minimum(ends, len(imu))
    starts = np.minimum(starts, ends - 1)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(imu.gyro, axis=0)])
    return np.asarray((total[ends] - total[starts]) / (ends - starts)[:, None])
