"""Faults of velocities beside good positions: signs, axes, units, frames, latency, and fields that were never filled."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.timeline import Floats
from synthetic_logs.faults.fault import Fault, Spoilt
from synthetic_logs.simulation import SyntheticLog, truth_at

__all__ = ["FAULTS"]


def _changed(change: Callable[[SyntheticLog, Floats], Floats]) -> Callable[[SyntheticLog], Spoilt]:
    """Velocities as change makes them of (n, 3) NED [m/s]."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        assert log.fixes is not None
        return Spoilt(replace(log, fixes=replace(log.fixes, vel_n=change(log, log.fixes.vel_n))))

    return spoil


def _times(*factors: float) -> Callable[[SyntheticLog, Floats], Floats]:
    return lambda log, vel_n: vel_n * np.array(factors)


def _late(delay: float) -> Callable[[SyntheticLog, Floats], Floats]:
    """The velocity of delay [s] ago, as a receiver's smoothing gives it."""

    def change(log: SyntheticLog, vel_n: Floats) -> Floats:
        """Velocities (n, 3) NED [m/s] of delay ago."""
        assert log.fixes is not None
        journey, t_ns = log.scenario.journey, log.fixes.t_ns
        then = t_ns - round(delay * 1e9)
        known = then >= journey.start_ns
        late = vel_n.copy()
        late[known] += truth_at(journey, then[known]).vel_n - truth_at(journey, t_ns[known]).vel_n
        return late

    return change


def _in_body(log: SyntheticLog, vel_n: Floats) -> Floats:
    """Forward, right, down in place of north, east, down."""
    assert log.fixes is not None
    q_nb = truth_at(log.scenario.journey, log.fixes.t_ns).q_nb
    return np.einsum("kji,kj->ki", matrix_from_quat(q_nb), vel_n)


def _frozen(log: SyntheticLog, vel_n: Floats) -> Floats:
    """The velocity of the middle of the log from there on."""
    half = len(vel_n) // 2
    return np.concatenate([vel_n[:half], np.broadcast_to(vel_n[half], vel_n[half:].shape)])


FAULTS: tuple[Fault, ...] = tuple(
    Fault(name, "velocity", description, _changed(change))
    for name, description, change in (
        ("velocity-zero", "never filled: zero in every row", _times(0.0, 0.0, 0.0)),
        ("velocity-no-vertical", "vertical part never filled", _times(1.0, 1.0, 0.0)),
        ("velocity-vertical-sign", "vertical part of the other sign", _times(1.0, 1.0, -1.0)),
        ("velocity-reversed", "all of the other sign", _times(-1.0, -1.0, -1.0)),
        ("velocity-east-sign", "east part of the other sign", _times(1.0, -1.0, 1.0)),
        ("velocity-15-percent", "15 % too large", _times(1.15, 1.15, 1.15)),
        ("velocity-knots", "knots for metres per second", _times(1.9438, 1.9438, 1.9438)),
        ("velocity-kmh", "kilometres per hour for metres per second", _times(3.6, 3.6, 3.6)),
        ("velocity-cm", "centimetres per second for metres per second", _times(100.0, 100.0, 100.0)),
        ("velocity-east-north", "east and north exchanged", lambda log, vel_n: vel_n[:, [1, 0, 2]]),
        ("velocity-in-body", "forward, right, down", _in_body),
        ("velocity-frozen", "stays from the middle on", _frozen),
        ("velocity-late-0.13s", "0.13 s late", _late(0.13)),
        ("velocity-late-0.5s", "0.5 s late", _late(0.5)),
        ("velocity-late-1s", "1 s late", _late(1.0)),
    )
)
"""Faults of velocities."""
