"""What an IMU feels about a time: means of its rates and forces over some samples, which vibration spoils less than one."""

from typing import NamedTuple

import numpy as np

from navreplay.error_models.set_up import Moving
from navreplay.geodesy.earth import earth_rate_n, gravity_n
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats, ImuSeries, Times

__all__ = ["Felt", "felt_at", "moving_at"]

_HALF_NS = 100_000_000


class Felt(NamedTuple):
    """Means about e times: rate (e, 3) [rad/s] and force (e, 3) [m/s^2], body axes, as sensed."""

    rate: Floats
    force: Floats


def felt_at(imu: ImuSeries, t_ns: Times) -> Felt:
    """About the times t_ns (e,), 0.1 s to both sides; of the nearest sample where there is none."""
    last = len(imu.t_ns)
    ends = np.minimum(np.searchsorted(imu.t_ns, t_ns + _HALF_NS, side="right"), last)
    starts = np.searchsorted(imu.t_ns, t_ns - _HALF_NS)
    starts, ends = np.minimum(starts, last - 1), np.maximum(ends, 1)
    ends = np.maximum(ends, starts + 1)

    def mean(values: Floats) -> Floats:
        """(e, 3) of values (n, 3)."""
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
        return np.asarray((total[ends] - total[starts]) / (ends - starts)[:, None])

    return Felt(mean(imu.gyro), mean(imu.accel))


def moving_at(state: NavState, lever_b: Floats, rate: Floats, force: Floats) -> Moving:
    """The motion of an antenna lever_b (3,) [m] off an IMU in that state, which feels rate (3,) and force (3,)."""
    c_nb = matrix_from_quat(state.q_nb)
    rate_b = (rate - state.gyro_error) / (1 + state.gyro_scale) - c_nb.T @ earth_rate_n(state.lla[0])
    force_b = (force - state.accel_bias) / (1 + state.accel_scale)
    inward = np.cross(rate_b, np.cross(rate_b, lever_b))
    acceleration = c_nb @ (force_b + inward) + gravity_n(state.lla[0], state.lla[2])
    return Moving(c_nb, rate_b, state.vel_n + c_nb @ np.cross(rate_b, lever_b), acceleration)
