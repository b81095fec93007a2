"""WGS-84: ellipsoid, normal gravity, rates of the navigation frame, geodetic / Earth-fixed / local coordinates.

Constants: NGA.STND.0036 (WGS 84, version 1.0.0, 2014). Normal gravity: Hofmann-Wellenhof and Moritz, Physical Geodesy (2005),
2.9; from the depths of mines to space. Latitude and longitude [rad], height above the ellipsoid [m], Earth-fixed coordinates
[m]; everything broadcasts over leading dimensions, and single points, of which every measurement epoch has some, go by plain
floats.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from navreplay.timeline import Floats

__all__ = [
    "EARTH_RATE",
    "ECCENTRICITY_SQUARED",
    "FLATTENING",
    "GM",
    "SEMI_MAJOR_AXIS",
    "attract",
    "earth_rate_n",
    "ecef_from_lla",
    "frame_turn_n",
    "gravitation",
    "gravity",
    "gravity_n",
    "lla_from_ecef",
    "matrix_en",
    "move_lla",
    "ned_between",
    "offset_between",
    "quat_en",
    "radii",
    "transport_rate_n",
]

SEMI_MAJOR_AXIS = 6378137.0
"""Semi-major axis a [m]."""
FLATTENING = 1 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)
EARTH_RATE = 7.292115e-5
"""Rotation rate [rad/s]."""
GM = 3.986004418e14
"""Gravitational constant times the Earth's mass [m^3/s^2]."""
_J2, _J4, _J6 = 1.08262982131e-3, -2.37091120053e-6, 6.08346498882e-9
"""Zonal coefficients of the normal field; what follows is below 2e-9 m/s^2."""
_SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1 - FLATTENING)


def radii(lat: ArrayLike) -> tuple[Floats, Floats]:
    """Radii of curvature in the meridian and in the prime vertical [m] at latitude (...)."""
    sine, _ = _sine_cosine(lat)
    w2 = 1 - ECCENTRICITY_SQUARED * sine**2
    normal = SEMI_MAJOR_AXIS / w2**0.5
    return normal * (1 - ECCENTRICITY_SQUARED) / w2, normal


def _sine_cosine(angle: ArrayLike) -> tuple[Any, Any]:
    """Of an angle (...) [rad]; as floats where it is one."""
    if isinstance(angle, float):
        return math.sin(angle), math.cos(angle)
    angle = np.asarray(angle, dtype=np.float64)
    return np.sin(angle), np.cos(angle)


def attract(across: Any, along: Any, distance: Any) -> tuple[Any, Any]:
    """Normal gravitation of the Earth, without the centrifugal part, away from its axis and along it (northward) [m/s^2].

    across [m]: distance from the axis. along [m]: northward from the equatorial plane. distance [m]: from the centre.
    Gradient of the zonal harmonics to degree 6, with t = along / distance:
    d/dz r^-(n+1) P_n(t) = -(n+1) r^-(n+2) P_n+1(t), and across the axis -across r^-(n+3) P'_n+1(t).
    Plain arithmetic, for numbers as for arrays: `_strapdown_kernel` compiles it.
    """
    t = along / distance
    t2 = t * t
    ratio2 = (SEMI_MAJOR_AXIS / distance) * (SEMI_MAJOR_AXIS / distance)
    j2, j4, j6 = _J2 * ratio2, _J4 * ratio2 * ratio2, _J6 * ratio2 * ratio2 * ratio2
    outward = (
        1
        - j2 * (15 * t2 - 3) / 2
        - j4 * ((315 * t2 - 210) * t2 + 15) / 8
        - j6 * (((3003 * t2 - 3465) * t2 + 945) * t2 - 35) / 16
    )
    northward = (
        1
        - 3 * j2 * (5 * t2 - 3) / 2
        - 5 * j4 * ((63 * t2 - 70) * t2 + 15) / 8
        - 7 * j6 * (((429 * t2 - 693) * t2 + 315) * t2 - 35) / 16
    )
    central = -GM / (distance * distance * distance)
    return central * across * outward, central * along * northward


