"""Positions and clocks from the Keplerian broadcast elements of GPS, Galileo, BeiDou and QZSS.

Sources: IS-GPS-200N, 20.3.3.3 and 20.3.3.4; Galileo OS SIS ICD 2.1, 5.1; BDS-SIS-ICD-B1I-3.0, 5.2 (with the turned frame of
geostationary satellites). Velocities are the time derivatives of the position formulas.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from importers.rows.signals import SPEED_OF_LIGHT
from importers.satellites.flight_rotation import turn_about_pole
from navreplay.timeline import Floats, Times

__all__ = ["kepler_clock", "kepler_states"]

_GM = {"G": 3.9860050e14, "J": 3.9860050e14, "E": 3.986004418e14, "C": 3.986004418e14}
_EARTH_RATE = {"G": 7.2921151467e-5, "J": 7.2921151467e-5, "E": 7.2921151467e-5, "C": 7.292115e-5}
_GEO_TILT = np.radians(-5.0)
_GEO_NUMBERS = (1, 2, 3, 4, 5, 59, 60, 61, 62, 63)
_MAX_ITERATIONS = 12


def kepler_clock(records: NDArray[np.void], index: NDArray[np.intp], t_ns: Times, before_s: Floats) -> Floats:
    """Clock offsets (n,) [s], without relativity, at satellite clock time before_s (n,) before t_ns (n,), from the records of
    index (n,)."""
    polynomial = [records[name][index] for name in ("af0", "af1", "af2")]
    sent = (t_ns - records["toc_ns"][index]) * 1e-9 - before_s
    elapsed = sent
    for _ in range(2):
        elapsed = sent - _polynomial(polynomial, elapsed)
    return _polynomial(polynomial, elapsed)


def kepler_states(
    records: NDArray[np.void], index: NDArray[np.intp], t_ns: Times, before_s: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Positions (n, 3), velocities (n, 3) in Earth-fixed axes of that time, clock offsets (n,) [s] and drifts (n,) with
    relativity, from the records of index (n,), before_s (n,) before the GPS times t_ns (n,)."""
    system = records["sat"].astype("U1")
    gm, rate = (np.select([system == name for name in values], list(values.values()), np.nan) for values in (_GM, _EARTH_RATE))
    geo = np.isin(records["sat"], [f"C{number:02d}" for number in _GEO_NUMBERS])
    motion = (np.sqrt(gm / records["sqrt_a"] ** 6) + records["delta_n"])[index]
    tk = (t_ns - records["toe_ns"][index]) * 1e-9 - before_s
    e = records["e"][index]
    anomaly = _eccentric_anomaly(records["m0"][index] + motion * tk, e)
    sin_e, cos_e = np.sin(anomaly), np.cos(anomaly)
    anomaly_rate = motion / (1 - e * cos_e)
    plane, plane_rate, inclination, inclination_rate = _in_plane(records, index, tk, sin_e, cos_e, anomaly_rate)
    node_rate = (records["omega_dot"] - np.where(geo, 0.0, rate))[index]
    node = (records["omega0"] - rate * records["toe_sow"])[index] + node_rate * tk
    pos, vel = _to_earth(plane, plane_rate, inclination, inclination_rate, node, node_rate)
    turned = np.flatnonzero(geo[index])
    pos[turned], vel[turned] = _turn_geostationary(pos[turned], vel[turned], rate[index[turned]], tk[turned])
    scale = (-2 * np.sqrt(gm) * records["sqrt_a"] * records["e"] / SPEED_OF_LIGHT**2)[index]
    elapsed = (t_ns - records["toc_ns"][index]) * 1e-9 - before_s
    polynomial = [records[name][index] for name in ("af0", "af1", "af2")]
    clock = _polynomial(polynomial, elapsed) + scale * sin_e
    return pos, vel, clock, polynomial[1] + 2 * polynomial[2] * elapsed + scale * cos_e * anomaly_rate


