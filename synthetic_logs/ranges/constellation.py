"""GPS, Galileo and BeiDou satellites in medium orbits: broadcast elements, and states from them.

Elements and equations are those of the interface documents (IS-GPS-200 table 20-IV, Galileo OS SIS ICD 5.1.1, BDS-SIS-ICD-B1I
5.2.4.12), the velocity their analytic derivative. The satellites move exactly as their ephemerides say. Arrangement: GPS six
planes of five, Galileo and BeiDou Walker 24/3/1, all slightly irregular as real ones are. Units: SI and radians.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from math import pi, tau

import numpy as np
from numpy.random import default_rng
from numpy.typing import NDArray

from navreplay.geodesy.time_scales import WEEK_S
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import Floats

__all__ = [
    "Orbits",
    "SatelliteStates",
    "arrange_constellation",
    "ascending_node",
    "refer_to",
    "satellite_states",
]

_EARTH_RATE = {"G": 7.2921151467e-5, "E": 7.2921151467e-5, "C": 7.292115e-5}
_GM = {"G": 3.986005e14, "E": 3.986004418e14, "C": 3.986004418e14}
_S = 1_000_000_000


@dataclass(frozen=True, eq=False, slots=True)
class Orbits:
    """Broadcast elements of m satellites at reference_ns [GPS ns], each (m,) in the order of sat.

    sqrt_a [sqrt(m)]; eccentricity; inclination, perigee, mean_anomaly [rad]; node_longitude [rad]: Earth-fixed longitude of the
    ascending node at the reference time (see `ascending_node` for Omega0); delta_n, inclination_rate, node_rate [rad/s];
    cuc, cus, cic, cis [rad], crc, crs [m]: harmonic corrections; af0 [s], af1: clock; group_delay [s]: of the signal used, to
    be subtracted from the clock; earth_rate [rad/s] and gm [m^3/s^2]: constants of the system.
    """

    reference_ns: int
    sat: NDArray[np.str_]
    sqrt_a: Floats
    eccentricity: Floats
    inclination: Floats
    node_longitude: Floats
    perigee: Floats
    mean_anomaly: Floats
    delta_n: Floats
    inclination_rate: Floats
    node_rate: Floats
    cuc: Floats
    cus: Floats
    crc: Floats
    crs: Floats
    cic: Floats
    cis: Floats
    af0: Floats
    af1: Floats
    group_delay: Floats
    earth_rate: Floats
    gm: Floats

    def __len__(self) -> int:
        return len(self.sat)

    @property
    def mean_motion(self) -> Floats:
        """(m,) corrected mean motion [rad/s]."""
        return np.sqrt(self.gm) / self.sqrt_a**3 + self.delta_n

    def rows(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> "Orbits":
        """The satellites at index, in that order."""
        arrays = [field.name for field in fields(self) if field.name != "reference_ns"]
        return replace(self, **{name: getattr(self, name)[index] for name in arrays})


@dataclass(frozen=True, eq=False, slots=True)
class SatelliteStates:
    """pos_e (k, 3) [m], vel_e (k, 3) [m/s]: Earth-fixed axes of the same moment. clock (k,) [s], clock_rate (k,): offset from
    system time with relativity, without group delay, and its derivative."""

    pos_e: Floats
    vel_e: Floats
    clock: Floats
    clock_rate: Floats


@dataclass(frozen=True, slots=True)
class _Shell:
    """Satellites of one system: numbers, planes, nominal semi-major axis [m] and inclination [rad], phase between planes [rad],
    longitude of the first node [rad], means of eccentricity and of group delay [s]."""

    system: str
    numbers: tuple[int, ...]
    planes: int
    semi_major_axis: float
    inclination: float
    plane_phase: float
    first_node: float
    eccentricity: float
    group_delay: float


_BEIDOU_MEO = (*range(19, 31), *range(32, 38), *range(41, 47))
_SHELLS = (
    _Shell("G", tuple(range(1, 31)), 6, 26_559_710.0, 55 * pi / 180, 0.55, 0.2, 0.008, -5e-9),
    _Shell("E", tuple(range(1, 25)), 3, 29_600_318.0, 56 * pi / 180, tau / 24, 0.6, 0.0002, 2e-9),
    _Shell("C", _BEIDOU_MEO, 3, 27_906_100.0, 55 * pi / 180, tau / 24, 1.5, 0.0006, 6e-9),
)


@lru_cache(maxsize=4)
def arrange_constellation(systems: str, reference_ns: int) -> Orbits:
    """The satellites of some systems, such as ``GEC``, with elements for reference_ns [GPS ns]; its arrays are read-only.

    In the order of their names; the same arrangement over the ground at every reference time. Raises KeyError for an unknown
    system.
    """
    shells = {shell.system: shell for shell in _SHELLS}
    parts = [_arrange_shell(shells[system], reference_ns) for system in sorted(systems)]
    columns = [field.name for field in fields(Orbits) if field.name != "reference_ns"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in columns}
    for column in joined.values():
        column.flags.writeable = False
    return Orbits(reference_ns, **joined)


def _arrange_shell(shell: _Shell, reference_ns: int) -> Orbits:
    rng = default_rng([ord(shell.system), len(shell.numbers)])
    m = len(shell.numbers)
    plane, slot = np.divmod(np.arange(m), m // shell.planes)

    def scattered(mean: float, std: float) -> Floats:
        """A normal draw (m,) per satellite."""
        return mean + std * rng.standard_normal(m)

    perigee = rng.uniform(-pi, pi, m)
    argument = tau * shell.planes * slot / m + shell.plane_phase * plane + scattered(0.0, 0.05)
    return Orbits(
        reference_ns,
        np.array([f"{shell.system}{number:02d}" for number in shell.numbers]),
        np.sqrt(scattered(shell.semi_major_axis, 800.0)),
        shell.eccentricity * rng.uniform(0.2, 1.8, m),
        scattered(shell.inclination, 0.008),
        np.remainder(shell.first_node + tau * plane / shell.planes + scattered(0.0, 0.02), tau),
        perigee,
        np.remainder(argument - perigee, tau),
        scattered(4.5e-9, 3e-10),
        scattered(0.0, 3e-10),
        scattered(-8.2e-9, 2e-10),
        scattered(0.0, 2e-6),
        scattered(0.0, 5e-6),
        scattered(0.0, 150.0),
        scattered(0.0, 50.0),
        scattered(0.0, 8e-8),
        scattered(0.0, 8e-8),
        scattered(0.0, 2e-4),
        scattered(0.0, 4e-12),
        scattered(shell.group_delay, 4e-9),
        np.full(m, _EARTH_RATE[shell.system]),
        np.full(m, _GM[shell.system]),
    )


def refer_to(orbits: Orbits, reference_ns: int) -> Orbits:
    """The same motion and clocks in elements for another reference time [GPS ns]: the next ephemeris of the satellites."""
    shift = (reference_ns - orbits.reference_ns) / _S
    return replace(
        orbits,
        reference_ns=reference_ns,
        inclination=orbits.inclination + orbits.inclination_rate * shift,
        node_longitude=np.remainder(orbits.node_longitude + (orbits.node_rate - orbits.earth_rate) * shift, tau),
        mean_anomaly=np.remainder(orbits.mean_anomaly + orbits.mean_motion * shift, tau),
        af0=orbits.af0 + orbits.af1 * shift,
    )


def ascending_node(orbits: Orbits, ahead_s: int) -> Floats:
    """The broadcast Omega0 (m,) [rad]: right ascension of the node, as the longitude of the node at the beginning of the
    week. ahead_s: how much GPS time is ahead of the system's time, in which the week begins [s]."""
    time_of_week = (orbits.reference_ns / _S - ahead_s) % WEEK_S
    return np.remainder(orbits.node_longitude + orbits.earth_rate * time_of_week + pi, tau) - pi


