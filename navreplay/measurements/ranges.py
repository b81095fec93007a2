"""Pseudoranges and range rates against a predicted state: residuals, Jacobians, noise.

Groves (2013), 9.2 and 14.3.2. Satellite positions are in Earth-fixed axes of the time of reception, turned for the signal's
flight, so that distances need no Sagnac term; with velocities in the same axes neither do the rates (what the flight time's
own change adds stays below 6 mm/s).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.error_models.ned import POSITION, VELOCITY
from navreplay.geodesy import earth
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.measurements.fixes import cross_matrix, position_jacobian, velocity_jacobian
from navreplay.measurements.range_epochs import RangeEpochs
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats
from navreplay.update.measurement import Measurement

__all__ = ["Antenna", "RangeNoise", "carried_antenna", "free_antenna", "range_measurement"]


class Antenna(NamedTuple):
    """Where the antenna is and moves: pos_e (3,) [m, Earth-fixed], c_en (3, 3), vel_n (3,) [m/s], and the Jacobians (3, n) of
    its position and velocity, NED, against the states of motion."""

    pos_e: Floats
    c_en: Floats
    vel_n: Floats
    position_jacobian: Floats
    velocity_jacobian: Floats


class RangeNoise(NamedTuple):
    """Of all rows (n,): variance of the white noise of pseudoranges [m^2] and of range rates [m^2/s^2], standard deviation of
    the multipath in pseudoranges [m], and which of the clock's c states is a row's multipath (-1: none is)."""

    pseudorange: Floats
    range_rate: Floats
    multipath_std: Floats
    multipath_state: NDArray[np.intp]


def carried_antenna(state: NavState, lever_b: Floats, rate_b: Floats, size: int) -> Antenna:
    """The antenna lever_b (3,) [m] off the IMU of a body that turns with rate_b (3,) [rad/s] against the Earth."""
    c_nb = matrix_from_quat(state.q_nb)
    c_en = earth.matrix_en(state.lla[0], state.lla[1])
    lever_n = c_nb @ lever_b
    swing_n = c_nb @ (cross_matrix(rate_b) @ lever_b)
    position, velocity = position_jacobian(lever_n, size), velocity_jacobian(c_nb, lever_b, swing_n, size)
    pos_e = earth.ecef_from_lla(state.lla) + c_en @ lever_n
    return Antenna(pos_e, c_en, state.vel_n + swing_n, position, velocity)


def free_antenna(state: NavState, size: int) -> Antenna:
    """The antenna where the state itself is the antenna's."""
    position, velocity = np.zeros((3, size)), np.zeros((3, size))
    position[:, POSITION] = velocity[:, VELOCITY] = np.eye(3)
    c_en = earth.matrix_en(state.lla[0], state.lla[1])
    return Antenna(earth.ecef_from_lla(state.lla), c_en, state.vel_n, position, velocity)


def range_measurement(antenna: Antenna, clock: Floats, epochs: RangeEpochs, rows: slice, noise: RangeNoise) -> Measurement:
    """Rows of corrected epochs against the antenna and the clock (c,): all pseudoranges (kind ``range``), then all range rates
    that are known (``range_rate``), labelled by satellite.

    Residuals in m and m/s. The states are those of motion, then the clock's: offsets, drift, multipath.
    """
    group = epochs.group[rows]
    drift = len(epochs.groups)
    shaped, scale = noise.multipath_state[rows], noise.multipath_std[rows]
    rated = np.flatnonzero(np.isfinite(epochs.range_rate[rows]))
    # the receiver stamps by its own clock: the signals came that much before the stamp
    pos_e = antenna.pos_e - antenna.c_en @ antenna.vel_n * (clock[0] / SPEED_OF_LIGHT)
    towards_n = (epochs.sat_pos_e[rows] - pos_e) @ antenna.c_en
    distance = np.sqrt((towards_n**2).sum(axis=1))
    sight = towards_n / distance[:, None]
    approach_n = epochs.sat_vel_e[rows][rated] @ antenna.c_en - antenna.vel_n
    rate = (sight[rated] * approach_n).sum(axis=1)
    m, n = len(distance), antenna.position_jacobian.shape[1]
    jacobian = np.zeros((m + len(rated), n + len(clock)))
    jacobian[:m, :n] = -sight @ antenna.position_jacobian
    jacobian[np.arange(m), n + group] = 1.0
    # the line of sight itself turns with position
    turning = (approach_n - sight[rated] * rate[:, None]) / distance[rated, None]
    jacobian[m:, :n] = -sight[rated] @ antenna.velocity_jacobian - turning @ antenna.position_jacobian
    jacobian[m:, n + drift] = 1.0
    multipath = np.zeros(m)
    if len(clock) > drift + 1:
        jacobian[np.arange(m), n + shaped] = scale
        multipath = scale * clock[shaped]
    residual = np.concatenate(
        [
            epochs.pseudorange[rows] - distance - clock[group] - multipath,
            epochs.range_rate[rows][rated] - rate - clock[drift],
        ]
    )
    white = np.diag(np.concatenate([noise.pseudorange[rows], noise.range_rate[rows][rated]]))
    return Measurement(residual, jacobian, white, ("range",) * m + ("range_rate",) * len(rated), _labels(epochs, rows, rated))


def _labels(epochs: RangeEpochs, rows: slice, rated: NDArray[np.intp]) -> tuple[str, ...]:
    satellites = epochs.sat[rows].tolist()
    return (*satellites, *(satellites[i] for i in rated.tolist()))
