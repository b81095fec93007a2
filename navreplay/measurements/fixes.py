"""Positions and velocities of an antenna: what was measured, minus what the state predicts, with Jacobian and nominal noise."""

from math import cos
from typing import NamedTuple

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION, VELOCITY, gyro_columns
from navreplay.geodesy import earth
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions
from navreplay.timeline import FixStatus, Floats, GnssFixSeries
from navreplay.update.measurement import Measurement

__all__ = [
    "FixNoise",
    "angular_rate",
    "cross_matrix",
    "fix_noise",
    "position_jacobian",
    "position_measurement",
    "velocity_jacobian",
    "velocity_measurement",
]

_AXES = ("north", "east", "down")
_IDENTITY = np.eye(3)


class FixNoise(NamedTuple):
    """Told noise of every row of a fix series: position (k, 3, 3) [m^2] and velocity (k, 3, 3) [m^2/s^2], NED."""

    position: Floats
    velocity: Floats


def fix_noise(fixes: GnssFixSeries, options: FilterOptions) -> FixNoise:
    """R of each fix: its covariance where known, the default of its status elsewhere; floors, then the noise scale, applied."""
    horizontal, vertical = np.array([options.default_position_std[s.name] for s in FixStatus]).T
    default = np.stack([horizontal, horizontal, vertical], axis=1)[fixes.status] ** 2
    position = _fill_unknown(fixes.cov_pos, default)
    across, along_down = options.default_velocity_std
    velocity = _fill_unknown(fixes.cov_vel, np.tile(np.square([across, across, along_down]), (len(fixes), 1)))
    return FixNoise(
        _raise_diagonal(position, options.position_std_floor**2) * (options.noise_scale * options.position_noise_scale) ** 2,
        _raise_diagonal(velocity, options.velocity_std_floor**2) * (options.noise_scale * options.velocity_noise_scale) ** 2,
    )


def _fill_unknown(cov: Floats, default: Floats) -> Floats:
    unknown = np.isnan(cov.sum(axis=(1, 2)))
    return np.where(unknown[:, None, None], default[:, :, None] * np.eye(3), cov)


def _raise_diagonal(cov: Floats, least: float) -> Floats:
    missing = np.maximum(least - np.diagonal(cov, axis1=1, axis2=2), 0)
    return np.asarray(cov + missing[:, :, None] * np.eye(3))


def angular_rate(state: NavState, dtheta: Floats, dt: float) -> Floats:
    """Rate of the body against the Earth (3,) [rad/s], body axes, from one step's rotation (3,) and length [s]."""
    inertial = (dtheta / dt - state.gyro_error) / (1 + state.gyro_scale)
    return np.asarray(inertial - matrix_from_quat(state.q_nb).T @ earth.earth_rate_n(state.lla[0]))


def position_measurement(state: NavState, lever_b: Floats, lla: Floats, noise: Floats, size: int) -> Measurement:
    """Antenna position lla (3,) against the IMU's, lever arm lever_b (3,) [m], noise (3, 3); error state of given size.

    Residual in NED metres. Groves (2013), 14.3.
    """
    lever_n = matrix_from_quat(state.q_nb) @ lever_b
    meridian, normal = earth.radii(state.lla[0])
    height = state.lla[2]
    metres = np.array([meridian + height, (normal + height) * cos(state.lla[0]), -1.0])
    difference = lla - state.lla
    difference[1] = (difference[1] + np.pi) % (2 * np.pi) - np.pi
    jacobian = position_jacobian(lever_n, size)
    return Measurement(difference * metres - lever_n, jacobian, noise, ("position",) * 3, _AXES)


def velocity_measurement(
    state: NavState, lever_b: Floats, rate_b: Floats, vel_n: Floats, noise: Floats, size: int
) -> Measurement:
    """Antenna velocity vel_n (3,) NED against the IMU's plus w x l, with rate_b (3,) of the body against the Earth [rad/s]."""
    c_nb = matrix_from_quat(state.q_nb)
    swing_n = c_nb @ (cross_matrix(rate_b) @ lever_b)
    jacobian = velocity_jacobian(c_nb, lever_b, swing_n, size)
    return Measurement(vel_n - state.vel_n - swing_n, jacobian, noise, ("velocity",) * 3, _AXES)


def position_jacobian(lever_n: Floats, size: int) -> Floats:
    """(3, size) of the antenna's position, lever_n (3,) [m] off the IMU in NED, against the error state."""
    jacobian = np.zeros((3, size))
    jacobian[:, POSITION] = _IDENTITY
    jacobian[:, ATTITUDE] = -cross_matrix(lever_n)
    return jacobian


def velocity_jacobian(c_nb: Floats, lever_b: Floats, swing_n: Floats, size: int) -> Floats:
    """(3, size) of the antenna's velocity against the error state: swing_n (3,) [m/s] of it comes from the body's turning."""
    jacobian = np.zeros((3, size))
    jacobian[:, VELOCITY] = _IDENTITY
    jacobian[:, ATTITUDE] = -cross_matrix(swing_n)
    turned = c_nb @ cross_matrix(lever_b)
    for columns in gyro_columns(size):
        jacobian[:, columns] = turned
    return jacobian


def cross_matrix(v: Floats) -> Floats:
    """(3, 3) of the cross product with v (3,) from the left: `rotation.skew` for a single vector, ten times as fast."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