def _polynomial(coefficients: Sequence[Floats], elapsed: Floats) -> Floats:
    return coefficients[0] + elapsed * (coefficients[1] + elapsed * coefficients[2])


def _eccentric_anomaly(mean: Floats, e: Floats) -> Floats:
    """Kepler's equation by Newton's method, to rounding."""
    anomaly = mean + e * np.sin(mean)
    for _ in range(_MAX_ITERATIONS):
        step = (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        anomaly = anomaly - step
        if not (np.abs(step) > 1e-13).any():
            break
    return anomaly


def _in_plane(
    records: NDArray[np.void], index: NDArray[np.intp], tk: Floats, sin_e: Floats, cos_e: Floats, anomaly_rate: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Position and velocity (2, n) in the plane of the orbit, inclination and its rate (n,), with harmonic corrections."""
    cus, cuc, crs, crc, cis, cic = (records[name][index] for name in ("cus", "cuc", "crs", "crc", "cis", "cic"))
    e, a, idot = records["e"][index], (records["sqrt_a"] ** 2)[index], records["idot"][index]
    root = np.sqrt(1 - e**2)
    latitude = np.arctan2(root * sin_e, cos_e - e) + records["omega"][index]
    latitude_rate = root * anomaly_rate / (1 - e * cos_e)
    sin2, cos2 = np.sin(2 * latitude), np.cos(2 * latitude)
    u = latitude + cus * sin2 + cuc * cos2
    r = a * (1 - e * cos_e) + crs * sin2 + crc * cos2
    inclination = records["i0"][index] + idot * tk + cis * sin2 + cic * cos2
    twice = 2 * latitude_rate
    u_rate = latitude_rate + twice * (cus * cos2 - cuc * sin2)
    r_rate = a * e * sin_e * anomaly_rate + twice * (crs * cos2 - crc * sin2)
    inclination_rate = idot + twice * (cis * cos2 - cic * sin2)
    sin_u, cos_u = np.sin(u), np.cos(u)
    plane = np.stack([r * cos_u, r * sin_u])
    plane_rate = np.stack([r_rate * cos_u - r * u_rate * sin_u, r_rate * sin_u + r * u_rate * cos_u])
    return plane, plane_rate, inclination, inclination_rate


def _to_earth(
    plane: Floats, plane_rate: Floats, inclination: Floats, inclination_rate: Floats, node: Floats, node_rate: Floats
) -> tuple[Floats, Floats]:
    """Position and velocity (n, 3) of what moves in a plane of this inclination and node."""
    (x, y), (x_rate, y_rate) = plane, plane_rate
    sin_i, cos_i, sin_node, cos_node = np.sin(inclination), np.cos(inclination), np.sin(node), np.cos(node)
    pos = np.column_stack([x * cos_node - y * cos_i * sin_node, x * sin_node + y * cos_i * cos_node, y * sin_i])
    across_rate = y_rate * cos_i - y * sin_i * inclination_rate
    vel = np.column_stack(
        [
            x_rate * cos_node - across_rate * sin_node - node_rate * pos[:, 1],
            x_rate * sin_node + across_rate * cos_node + node_rate * pos[:, 0],
            y_rate * sin_i + y * cos_i * inclination_rate,
        ]
    )
    return pos, vel


def _turn_geostationary(pos: Floats, vel: Floats, rate: Floats, tk: Floats) -> tuple[Floats, Floats]:
    """From the inertial frame tilted by 5 degrees, in which geostationary BeiDou elements hold, to Earth-fixed."""
    cos, sin = np.cos(_GEO_TILT), np.sin(_GEO_TILT)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]])
    turned = turn_about_pole(pos @ tilt.T, rate * tk)
    moved = turn_about_pole(vel @ tilt.T, rate * tk)
    moved[:, 0] += rate * turned[:, 1]
    moved[:, 1] -= rate * turned[:, 0]
    return turned, moved
