"""Attitude of another sensor against that of the filter: residual, Jacobian and noise.

With true C = (I + [phi x]) computed C the residual is the rotation vector from the predicted to the measured attitude, in NED.
Si, Wang and Niu (SINS/CNS, launch-inertial frame) have z = phi + v with phi against inertial space; in NED the turn of the
frame itself with position comes to it: an attitude against the stars measures phi + dtheta, dtheta = [dE / R_N, -dN / R_M,
-dE tan(lat) / R_N]. The rotation vector is exact, so that the residual is linear for errors of any size that do not turn over.
"""

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION
from navreplay.geodesy import earth
from navreplay.geodesy.rotation import (
    euler_from_quat,
    matrix_from_quat,
    quat_conjugate,
    quat_multiply,
    rotvec_from_quat,
    wrap_angle,
)
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import AttitudeOptions
from navreplay.timeline import AttitudeSeries, Floats
from navreplay.update.measurement import Measurement

__all__ = ["attitude_measurement", "attitude_nb", "attitude_noise", "heading_measurement"]

_AXES = ("north", "east", "down")


def attitude_noise(attitude: AttitudeSeries, options: AttitudeOptions) -> Floats:
    """R (n, 3, 3) [rad^2] of each attitude, about the axes of its frame: scaled covariance where known, raised to the floor."""
    unknown = np.isnan(attitude.cov.sum(axis=(1, 2)))
    cov = np.where(unknown[:, None, None], options.default_std**2 * np.eye(3), attitude.cov) * options.noise_scale**2
    missing = np.maximum(options.std_floor**2 - np.diagonal(cov, axis1=1, axis2=2), 0)
    return np.asarray(cov + missing[:, :, None] * np.eye(3))


def attitude_nb(attitude: AttitudeSeries, row: int, lla: Floats) -> tuple[Floats, Floats]:
    """q_nb (4,) of a measured attitude at lla (3,), and C_nf (3, 3) from the axes of its frame to NED there."""
    if attitude.frame == "navigation":
        return attitude.q[row], np.eye(3)
    q_ne = quat_conjugate(earth.quat_en(lla[0], lla[1]))
    return quat_multiply(q_ne, attitude.q[row]), matrix_from_quat(q_ne)


def attitude_measurement(state: NavState, attitude: AttitudeSeries, row: int, noise: Floats, size: int) -> Measurement:
    """Measured attitude of that row against the state's; noise (3, 3) [rad^2] in its frame; error state of given size."""
    q_nb, c_nf = attitude_nb(attitude, row, state.lla)
    residual = rotvec_from_quat(quat_multiply(q_nb, quat_conjugate(state.q_nb)))
    jacobian = np.zeros((3, size))
    jacobian[:, ATTITUDE] = np.eye(3)
    if attitude.frame == "earth":
        jacobian[:, POSITION] = earth.frame_turn_n(state.lla)
    return Measurement(residual, jacobian, c_nf @ noise @ c_nf.T, ("attitude",) * 3, _AXES)


def heading_measurement(state: NavState, attitude: AttitudeSeries, row: int, noise: Floats, size: int) -> Measurement:
    """Measured heading of that row, whose roll and pitch say nothing; noise (3, 3) [rad^2], of which the vertical part counts.

    d(yaw) = phi_D + tan(pitch) (phi_N cos(yaw) + phi_E sin(yaw)), from the horizontal part of the body's x axis.
    """
    _, pitch, yaw = euler_from_quat(state.q_nb)
    jacobian = np.zeros((1, size))
    jacobian[0, ATTITUDE] = [np.tan(pitch) * np.cos(yaw), np.tan(pitch) * np.sin(yaw), 1.0]
    residual = wrap_angle(euler_from_quat(attitude.q[row])[2:] - yaw)
    return Measurement(residual, jacobian, noise[2:, 2:], ("heading",), ("heading",))
