"""Positions and clocks from GLONASS broadcast state vectors, by Runge-Kutta integration.

Source: GLONASS ICD L1, L2 edition 5.1, appendix 3 and 3.3.3. Steps of 60 s from the reference time, then one step of the rest:
the steps are made once per record, so that a row costs one step.
"""

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats, Times

__all__ = ["glonass_clock", "glonass_states"]

_GM = 3.9860044e14
_J2 = 1.0826257e-3
_RADIUS = 6378136.0
_EARTH_RATE = 7.292115e-5
_STEP_S = 60.0
_NODES = 32


def glonass_clock(records: NDArray[np.void], index: NDArray[np.intp], t_ns: Times, before_s: Floats) -> Floats:
    """Clock offsets (n,) [s] at satellite clock time before_s (n,) before t_ns (n,), from the records of index (n,)."""
    tau, gamma = records["tau"][index], records["gamma"][index]
    sent = (t_ns - records["toe_ns"][index]) * 1e-9 - before_s
    elapsed = sent
    for _ in range(2):
        elapsed = sent + tau - gamma * elapsed
    return gamma * elapsed - tau


def glonass_states(
    records: NDArray[np.void], index: NDArray[np.intp], t_ns: Times, before_s: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Positions (n, 3), velocities (n, 3), clock offsets (n,) [s] and drifts (n,), from the records of index (n,), before_s
    (n,) before the GPS times t_ns (n,); within 32 minutes of the reference times."""
    used, place = np.unique(index, return_inverse=True)
    acc = records["acc"][used]
    elapsed = (t_ns - records["toe_ns"][index]) * 1e-9 - before_s
    node = np.clip(np.trunc(elapsed / _STEP_S).astype(np.int64), 1 - _NODES, _NODES - 1)
    nodes = _nodes(np.concatenate([records["pos"][used], records["vel"][used]], axis=1), acc)
    state = _advance(nodes[place, node + _NODES - 1], acc[place], elapsed - node * _STEP_S)
    clock = -records["tau"][index] + records["gamma"][index] * elapsed
    return state[:, :3], state[:, 3:], clock, records["gamma"][index].copy()


def _nodes(state: Floats, acc: Floats) -> Floats:
    """States (m, 2 * nodes - 1, 6) at whole steps around the reference time."""
    nodes = np.empty((len(state), 2 * _NODES - 1, 6))
    middle = _NODES - 1
    nodes[:, middle] = state
    for sign in (1, -1):
        for k in range(1, _NODES):
            step = np.full(len(state), sign * _STEP_S)
            nodes[:, middle + sign * k] = _advance(nodes[:, middle + sign * (k - 1)], acc, step)
    return nodes


def _advance(state: Floats, acc: Floats, step: Floats) -> Floats:
    """One Runge-Kutta step of the fourth order: states (n, 6), accelerations (n, 3), steps (n,) [s]."""
    h = step[:, None]
    k1 = _derivative(state, acc)
    k2 = _derivative(state + k1 * (h / 2), acc)
    k3 = _derivative(state + k2 * (h / 2), acc)
    k4 = _derivative(state + k3 * h, acc)
    return np.asarray(state + (k1 + 2 * k2 + 2 * k3 + k4) * (h / 6))


def _derivative(state: Floats, acc: Floats) -> Floats:
    x, y, z, vx, vy, vz = state.T
    r2 = x * x + y * y + z * z
    flat = 1.5 * _J2 * _GM * _RADIUS**2 / (r2 * r2 * np.sqrt(r2))
    pull = -_GM / (r2 * np.sqrt(r2)) - flat * (1 - 5 * z * z / r2)
    turn = pull + _EARTH_RATE**2
    return np.column_stack(
        [
            vx,
            vy,
            vz,
            turn * x + 2 * _EARTH_RATE * vy + acc[:, 0],
            turn * y - 2 * _EARTH_RATE * vx + acc[:, 1],
            (pull - 2 * flat) * z + acc[:, 2],
        ]
    )
