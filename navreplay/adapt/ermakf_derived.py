"""Redundant-measurement filter for noise that is correlated in time: what ERMAKF means to be, derived.

Source: own derivation from the differences of Ge et al., Sensors 20 (2020) 6041, (12)-(14). Differences over one epoch add up
to those over L epochs, in which the INS is still never differenced across a correction. Of first-order Gauss-Markov noise of
variance s^2 and time constant T, half their variance is v_L = s^2 (1 - rho^L), rho = exp(-1 / T); of white noise it is s^2
at every L. So v_1 .. v_Lmax of a window show variance and correlation. The time constant is that of the surroundings and not
of one satellite, so it is fitted to the mean of v_L over all components of a kind (all pseudoranges, all range rates): for
each T of a grid the best s^2 is linear least squares with weights 1 / L (short lags have more independent samples), and the T
of the least residual is taken. Given T, each component's s^2 is linear least squares in its own v_L.
Assumes: an INS that drifts little against the noise over longest_lag epochs, and noise of one time constant in all components
of a kind.
Fails: on time constants beyond the longest lag, of which s^2 / T is all that shows; on constant biases; with an IMU so poor
that its drift passes for correlated noise; and until noise that has changed fills the window. Of noise that lasts 20 epochs a
window of 60 holds three independent values: single estimates scatter, skewed, so that their median is 0.74 of s^2 while
their mean is 0.98 (T fitted to each component by itself: 0.62 and 1.33), and over the first 80 epochs of it 0.48 and 0.65.
R says how large the errors are, not that they stay: a filter that takes correlated noise for white still believes their mean.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from navreplay.adapt.adapter import Adaptation
from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.trails import Trails, extend_trails, stack_trails
from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["ErmakfDerived", "fit_correlation", "fit_levels", "lag_variances", "share_time_constants"]

_TIME_CONSTANTS = np.array([0.1, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0])
"""Grid of T [epochs]; the first is white noise."""


def lag_variances(differences: Floats, count: Floats, lags: int) -> Floats:
    """(k, lags) half the mean square of the differences over L = 1 .. lags epochs, NaN where a row has too few.

    differences (k, n) over one epoch each, of which the last count (k,) are known and the others zero; lags at most n.
    """
    k, n = differences.shape
    path = np.concatenate([np.zeros((k, 1)), np.cumsum(differences, axis=1)], axis=1)
    start, end, firsts = _pairs(n + 1, lags)
    squares = (path[:, end] - path[:, start]) ** 2
    squares *= start >= n - count[:, None]
    known = count[:, None] + 1 - np.arange(1, lags + 1)
    return np.where(known > 0, np.add.reduceat(squares, firsts, axis=1) / (2 * np.maximum(known, 1)), np.nan)


@lru_cache(maxsize=8)
def _pairs(length: int, lags: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Indices of both ends of all pairs 1 .. lags apart in a sequence, lag by lag, and where each lag begins."""
    starts = [np.arange(length - lag) for lag in range(1, lags + 1)]
    ends = [start + lag for lag, start in enumerate(starts, 1)]
    firsts = np.cumsum([0, *(len(start) for start in starts[:-1])])
    return np.concatenate(starts), np.concatenate(ends), firsts


def fit_correlation(variances: Floats, longest: Floats) -> tuple[Floats, Floats]:
    """Variance s^2 (k,) and time constant T (k,) [epochs] that fit s^2 (1 - exp(-L / T)) to variances (k, lags) of lags up to
    longest (k,)."""
    lag = np.arange(1, variances.shape[1] + 1)
    shape = 1 - np.exp(-lag / _TIME_CONSTANTS[:, None])
    weight = np.where(lag <= longest[:, None], 1 / lag, 0.0)
    seen = np.where(weight > 0, variances, 0.0)
    size = (weight * seen) @ shape.T / (weight @ (shape**2).T)
    misfit = (weight[:, None, :] * (seen[:, None, :] - size[:, :, None] * shape) ** 2).sum(axis=2)
    best = misfit.argmin(axis=1)
    return size[np.arange(len(size)), best], _TIME_CONSTANTS[best]


def share_time_constants(variances: Floats, longest: Floats, kinds: tuple[str, ...]) -> Floats:
    """T (k,) [epochs] that fits the mean over all components of the same kind (k,) of variances (k, lags), of lags up to
    longest (k,)."""
    seen = np.arange(1, variances.shape[1] + 1) <= longest[:, None]
    shared = np.empty(len(kinds))
    for kind in dict.fromkeys(kinds):
        rows = np.flatnonzero([other == kind for other in kinds])
        mean = np.where(seen[rows], variances[rows], 0.0).sum(axis=0) / np.maximum(seen[rows].sum(axis=0), 1)
        shared[rows] = fit_correlation(mean[None], longest[rows].max(keepdims=True))[1]
    return shared


def fit_levels(variances: Floats, longest: Floats, time_constants: Floats) -> Floats:
    """Variance s^2 (k,) that fits s^2 (1 - exp(-L / T)) to variances (k, lags) of lags up to longest (k,), given T (k,)
    [epochs]."""
    lag = np.arange(1, variances.shape[1] + 1)
    shape = 1 - np.exp(-lag / time_constants[:, None])
    weight = np.where(lag <= longest[:, None], 1 / lag, 0.0)
    return np.asarray((weight * np.where(weight > 0, variances, 0.0) * shape).sum(axis=1) / (weight * shape**2).sum(axis=1))


@dataclass(frozen=True, slots=True)
class ErmakfDerived:
    """window [epochs]: at most. least [epochs]: until a component has so many differences the told R holds for it.
    longest_lag [epochs]: Lmax, and never more than a third of what the window holds. longest_step [s]: no difference over
    one epoch reaches further. floor: least ratio of used to told variance."""

    window: int = 60
    least: int = 10
    longest_lag: int = 20
    longest_step: float = 1.5
    floor: float = 0.01

    def init(self) -> Trails:
        """Nothing seen yet."""
        return {}

    def adapt(self, state: Trails, prior: Gaussian, innovation: Innovation) -> Adaptation[Trails]:
        """R scaled by the variance fitted to each component's differences."""
        trails = extend_trails(state, innovation, self.window, self.longest_step)
        differences, count = stack_trails(list(trails.values()), self.window)
        ratio = np.ones(len(count))
        enough = count >= self.least
        if enough.any():
            differences, count = differences[enough], count[enough]
            longest = np.maximum(np.minimum(self.longest_lag, count // 3), 1)
            variances = lag_variances(differences, count, self.longest_lag)
            kinds = tuple(label.partition(" ")[0] for label, known in zip(trails, enough.tolist(), strict=True) if known)
            shared = share_time_constants(variances, longest, kinds)
            ratio[enough] = np.maximum(self._weigh(fit_levels(variances, longest, shared), shared), self.floor)
        return Adaptation(prior, scale_noise(innovation.noise, ratio), {**state, **trails})

    def _weigh(self, variance: Floats, time_constant: Floats) -> Floats:
        """R over told (k,) for noise of that variance (k,) and time constant (k,) [epochs]."""
        return variance
