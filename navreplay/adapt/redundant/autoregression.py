"""Autoregressive models of short sequences: Burg's recursion, Akaike's order, Yule-Walker's first coefficient.

All functions take one sequence per row and treat them alike; sequences of zeros give coefficients of zero.
"""

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["akaike_order", "autocorrelation", "burg", "explained_share"]

_TINY = np.finfo(np.float64).tiny


def autocorrelation(x: Floats, lags: int) -> Floats:
    """(k, lags) of x (k, n) about zero at lags 1, 2, ..., the biased estimate; the first is Yule-Walker's AR(1) coefficient."""
    power = np.maximum((x**2).sum(axis=1), _TINY)
    return np.stack([(x[:, lag:] * x[:, :-lag]).sum(axis=1) / power for lag in range(1, lags + 1)], axis=1)


def burg(x: Floats, order: int) -> tuple[Floats, Floats]:
    """Predictor coefficients (order + 1, k, order), zero beyond the model's own order, and prediction error variances
    (order + 1, k) of the models of order 0, 1, ... of x (k, n).

    Ge et al. (2020), (25)-(27), whose recursion gives the prediction-error filter: the coefficients of the predictor (28) are
    its negatives. The sums of (26) begin at n = l + 1. order must be below n.
    """
    k = len(x)
    error_filter = np.zeros((k, order))
    variance = (x**2).mean(axis=1)
    predictors, variances = [-error_filter], [variance]
    forward, backward = x[:, 1:], x[:, :-1]
    for stage in range(order):
        power = np.maximum((forward**2 + backward**2).sum(axis=1), _TINY)
        reflection = (-2 * (forward * backward).sum(axis=1) / power)[:, None]
        known = error_filter[:, :stage]
        error_filter = error_filter.copy()
        error_filter[:, :stage] = known + reflection * known[:, ::-1]
        error_filter[:, stage] = reflection[:, 0]
        forward, backward = (forward + reflection * backward)[:, 1:], (backward + reflection * forward)[:, :-1]
        variance = variance * (1 - reflection[:, 0] ** 2)
        predictors.append(-error_filter)
        variances.append(variance)
    return np.array(predictors), np.array(variances)


def akaike_order(variances: Floats, n: int) -> NDArray[np.intp]:
    """(k,) order that minimises n ln(variance) + 2 order, of prediction error variances (orders, k) of n samples."""
    orders = np.arange(len(variances))[:, None]
    return np.argmin(n * np.log(np.maximum(variances, _TINY)) + 2 * orders, axis=0)


def explained_share(x: Floats, max_order: int) -> Floats:
    """(k,) sum of a_i beta_i of x (k, n), the a_i of Burg's model of Akaike's order, the beta_i the autocorrelation: the share
    of its variance that an autoregressive sequence owes to its past."""
    predictors, variances = burg(x, max_order)
    chosen = akaike_order(variances, x.shape[1])
    coefficients = predictors[chosen, np.arange(len(x))]
    return (coefficients * autocorrelation(x, max_order)).sum(axis=1)