def _eccentric_anomaly(mean_anomaly: Floats, eccentricity: Floats) -> Floats:
    """Newton's method; four steps from this start reach rounding for eccentricities below 0.03."""
    anomaly = mean_anomaly + eccentricity * np.sin(mean_anomaly)
    for _ in range(4):
        anomaly -= (anomaly - eccentricity * np.sin(anomaly) - mean_anomaly) / (1 - eccentricity * np.cos(anomaly))
    return anomaly


def satellite_states(orbits: Orbits, t_s: Floats) -> SatelliteStates:
    """States of the satellites (k,), each at its time t_s (k,) [s since the reference time]."""
    e = orbits.eccentricity
    motion = orbits.mean_motion
    anomaly = _eccentric_anomaly(orbits.mean_anomaly + motion * t_s, e)
    sine, cosine = np.sin(anomaly), np.cos(anomaly)
    anomaly_rate = motion / (1 - e * cosine)
    pos_e, vel_e = _turn_to_earth(orbits, t_s, *_place_in_plane(orbits, sine, cosine, anomaly_rate))
    relativity = -2 * np.sqrt(orbits.gm) * e * orbits.sqrt_a / SPEED_OF_LIGHT**2
    clock = orbits.af0 + orbits.af1 * t_s + relativity * sine
    return SatelliteStates(pos_e, vel_e, clock, orbits.af1 + relativity * cosine * anomaly_rate)


