"""The curve of half mean squares over lags, and what it says of variance and correlation.

Noise of variance s^2 whose share g is first-order Gauss-Markov with time constant T and the rest white has
v_L = s^2 (1 - g exp(-L / T)), and the level (`redundancy`) is that of a lag without end, s^2. An INS that is left alone with
errors of its velocity or acceleration adds b L^2 to what is differenced, and nothing to the level.
"""

from typing import NamedTuple

import numpy as np

from navreplay.adapt.redundant.lag_memory import LAGS
from navreplay.timeline import Floats

__all__ = ["Correlation", "Curve", "drift_shape", "fit_curve", "fit_variances", "independent_values", "lag_shape"]


class Correlation(NamedTuple):
    """share: of the variance that is correlated. time [s]: its time constant."""

    share: float
    time: float


class Curve(NamedTuple):
    """variance: s^2. drift: b L^2 at the longest lag."""

    variance: float
    drift: float
    correlation: Correlation


def lag_shape(correlation: Correlation) -> Floats:
    """(lags + 1,) v_L and the level over s^2."""
    return np.append(1 - correlation.share * np.exp(-LAGS / correlation.time), 1.0)


def drift_shape() -> Floats:
    """(lags + 1,) b L^2 and nothing for the level, over b L^2 at the longest lag."""
    return np.append((LAGS / LAGS[-1]) ** 2, 0.0)


_GRID = (
    Correlation(0.0, 1.0),
    *(Correlation(share, time) for share in (0.3, 0.5, 0.7, 0.85, 0.95, 1.0) for time in 5.0 * 2.0 ** np.arange(-1, 7)),
)
"""White noise, and time constants [s] from that of noise which looks white to one that looks constant in all lags."""
_SHAPES = np.array([lag_shape(correlation) for correlation in _GRID])
_UNSEEN = np.array([correlation.time > LAGS[-1] for correlation in _GRID])
"""Which time constants only a level can tell from others."""
_DRIFT = drift_shape()
_LEAST = 1e-12


def fit_curve(curve: Floats, weights: Floats) -> Curve:
    """What fits curve (lags + 1,) by least squares with weights (lags + 1,): for each correlation of a grid s^2 and b, neither
    below zero, in closed form; the correlation of the least residual."""
    shape2, drift2 = _SHAPES**2 @ weights, float(_DRIFT**2 @ weights)
    both, right, right_drift = _SHAPES @ (weights * _DRIFT), _SHAPES @ (weights * curve), float(weights @ (_DRIFT * curve))
    drift = (shape2 * right_drift - both * right) / np.maximum(shape2 * drift2 - both**2, _LEAST)
    drift = np.clip(drift, 0.0, right_drift / max(drift2, _LEAST))
    variance = np.maximum(right - both * drift, 0.0) / np.maximum(shape2, _LEAST)
    misfit = ((curve - variance[:, None] * _SHAPES - drift[:, None] * _DRIFT) ** 2) @ weights
    if not weights[-1]:
        misfit[_UNSEEN] = np.inf
    best = int(misfit.argmin())
    return Curve(float(variance[best]), float(drift[best]), _GRID[best])


def fit_variances(curves: Floats, weights: Floats, fitted: Curve) -> tuple[Floats, Floats]:
    """Variances (k,) with which the correlation of a fitted curve fits the curves (k, lags + 1), less its drift, by least
    squares with weights (k, lags + 1); and the share (k,) of the weight that is there of what would be, if every lag and the
    level had the largest one."""
    shape = lag_shape(fitted.correlation)
    present = weights @ shape**2
    left = np.maximum(curves - fitted.drift * _DRIFT, 0.0)
    share = present / np.maximum(weights.max(axis=1) * (shape @ shape), _LEAST)
    return (weights * left) @ shape / np.maximum(present, _LEAST), share


def independent_values(correlation: Correlation, seconds: Floats, interval: float) -> Floats:
    """(k,) how many independent values of a variance are among values interval [s] apart over seconds (k,): of noise that
    stays, one.

    1 / n = (1 + 2 sum over j < N of (1 - j / N) r_j^2) / N (Bartlett, J. Roy. Statist. Soc. Suppl. 8 (1946) 27) with
    r_j = g exp(-j interval / T), its sum as an integral.
    """
    seconds = np.maximum(seconds, interval)
    decay, alone, share = 2 * seconds / correlation.time, interval / seconds, correlation.share**2
    staying = 2 / decay * (1 + np.expm1(-decay) / decay)
    return np.asarray(1 / ((1 - share) * alone + share * np.maximum(staying, alone)))
