"""Likelihood of a window of innovations, compiled: arrays in, arrays out. `.py_func` of the kernel is its reference."""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def misfit(log_ratio, residual, spread, noise, gradient, curvature):  # type: ignore[no-untyped-def]
    """J = sum over k of ln|S_k| + nu_k' S_k^-1 nu_k with S_k = spread_k + R_k, R_k,ab = noise_k,ab exp((x_a + x_b) / 2).

    log_ratio x (m,); residual nu (w, m); spread, noise (w, m, m). Fills gradient (m,), dJ / dx, and curvature (m,), the
    diagonal of the expected second derivative where noise is diagonal. With W = S^-1 and y = W nu:
    dJ / dx_a = sum of (W R)_aa - y_a (R y)_a.
    """
    count, size = residual.shape
    root = np.exp(log_ratio / 2)
    told = np.empty((size, size))
    factor = np.empty((size, size))
    inverse = np.zeros((size, size))
    white = np.empty(size)
    pull = np.empty(size)
    gradient[:] = 0.0
    curvature[:] = 0.0
    value = 0.0
    for k in range(count):
        for i in range(size):
            for j in range(i + 1):
                told[i, j] = told[j, i] = noise[k, i, j] * root[i] * root[j]
                rest = spread[k, i, j] + told[i, j]
                for h in range(j):
                    rest -= factor[i, h] * factor[j, h]
                factor[i, j] = math.sqrt(rest) if i == j else rest / factor[j, j]
            value += 2 * math.log(factor[i, i])
        for j in range(size):
            inverse[j, j] = 1 / factor[j, j]
            for i in range(j + 1, size):
                rest = 0.0
                for h in range(j, i):
                    rest -= factor[i, h] * inverse[h, j]
                inverse[i, j] = rest / factor[i, i]
        for i in range(size):
            white[i] = 0.0
            for h in range(i + 1):
                white[i] += inverse[i, h] * residual[k, h]
            value += white[i] * white[i]
        for a in range(size):
            pull[a] = 0.0
            for i in range(a, size):
                pull[a] += inverse[i, a] * white[i]
        for a in range(size):
            share, pulled = 0.0, 0.0
            for b in range(size):
                weight = 0.0
                for i in range(max(a, b), size):
                    weight += inverse[i, a] * inverse[i, b]
                share += weight * told[a, b]
                pulled += told[a, b] * pull[b]
            gradient[a] += share - pull[a] * pulled
            curvature[a] += share * share
    return value
