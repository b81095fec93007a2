"""Precise orbits and clocks (SP3): interpolation to any time.

Positions by the polynomial through the ten nearest epochs, as usual for tables of 15 minutes (Schenewerk, GPS Solutions 6
(2003) 265), in axes that do not turn during the fit; clocks linearly. Positions are those of the centre of mass.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.satellites.flight_rotation import turn_about_pole
from navreplay.geodesy.earth import EARTH_RATE
from navreplay.timeline import Floats, Times

__all__ = ["PreciseOrbits"]

_POINTS = 10
_HALF_STEP_S = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class PreciseOrbits:
    """t_ns: (k,) GPS times of the table, increasing. sats: (s,) names. pos: (s, k, 3) [m], clock: (s, k) [s], NaN where
    unknown."""

    t_ns: Times
    sats: NDArray[np.str_]
    pos: Floats
    clock: Floats

    def states(self, sat: np.ndarray, t_ns: Times, before_s: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Positions (n, 3), velocities (n, 3), clock offsets (n,) [s] and drifts (n,), before_s (n,) before t_ns (n,), without
        relativity; NaN beyond the table and where it has gaps."""
        late, early = before_s - _HALF_STEP_S, before_s + _HALF_STEP_S
        pos, clock = self._interpolate(sat, t_ns, before_s)
        pos_late, clock_late = self._interpolate(sat, t_ns, late)
        pos_early, clock_early = self._interpolate(sat, t_ns, early)
        return pos, pos_late - pos_early, clock, clock_late - clock_early

    def clocks(self, sat: np.ndarray, t_ns: Times, before_s: Floats) -> Floats:
        """Clock offsets (n,) [s] alone."""
        return self._interpolate(sat, t_ns, before_s)[1]

    def _interpolate(self, sat: np.ndarray, t_ns: Times, before_s: Floats) -> tuple[Floats, Floats]:
        n, k = len(sat), len(self.t_ns)
        order = np.argsort(self.sats)
        place = order[np.clip(np.searchsorted(self.sats, sat, sorter=order), 0, len(order) - 1)]
        elapsed = (t_ns - self.t_ns[0]) * 1e-9 - before_s
        grid = (self.t_ns - self.t_ns[0]) * 1e-9
        after = np.clip(np.searchsorted(grid, elapsed), 1, k - 1)
        first = np.clip(after - _POINTS // 2, 0, k - _POINTS)
        index = first[:, None] + np.arange(_POINTS)
        offset = grid[index] - elapsed[:, None]
        table = self.pos[place[:, None], index].reshape(-1, 3)
        steady = turn_about_pole(table, -EARTH_RATE * offset.ravel()).reshape(n, _POINTS, 3)
        pos = np.einsum("np,npx->nx", _lagrange(offset), steady)
        span = grid[after] - grid[after - 1]
        share = (elapsed - grid[after - 1]) / span
        clock = (1 - share) * self.clock[place, after - 1] + share * self.clock[place, after]
        outside = (self.sats[place] != sat) | (elapsed < grid[0]) | (elapsed > grid[-1])
        pos[outside], clock[outside] = np.nan, np.nan
        return pos, clock


def _lagrange(offset: Floats) -> Floats:
    """Weights (n, p) of p points at offset (n, p) from where the polynomial is wanted."""
    weights = np.ones_like(offset)
    for i in range(offset.shape[1]):
        for j in range(offset.shape[1]):
            if i != j:
                weights[:, i] *= offset[:, j] / (offset[:, j] - offset[:, i])
    return weights
