"""GNSS fixes of an antenna on a lever arm: white and time-correlated noise, mixtures, outliers, outages, noise that changes.

Windows are (start, end) in seconds from the start of the log, the end excluded; scales act on standard deviations.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from navreplay.geodesy.earth import move_lla, transport_rate_n
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.timeline import FixStatus, Floats, GnssFixSeries, Times
from synthetic_logs.motion.kinematics import Kinematics
from synthetic_logs.sensors.imu_errors import draw_gauss_markov
from synthetic_logs.sensors.seeding import generator_for
from synthetic_logs.sensors.windows import ScaledWindow, scale_in

__all__ = ["AntennaPath", "FixErrors", "GnssErrors", "antenna_path", "measure_fixes"]

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class GnssErrors:
    """Errors of GNSS fixes; triples are NED.

    position_std [m], velocity_std [m/s] (None: the log has no velocity): white noise. correlated_std [m] with
    correlation_time [s]: first-order Gauss-Markov position error, steady from the first epoch. mixture_probability: share of
    epochs whose white noise has mixture_scale times its standard deviation, one label for all components. outlier_probability:
    share of epochs with a position error of outlier_size [m] in a random direction on top. position_bias_std [m] and
    velocity_bias_std [m/s]: of errors that are drawn once and stay for the whole log. outages: windows (start, end)
    without fixes. noise_windows: (start, end, scale) of the white noise in the data.

    The covariance told in the log is that of told_position_std and told_velocity_std (None: those of white and correlated
    noise together), times told_windows (start, end, scale); noise_windows, mixture, outliers and biases are never told.
    """

    position_std: Triple
    velocity_std: Triple | None
    correlated_std: Triple = (0.0, 0.0, 0.0)
    correlation_time: float = 30.0
    mixture_probability: float = 0.0
    mixture_scale: float = 1.0
    outlier_probability: float = 0.0
    outlier_size: float = 0.0
    position_bias_std: Triple = (0.0, 0.0, 0.0)
    velocity_bias_std: Triple = (0.0, 0.0, 0.0)
    outages: tuple[tuple[float, float], ...] = ()
    noise_windows: tuple[ScaledWindow, ...] = ()
    told_position_std: Triple | None = None
    told_velocity_std: Triple | None = None
    told_windows: tuple[ScaledWindow, ...] = ()
    status: FixStatus = FixStatus.SINGLE


@dataclass(frozen=True, eq=False, slots=True)
class AntennaPath:
    """Truth at the antenna: lla (n, 3) [rad, rad, m], vel_n (n, 3) NED [m/s]."""

    lla: Floats
    vel_n: Floats


@dataclass(frozen=True, eq=False, slots=True)
class FixErrors:
    """What was drawn for the fixes of a log, row by row of it.

    antenna: the truth. position (n, 3) NED [m] and velocity (n, 3) NED [m/s], zero where the log has none: the errors.
    correlated (n, 3) NED [m]: the part of position that is correlated in time. wide, outlier (n,): labels of the mixture's wide
    component and of outliers. cov_pos (n, 3, 3), cov_vel (n, 3, 3): true second moments, windows and mixture included, outliers
    and biases not. bias_pos (3,) NED [m] and bias_vel (3,) NED [m/s]: the part of position and velocity that stays.
    """

    antenna: AntennaPath
    position: Floats
    velocity: Floats
    correlated: Floats
    wide: NDArray[np.bool_]
    outlier: NDArray[np.bool_]
    cov_pos: Floats
    cov_vel: Floats
    bias_pos: Floats
    bias_vel: Floats


def antenna_path(motion: Kinematics, lever_b: Floats) -> AntennaPath:
    """Position and velocity of a point at lever_b (3,) [m] in the body axes of motion, relative to the Earth."""
    c_nb = matrix_from_quat(motion.q_nb)
    offset_n = np.einsum("kij,j->ki", c_nb, lever_b)
    turn_n = np.einsum("kij,kj->ki", c_nb, motion.turn_b) + transport_rate_n(motion.lla, motion.vel_n)
    return AntennaPath(move_lla(motion.lla, offset_n), motion.vel_n + np.cross(turn_n, offset_n))


def _diagonal(std: Floats) -> Floats:
    return std[:, :, None] ** 2 * np.eye(3)


def _draw_correlated(n: int, interval: float, errors: GnssErrors, rng: Generator) -> Floats:
    if not any(errors.correlated_std):
        return np.zeros((n, 3))
    tau = errors.correlation_time
    steady = rng.standard_normal(3)
    return np.array(errors.correlated_std) * draw_gauss_markov(rng, steady, sqrt(2 / tau), tau, interval, n)


def _draw_errors(antenna: AntennaPath, t_s: Floats, interval: float, errors: GnssErrors, seed: int) -> FixErrors:
    n = len(t_s)
    correlated = _draw_correlated(n, interval, errors, generator_for(seed, "correlated position"))
    wide = generator_for(seed, "mixture").random(n) < errors.mixture_probability
    outlier = generator_for(seed, "outlier epochs").random(n) < errors.outlier_probability
    direction = generator_for(seed, "outlier directions").standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    window_scale = scale_in(errors.noise_windows, t_s)[:, None]
    drawn_scale = window_scale * np.where(wide, errors.mixture_scale, 1.0)[:, None]
    share = errors.mixture_probability
    moment_scale = window_scale * np.sqrt(1 - share + share * errors.mixture_scale**2)
    velocity_std = np.array(errors.velocity_std or (0.0, 0.0, 0.0))
    position = drawn_scale * errors.position_std * generator_for(seed, "white position").standard_normal((n, 3)) + correlated
    position += np.where(outlier, errors.outlier_size, 0.0)[:, None] * direction
    velocity = drawn_scale * velocity_std * generator_for(seed, "white velocity").standard_normal((n, 3))
    bias_pos = errors.position_bias_std * generator_for(seed, "position bias").standard_normal(3)
    bias_vel = errors.velocity_bias_std * generator_for(seed, "velocity bias").standard_normal(3)
    cov_pos = _diagonal(moment_scale * errors.position_std) + _diagonal(np.tile(errors.correlated_std, (n, 1)))
    cov_vel = _diagonal(moment_scale * velocity_std)
    position, velocity = position + bias_pos, velocity + bias_vel
    return FixErrors(antenna, position, velocity, correlated, wide, outlier, cov_pos, cov_vel, bias_pos, bias_vel)


def measure_fixes(
    t_ns: Times, t_s: Floats, interval: float, antenna: AntennaPath, errors: GnssErrors, seed: int
) -> tuple[GnssFixSeries, FixErrors]:
    """The fixes of a log and their errors, without the epochs in outages.

    t_ns: (n,) epochs, t_s: the same from the start of the log [s], interval [s] apart. Outages and changed figures leave
    all other draws of a seed as they are.
    """
    drawn = _draw_errors(antenna, t_s, interval, errors, seed)
    n = len(t_s)
    told_scale = scale_in(errors.told_windows, t_s)[:, None]
    told_position = np.array(errors.told_position_std or np.hypot(errors.position_std, errors.correlated_std))
    cov_pos = _diagonal(told_scale * told_position)
    vel_n, cov_vel = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    if errors.velocity_std is not None:
        vel_n = antenna.vel_n + drawn.velocity
        cov_vel = _diagonal(told_scale * np.array(errors.told_velocity_std or errors.velocity_std))
    kept = np.ones(n, dtype=bool)
    for start, end in errors.outages:
        kept &= (t_s < start) | (t_s >= end)
    status = np.full(n, errors.status, dtype=np.int8)
    lla = move_lla(antenna.lla, drawn.position)
    fixes = GnssFixSeries(t_ns[kept], lla[kept], vel_n[kept], cov_pos[kept], cov_vel[kept], status[kept])
    return fixes, _rows(drawn, kept)


def _rows(drawn: FixErrors, kept: NDArray[np.bool_]) -> FixErrors:
    return FixErrors(
        AntennaPath(drawn.antenna.lla[kept], drawn.antenna.vel_n[kept]),
        drawn.position[kept],
        drawn.velocity[kept],
        drawn.correlated[kept],
        drawn.wide[kept],
        drawn.outlier[kept],
        drawn.cov_pos[kept],
        drawn.cov_vel[kept],
        drawn.bias_pos,
        drawn.bias_vel,
    )
