"""Receiver clock: an offset per constellation and one drift, in metres and metres per second.

Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th ed. (2012), 9.3: white noise and random walk
of frequency. The offsets share the clock and differ by slow inter-system biases, a random walk each.
"""

from dataclasses import dataclass

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
        phi = np.tile(np.eye(self.size), (len(dt), 1, 1))
        phi[:, :-1, -1] = dt[:, None]
        return phi

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        white, walk = self.options.clock_noise**2, self.options.clock_drift_walk**2
        q = np.empty((len(dt), self.size, self.size))
        q[:, :-1, :-1] = (white * dt + walk * dt**3 / 3)[:, None, None]
        q[:, :-1, :-1] += self.options.system_offset_walk**2 * dt[:, None, None] * np.eye(len(self.groups))
        q[:, :-1, -1] = q[:, -1, :-1] = (walk * dt**2 / 2)[:, None]
        q[:, -1, -1] = walk * dt
        return q
