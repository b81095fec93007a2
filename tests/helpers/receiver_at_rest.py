"""A receiver at rest under a made-up sky, for tests of range import."""

import numpy as np

from navreplay.geodesy.earth import EARTH_RATE, ecef_from_lla
from navreplay.timeline import Floats

SPEED_OF_LIGHT = 299_792_458.0
RECEIVER_LLA = np.array([0.62, 2.43, 50.0])
START_NS = 1_300_000_000 * 10**9
SATS = ("G01", "G02", "G03", "G04", "E05", "E06", "E07", "C08")


def satellites(k: int) -> Floats:
    """Positions (8, 3) [m] at transmission, in axes of that time, of epoch k: spread over the sky, moving at 3 km/s."""
    receiver = ecef_from_lla(RECEIVER_LLA)
    up = receiver / np.linalg.norm(receiver)
    east = np.array([-up[1], up[0], 0.0]) / np.hypot(up[0], up[1])
    north = np.cross(up, east)
    azimuth = np.arange(8) * 2.3
    elevation = np.radians([20, 35, 70, 15, 50, 25, 60, 40])
    line = np.cos(elevation)[:, None] * (np.cos(azimuth)[:, None] * north + np.sin(azimuth)[:, None] * east)
    line = line + np.sin(elevation)[:, None] * up
    return np.asarray(receiver + line * 2.3e7 + 3e3 * k * east)


def turned(pos: Floats, angle: Floats) -> Floats:
    """pos (n, 3) in axes turned eastward by angle (n,)."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([cos * pos[:, 0] + sin * pos[:, 1], cos * pos[:, 1] - sin * pos[:, 0], pos[:, 2]])


def received(k: int, clock_m: float) -> tuple[Floats, Floats]:
    """Pseudoranges (8,) and satellites in axes of reception (8, 3) of epoch k."""
    receiver = ecef_from_lla(RECEIVER_LLA)
    flight = np.full(8, 0.077)
    for _ in range(4):
        pos = turned(satellites(k), EARTH_RATE * flight)
        flight = np.linalg.norm(pos - receiver, axis=1) / SPEED_OF_LIGHT
    return flight * SPEED_OF_LIGHT + clock_m, pos
