"""Receiver clock and multipath: what the pseudoranges of a receiver contain beside motion and white noise.

Clock: an offset per constellation and one drift, in metres and metres per second. Brown and Hwang, Introduction to Random
Signals and Applied Kalman Filtering, 4th ed. (2012), 9.3: white noise and random walk of frequency. The offsets share the
clock and differ by slow inter-system biases, a random walk each.
Multipath: a stationary first-order Gauss-Markov process of variance one for each satellite, in units of the standard deviation
that it has in the pseudorange (shaping states; ibid., 3.6 and 5.5).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from navreplay.options import RangeOptions
from navreplay.timeline import Floats

__all__ = ["ReceiverClock"]


@dataclass(frozen=True, slots=True)
class ReceiverClock:
    """groups: names of the offsets, g of them; behind them the drift. sats: satellites with a multipath state behind it, s of
    them. c = g + 1 + s."""

    groups: tuple[str, ...]
    options: RangeOptions
    sats: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of states c."""
        return len(self.groups) + 1 + len(self.sats)

    @property
    def names(self) -> tuple[str, ...]:
        """(c,) names of the states."""
        offsets = (f"clock_offset_{group}" for group in self.groups)
        return (*offsets, "clock_drift", *(f"multipath_{sat}" for sat in self.sats))

    @property
    def units(self) -> tuple[str, ...]:
        """(c,) units of the states."""
        return (*("m" for _ in self.groups), "m/s", *("1" for _ in self.sats))

    def transitions(self, dt: Floats) -> Floats:
        """(k, c, c) over dt (k,) [s]."""
        still, moving, *_ = _terms(self)
        phi = still + dt[:, None, None] * moving
        first = len(self.groups) + 1
        phi[:, range(first, self.size), range(first, self.size)] = np.exp(-dt / self.options.multipath_time)[:, None]
        return np.asarray(phi)

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        _, _, linear, square, cube = _terms(self)
        t = dt[:, None, None]
        added = t * (linear + t * (square + t * cube))
        first = len(self.groups) + 1
        added[:, range(first, self.size), range(first, self.size)] = -np.expm1(-2 * dt / self.options.multipath_time)[:, None]
        return np.asarray(added)


@cache
def _terms(clock: ReceiverClock) -> tuple[Floats, ...]:
    """Coefficients (c, c) of the transition in 1, dt and of the noise in dt, dt^2, dt^3."""
    options, c, g = clock.options, clock.size, len(clock.groups)
    moving, linear, square, cube = np.zeros((4, c, c))
    moving[:g, g] = 1.0
    linear[:g, :g] = options.clock_noise**2 + options.system_offset_walk**2 * np.eye(g)
    linear[g, g] = options.clock_drift_walk**2
    square[:g, g] = square[g, :g] = options.clock_drift_walk**2 / 2
    cube[:g, :g] = options.clock_drift_walk**2 / 3
    return np.eye(c), moving, linear, square, cube
