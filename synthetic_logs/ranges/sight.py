"""Lines of sight from an antenna to satellites: ranges by light time, and their exact rates.

The signal that arrives at time t left the satellite at t - d/c, d being the distance between the two places in inertial space:
d = |C(w d/c) s(t - d/c) - r(t)|, with C(angle) the turn of the Earth-fixed axes during the flight (Sagnac effect).
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.earth import EARTH_RATE, ecef_from_lla, matrix_en
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import Floats
from synthetic_logs.ranges.constellation import Orbits, SatelliteStates, satellite_states

__all__ = ["Sights", "sight_satellites"]

_TYPICAL_FLIGHT_S = 0.077
_LOWERED_MASK = 1e-4


@dataclass(frozen=True, eq=False, slots=True)
class Sights:
    """A row for each epoch and satellite above the mask, k rows in the order of epochs, then of satellites.

    epoch, satellite: (k,) indices. distance (k,) [m], rate (k,) [m/s]: of the signal's path, and its derivative by the time of
    reception. azimuth, elevation (k,) [rad]. pos_e (k, 3) [m], vel_e (k, 3) [m/s]: satellite at transmission, in Earth-fixed
    axes of the time of reception. clock [s], clock_rate: (k,) of the satellite at transmission.
    """

    epoch: NDArray[np.intp]
    satellite: NDArray[np.intp]
    distance: Floats
    rate: Floats
    azimuth: Floats
    elevation: Floats
    pos_e: Floats
    vel_e: Floats
    clock: Floats
    clock_rate: Floats

    def rows(self, kept: NDArray[np.bool_]) -> "Sights":
        """The rows where kept (k,) is true."""
        return Sights(*(getattr(self, field.name)[kept] for field in fields(self)))


def sight_satellites(orbits: Orbits, t_s: Floats, lla: Floats, vel_n: Floats, mask: float) -> Sights:
    """All satellites above the elevation mask [rad] at reception times t_s (n,) [s since the reference time of the orbits],
    from an antenna at lla (n, 3) [rad, rad, m] that moves with vel_n (n, 3) [m/s]."""
    c_en, here_e = matrix_en(lla[:, 0], lla[:, 1]), ecef_from_lla(lla)
    epoch, satellite = np.divmod(np.arange(len(t_s) * len(orbits)), len(orbits))
    states = satellite_states(orbits.rows(satellite), t_s[epoch] - _TYPICAL_FLIGHT_S)
    to_satellite = _turn_axes(states.pos_e, _TYPICAL_FLIGHT_S) - here_e[epoch]
    up = np.einsum("ki,ki->k", to_satellite, -c_en[epoch, :, 2]) / np.linalg.norm(to_satellite, axis=1)
    candidates = up > np.sin(mask) - _LOWERED_MASK
    epoch, satellite = epoch[candidates], satellite[candidates]
    states, flight = _transmit(orbits.rows(satellite), t_s[epoch], here_e[epoch])
    sights = _look(epoch, satellite, states, flight, here_e, c_en, vel_n)
    return sights.rows(sights.elevation >= mask)


def _turn_axes(vectors_e: Floats, flight: Floats | float) -> Floats:
    """Vectors in Earth-fixed axes of transmission, expressed in those of reception, a flight time [s] later."""
    sine, cosine = np.sin(EARTH_RATE * flight), np.cos(EARTH_RATE * flight)
    x, y, z = vectors_e.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def _transmit(orbits: Orbits, t_s: Floats, here_e: Floats) -> tuple[SatelliteStates, Floats]:
    """States at transmission, axes of transmission, and flight times (k,) [s]. Each pass divides the error by c over the range
    rate, so that three passes from a few milliseconds reach rounding."""
    flight = np.full(len(t_s), _TYPICAL_FLIGHT_S)
    for _ in range(3):
        states = satellite_states(orbits, t_s - flight)
        flight = np.linalg.norm(_turn_axes(states.pos_e, flight) - here_e, axis=1) / SPEED_OF_LIGHT
    return satellite_states(orbits, t_s - flight), flight


def _look(
    epoch: NDArray[np.intp],
    satellite: NDArray[np.intp],
    states: SatelliteStates,
    flight: Floats,
    here_e: Floats,
    c_en: Floats,
    vel_n: Floats,
) -> Sights:
    pos_e, vel_e = _turn_axes(states.pos_e, flight), _turn_axes(states.vel_e, flight)
    path_e = pos_e - here_e[epoch]
    distance = np.linalg.norm(path_e, axis=1)
    sight_e = path_e / distance[:, None]
    here_vel_e = np.einsum("nij,nj->ni", c_en, vel_n)[epoch]
    # d(distance)/dt = e . (v (1 - f') + f' w x ... - u), with f' = rate / c the derivative of the flight time
    turn_e = EARTH_RATE * np.stack([pos_e[:, 1], -pos_e[:, 0], np.zeros(len(pos_e))], axis=-1)
    slowing = np.einsum("ki,ki->k", sight_e, turn_e - vel_e) / SPEED_OF_LIGHT
    rate = np.einsum("ki,ki->k", sight_e, vel_e - here_vel_e) / (1 - slowing)
    north, east, down = np.einsum("kij,ki->jk", c_en[epoch], sight_e)
    azimuth, elevation = np.arctan2(east, north), np.arcsin(-down)
    return Sights(
        epoch,
        satellite,
        distance,
        rate,
        azimuth,
        elevation,
        pos_e,
        vel_e,
        states.clock,
        states.clock_rate * (1 - rate / SPEED_OF_LIGHT),
    )
