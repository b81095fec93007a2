"""The level of each component's noise against what the others of its epoch say: what does not leave with differencing.

A bias that stays is in no difference, but satellites that are biased each in its own way contradict each other, and the
prediction. With nu and S of an innovation in units of the noise, e = (I + a S)^-1 nu has the covariance M (I + S) M with
M = (I + a S)^-1. With a = 1 it is what the filter expects of its innovations; with a without bounds, the parity vector of
integrity monitoring (Sturza, Navigation 35 (1988) 483), in which no error of the state is left. A filter that takes
correlated noise for white believes itself too much, by several of its sigmas: a is the square of how many are allowed for.
"""

import numpy as np

from navreplay.filters.core import Innovation, solve
from navreplay.timeline import Floats

__all__ = ["level_squares"]

_DOUBT = 100.0
"""a: the state may be off by ten of the filter's sigmas."""


def level_squares(innovation: Innovation, variance: Floats) -> tuple[Floats, Floats]:
    """Squares (m,) of e under noise of variance (m,), and their expectations (m,): the share of redundancy, from 0 where
    nothing is left to compare with to 1."""
    std, unit = np.sqrt(variance), np.eye(len(variance))
    left = solve(unit + _DOUBT * (innovation.spread / np.outer(std, std)), unit)
    off = left @ (innovation.residual / std)
    return off**2, np.diagonal(left) / _DOUBT + (1 - 1 / _DOUBT) * (left**2).sum(axis=1)
