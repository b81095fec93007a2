"""The level of each component's noise against what the others of its epoch say: what does not leave with differencing.

A bias that stays is in no difference, but satellites that are biased each in its own way contradict each other, and the
prediction. With nu and S of an innovation in units of the noise, e = (I + a S)^-1 nu has the covariance M (I + S) M with
M = (I + a S)^-1. With a = 1 it is what the filter expects of its innovations; with a without bounds, the parity vector of
integrity monitoring (Sturza, Navigation 35 (1988) 483), in which no error of the state is left. A filter that takes
correlated noise for white believes itself too much, by several of its sigmas: a is the square of how many are allowed for.
"""

from functools import lru_cache

import numpy as np

from navreplay.adapt.redundant.trails import CLOCKED
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation, solve

__all__ = ["level_squares"]

_DOUBT = 100.0
"""a: the state may be off by ten of the filter's sigmas."""
_LEAST = 1e-12
_CLOCK = 1e6
"""Variance [m^2, m^2/s^2] added for a receiver clock of which nothing is known."""


def level_squares(innovation: Innovation, variance: Floats) -> tuple[Floats, Floats]:
    """Squares (m,) of e under noise of variance (m,), and their expectations (m,): the share of redundancy, from 0 where
    nothing is left to compare with to 1. Both are zero of what no receiver clock is in."""
    std, clock = np.sqrt(variance), _same_clock(innovation.labels)
    spread = (_DOUBT * innovation.spread + _CLOCK * clock) / np.outer(std, std)
    unit = np.eye(len(std))
    left = solve(unit + spread, unit)
    weight, judged = clock / variance, np.diagonal(clock)
    common = weight @ innovation.residual / np.maximum(weight.sum(axis=1), _LEAST)
    off = left @ ((innovation.residual - common) / std)
    return judged * off**2, judged * (np.diagonal(left) / _DOUBT + (1 - 1 / _DOUBT) * (left**2).sum(axis=1))


@lru_cache(maxsize=64)
def _same_clock(labels: tuple[str, ...]) -> Floats:
    """(m, m) one where two labels share what the receiver clock adds to them."""
    kinds = [next((i for i, kind in enumerate(CLOCKED) if label.startswith(kind)), -1) for label in labels]
    kind = np.array(kinds)
    return np.asarray((kind[:, None] == kind) & (kind >= 0), dtype=np.float64)