def gravitation(r: Floats) -> Floats:
    """Normal gravitation (..., 3) [m/s^2] at r (..., 3) [m] from the Earth's centre, in any axes whose z is the Earth's."""
    across = np.hypot(r[..., 0], r[..., 1])
    outward, northward = attract(across, r[..., 2], np.hypot(across, r[..., 2]))
    share = outward / across
    return np.stack([share * r[..., 0], share * r[..., 1], northward], axis=-1)


def gravity_n(lat: ArrayLike, height: ArrayLike) -> Floats:
    """Normal gravity in NED [m/s^2], (..., 3): gravitation and centrifugal force; on the ellipsoid it points straight down."""
    lat = np.asarray(lat, dtype=np.float64)
    height = np.asarray(height, dtype=np.float64)
    sine, cosine = np.sin(lat), np.cos(lat)
    _, normal = radii(lat)
    across, along = (normal + height) * cosine, (normal * (1 - ECCENTRICITY_SQUARED) + height) * sine
    outward, northward = attract(across, along, np.hypot(across, along))
    outward = outward + EARTH_RATE**2 * across
    north = northward * cosine - outward * sine
    return np.stack([north, np.zeros_like(north), -outward * cosine - northward * sine], axis=-1)


def gravity(lat: ArrayLike, height: ArrayLike) -> Floats:
    """Normal gravity, positive down [m/s^2]: the vertical part of `gravity_n`."""
    return np.asarray(gravity_n(lat, height)[..., 2])


def earth_rate_n(lat: ArrayLike) -> Floats:
    """Rotation of the Earth in NED [rad/s], (..., 3)."""
    sine, cosine = _sine_cosine(lat)
    if np.ndim(sine) == 0:
        return np.array([EARTH_RATE * cosine, 0.0, -EARTH_RATE * sine])
    return np.stack([EARTH_RATE * cosine, np.zeros_like(sine), -EARTH_RATE * sine], axis=-1)


def transport_rate_n(lla: Floats, vel_n: Floats) -> Floats:
    """Rotation of NED against the Earth [rad/s], (..., 3), of a point at lla (..., 3) that moves with vel_n (..., 3)."""
    meridian, normal = radii(lla[..., 0])
    east = vel_n[..., 1] / (normal + lla[..., 2])
    north = vel_n[..., 0] / (meridian + lla[..., 2])
    return np.stack([east, -north, -east * np.tan(lla[..., 0])], axis=-1)


def ecef_from_lla(lla: Floats) -> Floats:
    """Earth-fixed coordinates (..., 3) [m] of geodetic ones (..., 3) [rad, rad, m]."""
    lla = np.asarray(lla, dtype=np.float64)
    lat, lon, height = lla.tolist() if lla.ndim == 1 else (lla[..., 0], lla[..., 1], lla[..., 2])
    (sl, cl), (so, co) = _sine_cosine(lat), _sine_cosine(lon)
    _, normal = radii(lat)
    across = (normal + height) * cl
    up = (normal * (1 - ECCENTRICITY_SQUARED) + height) * sl
    if lla.ndim == 1:
        return np.array([across * co, across * so, up])
    return np.stack([across * co, across * so, up], axis=-1)


