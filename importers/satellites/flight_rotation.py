"""Turning satellites from Earth-fixed axes of transmission to those of reception (the Sagnac effect).

The turn is the Earth's rotation during the flight, and the flight lasts from the satellite to the receiver: pseudorange / c
contains the receiver's clock besides, which would turn the whole sky by 0.4 m on the ground per millisecond. So a rough
fix per second tells where the receiver is.
"""

import numpy as np

from importers.rows.signals import SPEED_OF_LIGHT
from navreplay.geodesy.earth import EARTH_RATE
from navreplay.timeline import Floats, Times

__all__ = ["rough_positions", "turn_about_pole", "turn_to_reception"]

_THINNING_NS = 10**9
_ITERATIONS = 8
_DAMPING = 1e-9
_LARGEST_RESIDUAL_M = 1e3
_LEAST_RADIUS_M, _LARGEST_RADIUS_M = 6.2e6, 1e7


def turn_about_pole(vectors: Floats, angle: Floats) -> Floats:
    """Components (n, 3), in axes turned eastward by angle (n,) [rad], of vectors (n, 3)."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.column_stack([cos * x + sin * y, cos * y - sin * x, vectors[:, 2]])


def turn_to_reception(
    t_ns: Times, sat: np.ndarray, pseudorange: Floats, sat_pos_e: Floats, sat_vel_e: Floats, turned_s: Floats
) -> tuple[Floats, Floats, int, int]:
    """Positions (n, 3) and velocities (n, 3) in axes of reception; the number of epochs by which the receiver's place was
    sought, and that of those in which the ranges meet in one.

    Rows in the order of time; pseudorange: (n,) [m] with the satellite clock added; turned_s: (n,) flight times by which the
    states are turned already. Without a place (never enough satellites) the receiver's clock is taken as right.
    """
    times, places, tried = rough_positions(t_ns, sat, pseudorange, sat_pos_e)
    if len(times):
        receiver = np.column_stack([np.interp(t_ns, times, axis) for axis in places.T])
        flight_s = np.linalg.norm(sat_pos_e - receiver, axis=1) / SPEED_OF_LIGHT
    else:
        flight_s = pseudorange / SPEED_OF_LIGHT
    angle = EARTH_RATE * (flight_s - turned_s)
    return turn_about_pole(sat_pos_e, angle), turn_about_pole(sat_vel_e, angle), tried, len(times)


def rough_positions(t_ns: Times, sat: np.ndarray, pseudorange: Floats, sat_pos_e: Floats) -> tuple[Times, Floats, int]:
    """Times (k,) and Earth-fixed positions (k, 3) [m] by unweighted least squares, good to about 100 m, at most one a second;
    epochs that do not fit are left out. One clock per system. And the number of epochs tried."""
    starts = np.flatnonzero(np.diff(t_ns, prepend=t_ns[0] - 1))
    counts = np.diff(np.append(starts, len(t_ns)))
    systems, system = np.unique(sat.astype("U1"), return_inverse=True)
    seen = np.zeros((len(starts), len(systems)), dtype=bool)
    seen[np.repeat(np.arange(len(starts)), counts), system] = True
    chosen = np.flatnonzero(counts >= 3 + seen.sum(axis=1))
    chosen = chosen[_thin(t_ns[starts[chosen]])]
    if len(chosen) == 0:
        return np.empty(0, dtype=np.int64), np.empty((0, 3)), 0
    place = np.arange(counts[chosen].max())
    there = place < counts[chosen][:, None]
    rows = np.where(there, starts[chosen][:, None] + place, starts[chosen][:, None])
    clock = np.eye(len(systems))[system[rows]]
    unknowns, residual = _solve(pseudorange[rows], sat_pos_e[rows], clock, there)
    rms = np.sqrt((residual**2).sum(axis=1) / there.sum(axis=1))
    radius = np.linalg.norm(unknowns[:, :3], axis=1)
    good = (rms < _LARGEST_RESIDUAL_M) & (radius > _LEAST_RADIUS_M) & (radius < _LARGEST_RADIUS_M)
    return t_ns[starts[chosen]][good], unknowns[good, :3], len(chosen)


def _thin(times: Times) -> np.ndarray:
    """Indices of the first time within each second."""
    return np.flatnonzero(np.diff(times // _THINNING_NS, prepend=-1)) if len(times) else np.empty(0, dtype=np.intp)


def _solve(pseudorange: Floats, sat_pos_e: Floats, clock: Floats, there: np.ndarray) -> tuple[Floats, Floats]:
    """Gauss-Newton from the centre of the Earth for all epochs at once: unknowns (k, 3 + systems), residuals (k, m)."""
    unknowns = np.zeros((len(pseudorange), 3 + clock.shape[2]))
    residual = np.zeros_like(pseudorange)
    for _ in range(_ITERATIONS):
        line = sat_pos_e - unknowns[:, None, :3]
        distance = np.linalg.norm(line, axis=2)
        residual = (pseudorange - distance - np.einsum("kms,ks->km", clock, unknowns[:, 3:])) * there
        design = np.concatenate([-line / distance[:, :, None], clock], axis=2) * there[:, :, None]
        normal = np.swapaxes(design, 1, 2) @ design + _DAMPING * np.eye(design.shape[2])
        right = np.swapaxes(design, 1, 2) @ residual[:, :, None]
        unknowns = unknowns + np.linalg.solve(normal, right)[:, :, 0]
    return unknowns, residual