def _place_in_plane(orbits: Orbits, sine: Floats, cosine: Floats, anomaly_rate: Floats) -> tuple[Floats, ...]:
    """Position and velocity from the node in the orbital plane, inclination less its linear part, and its rate."""
    e = orbits.eccentricity
    latitude = np.arctan2(np.sqrt(1 - e**2) * sine, cosine - e) + orbits.perigee
    latitude_rate = np.sqrt(1 - e**2) * anomaly_rate / (1 - e * cosine)
    s2, c2 = np.sin(2 * latitude), np.cos(2 * latitude)
    argument = latitude + orbits.cus * s2 + orbits.cuc * c2
    argument_rate = latitude_rate * (1 + 2 * (orbits.cus * c2 - orbits.cuc * s2))
    radius = orbits.sqrt_a**2 * (1 - e * cosine) + orbits.crs * s2 + orbits.crc * c2
    radius_rate = orbits.sqrt_a**2 * e * sine * anomaly_rate + 2 * latitude_rate * (orbits.crs * c2 - orbits.crc * s2)
    inclination = orbits.inclination + orbits.cis * s2 + orbits.cic * c2
    inclination_rate = orbits.inclination_rate + 2 * latitude_rate * (orbits.cis * c2 - orbits.cic * s2)
    su, cu = np.sin(argument), np.cos(argument)
    x, y = radius * cu, radius * su
    return x, y, radius_rate * cu - y * argument_rate, radius_rate * su + x * argument_rate, inclination, inclination_rate


def _turn_to_earth(
    orbits: Orbits, t_s: Floats, x: Floats, y: Floats, x_rate: Floats, y_rate: Floats, inclination: Floats, tilt_rate: Floats
) -> tuple[Floats, Floats]:
    tilt = inclination + orbits.inclination_rate * t_s
    turn_rate = orbits.node_rate - orbits.earth_rate
    node = orbits.node_longitude + turn_rate * t_s
    si, ci, so, co = np.sin(tilt), np.cos(tilt), np.sin(node), np.cos(node)
    pos_e = np.stack([x * co - y * ci * so, x * so + y * ci * co, y * si], axis=-1)
    across_rate = y_rate * ci - y * si * tilt_rate
    vel_x = x_rate * co - across_rate * so - turn_rate * pos_e[:, 1]
    vel_y = x_rate * so + across_rate * co + turn_rate * pos_e[:, 0]
    return pos_e, np.stack([vel_x, vel_y, y_rate * si + y * ci * tilt_rate], axis=-1)
