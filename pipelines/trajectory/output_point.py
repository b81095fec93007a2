"""The solution of the IMU moved to another point of the rigid body."""

from dataclasses import replace

import numpy as np

from navreplay.geodesy.earth import earth_rate_n, move_lla, transport_rate_n
from navreplay.geodesy.rotation import matrix_from_quat, skew
from navreplay.solution import Solution
from navreplay.timeline import Floats, ImuSeries

__all__ = ["move_to_point"]


def move_to_point(solution: Solution, imu: ImuSeries, lever_b: Floats) -> Solution:
    """The same solution for a point at lever_b (3,) [m] from the IMU, body axes.

    Position gains C_nb l, velocity C_nb (w_nb x l) with the body's rate against NED from the bias-corrected gyro. The
    covariance follows to first order: with r = C_nb l, an attitude error phi moves the point by phi x r, and a gyro bias
    error moves its velocity by C_nb (l x bias error).
    """
    c_nb = matrix_from_quat(solution.q_nb)
    r_n = c_nb @ lever_b
    w_b = _body_rate(solution, imu, c_nb)
    v_n = np.einsum("kij,kj->ki", c_nb, np.cross(w_b, lever_b))
    jacobian = np.broadcast_to(np.eye(solution.cov.shape[1]), solution.cov.shape).copy()
    jacobian[:, 0:3, 6:9] = -skew(r_n)
    jacobian[:, 3:6, 6:9] = -skew(v_n)
    bias = solution.state_names.index("gyro_bias_x")
    jacobian[:, 3:6, bias : bias + 3] = c_nb @ skew(lever_b)
    return replace(
        solution,
        lla=move_lla(solution.lla, r_n),
        vel_n=solution.vel_n + v_n,
        cov=jacobian @ solution.cov @ np.swapaxes(jacobian, 1, 2),
    )


def _body_rate(solution: Solution, imu: ImuSeries, c_nb: Floats) -> Floats:
    """Rate of the body against NED (k, 3) [rad/s], body axes: the gyro at the output epochs less bias and frame rate."""
    gyro = np.stack([np.interp(solution.t_ns, imu.t_ns, imu.gyro[:, axis]) for axis in range(3)], axis=1)
    frame_n = earth_rate_n(solution.lla[:, 0]) + transport_rate_n(solution.lla, solution.vel_n)
    return np.asarray(gyro - solution.gyro_bias - np.einsum("kji,kj->ki", c_nb, frame_n))
