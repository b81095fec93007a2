"""Receiver clock: an offset per constellation and one drift, in metres and metres per second.

Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th ed. (2012), 9.3: white noise and random walk
of frequency. The offsets share the clock and differ by slow inter-system biases, a random walk each.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from navreplay.options import RangeOptions
from navreplay.timeline import Floats

__all__ = ["ReceiverClock"]


@dataclass(frozen=True, slots=True)
class ReceiverClock:
    """groups: names of the offsets, g of them; the drift is the last of the c = g + 1 states."""

    groups: tuple[str, ...]
    options: RangeOptions

    @property
    def size(self) -> int:
        """Number of states c."""
        return len(self.groups) + 1

    @property
    def names(self) -> tuple[str, ...]:
        """(c,) names of the states."""
        return (*(f"clock_offset_{group}" for group in self.groups), "clock_drift")

    @property
    def units(self) -> tuple[str, ...]:
        """(c,) units of the states."""
        return (*("m" for _ in self.groups), "m/s")

    def transitions(self, dt: Floats) -> Floats:
        """(k, c, c) over dt (k,) [s]."""
        still, moving, *_ = _terms(self)
        return np.asarray(still + dt[:, None, None] * moving)

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        _, _, linear, square, cube = _terms(self)
        t = dt[:, None, None]
        return np.asarray(t * (linear + t * (square + t * cube)))


@cache
def _terms(clock: ReceiverClock) -> tuple[Floats, ...]:
    """Coefficients (c, c) of the transition in 1, dt and of the noise in dt, dt^2, dt^3."""
    options, c = clock.options, clock.size
    moving, linear, square, cube = np.zeros((4, c, c))
    moving[:-1, -1] = 1.0
    linear[:-1, :-1] = options.clock_noise**2 + options.system_offset_walk**2 * np.eye(c - 1)
    linear[-1, -1] = options.clock_drift_walk**2
    square[:-1, -1] = square[-1, :-1] = options.clock_drift_walk**2 / 2
    cube[:-1, :-1] = options.clock_drift_walk**2 / 3
    return np.eye(c), moving, linear, square, cube