def lla_from_ecef(ecef: Floats) -> Floats:
    """Geodetic coordinates (..., 3) [rad, rad, m] of Earth-fixed ones (..., 3) [m].

    Bowring's formula in the reduced latitude (Survey Review 28 (1985) 202), iterated: below a nanometre from the Earth's
    surface to satellites.
    """
    ecef = np.asarray(ecef, dtype=np.float64)
    x, y, z = ecef[..., 0], ecef[..., 1], ecef[..., 2]
    across = np.hypot(x, y)
    second_squared = ECCENTRICITY_SQUARED / (1 - ECCENTRICITY_SQUARED)
    reduced = np.arctan2(z, (1 - FLATTENING) * across)
    lat = reduced
    for _ in range(4):
        lat = np.arctan2(
            z + second_squared * _SEMI_MINOR_AXIS * np.sin(reduced) ** 3,
            across - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2((1 - FLATTENING) * np.sin(lat), np.cos(lat))
    _, normal = radii(lat)
    sine, cosine = np.sin(lat), np.cos(lat)
    height = across * cosine + z * sine - SEMI_MAJOR_AXIS**2 / normal
    return np.stack([lat, np.arctan2(y, x), height], axis=-1)


def matrix_en(lat: ArrayLike, lon: ArrayLike) -> Floats:
    """C_en (..., 3, 3): projects from NED at latitude, longitude to the Earth-fixed frame."""
    (sl, cl), (so, co) = _sine_cosine(lat), _sine_cosine(lon)
    if np.ndim(sl) == np.ndim(so) == 0:
        return np.array([[-sl * co, -so, -cl * co], [-sl * so, co, -cl * so], [cl, 0.0, -sl]])
    rows = [[-sl * co, -so, -cl * co], [-sl * so, co, -cl * so], [cl, np.zeros_like(cl), -sl]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def frame_turn_n(lla: Floats) -> Floats:
    """(3, 3) the small rotation of NED [rad] that a small offset [m, NED] at lla (3,) brings about: dE / R_N, -dN / R_M,
    -dE tan(lat) / R_N."""
    meridian, normal = radii(lla[0])
    east, north = 1 / (normal + lla[2]), 1 / (meridian + lla[2])
    return np.array([[0.0, east, 0.0], [-north, 0.0, 0.0], [0.0, -east * np.tan(lla[0]), 0.0]])


def ned_between(origin_lla: Floats, lla: Floats) -> Floats:
    """Vector from origin_lla (..., 3) to lla (..., 3) in NED at the origin [m], (..., 3); exact (through Earth-fixed)."""
    origin_lla = np.asarray(origin_lla, dtype=np.float64)
    difference = ecef_from_lla(lla) - ecef_from_lla(origin_lla)
    return np.asarray(np.einsum("...ji,...j->...i", matrix_en(origin_lla[..., 0], origin_lla[..., 1]), difference))


def quat_en(lat: ArrayLike, lon: ArrayLike) -> Floats:
    """Quaternion (..., 4), scalar first, of `matrix_en`: about the axis by longitude, then about east to the local vertical."""
    half_lon = np.asarray(lon, dtype=np.float64) / 2
    half_tilt = -(np.asarray(lat, dtype=np.float64) / 2 + np.pi / 4)
    co, so, ct, st = np.cos(half_lon), np.sin(half_lon), np.cos(half_tilt), np.sin(half_tilt)
    return np.stack([co * ct, -so * st, co * st, so * ct], axis=-1)


def move_lla(lla: Floats, offset_n: Floats) -> Floats:
    """Position (..., 3) offset_n (..., 3) [m, NED] away from lla (..., 3); first order in offset over Earth radius, for offsets
    of lever arms and filter corrections (an offset of 100 m errs by 1 mm)."""
    lla = np.asarray(lla, dtype=np.float64)
    if lla.ndim == 1:
        lat, _, height = lla.tolist()
        meridian, normal = radii(lat)
        metres = np.array([1 / (meridian + height), 1 / ((normal + height) * math.cos(lat)), -1.0])
        return np.asarray(lla + metres * offset_n)
    meridian, normal = radii(lla[..., 0])
    height = lla[..., 2]
    scale = np.stack([1 / (meridian + height), 1 / ((normal + height) * np.cos(lla[..., 0])), -np.ones_like(height)], axis=-1)
    return np.asarray(lla + scale * offset_n)


def offset_between(lla: Floats, moved: Floats) -> Floats:
    """(..., 3) [m, NED] the offset by which `move_lla` takes lla (..., 3) to moved (..., 3)."""
    lla = np.asarray(lla, dtype=np.float64)
    meridian, normal = radii(lla[..., 0])
    height = lla[..., 2]
    metres = np.stack([meridian + height, (normal + height) * np.cos(lla[..., 0]), -np.ones_like(height)], axis=-1)
    change = np.asarray(moved, dtype=np.float64) - lla
    change[..., 1] = (change[..., 1] + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(change * metres)
