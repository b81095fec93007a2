"""Wheels and a barometer of a land vehicle, as they tell what is known."""

from dataclasses import dataclass

import numpy as np

from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.timeline import BaroSeries, SpeedSeries, Trajectory

__all__ = ["BaroErrors", "WheelErrors", "barometer_of", "wheels_of"]


@dataclass(frozen=True, slots=True)
class WheelErrors:
    """noise [m/s]: of a speed of wheels that turn. quantum [m/s]: its step, 0 of none. scale: metres per second for a unit of
    the sensor. late [s]: by how much its stamps are. track [m]: by which left and right differ for one rad/s."""

    noise: float = 0.03
    quantum: float = 0.0
    scale: float = 1.0
    late: float = 0.0
    track: float = 1.5


@dataclass(frozen=True, slots=True)
class BaroErrors:
    """noise [m]: white. zero [m]: of its height. drift [m]: of its bias from the first row to the last."""

    noise: float = 0.1
    zero: float = -37.0
    drift: float = 0.5


def wheels_of(truth: Trajectory, errors: WheelErrors, rng: np.random.Generator) -> SpeedSeries:
    """At the times of truth, whose attitude is the vehicle's; turns by its change of heading."""
    c_nb = matrix_from_quat(truth.q_nb)
    forward = np.einsum("ki,ki->k", c_nb[:, :, 0], truth.vel_n)
    speed = forward + errors.noise * rng.standard_normal(len(forward)) * (np.abs(forward) > 0.1)
    if errors.quantum:
        speed = np.round(speed / errors.quantum) * errors.quantum
    heading = np.unwrap(np.arctan2(c_nb[:, 1, 0], c_nb[:, 0, 0]))
    turn = np.gradient(heading, (truth.t_ns - truth.t_ns[0]) / 1e9) * errors.track
    return SpeedSeries(truth.t_ns + round(errors.late * 1e9), speed / errors.scale, turn / errors.scale)


def barometer_of(truth: Trajectory, errors: BaroErrors, rng: np.random.Generator) -> BaroSeries:
    """At the times of truth."""
    n = len(truth)
    bias = errors.zero + np.linspace(0.0, errors.drift, n)
    return BaroSeries(truth.t_ns, truth.lla[:, 2] + bias + errors.noise * rng.standard_normal(n))
