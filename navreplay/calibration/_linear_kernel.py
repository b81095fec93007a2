"""Forward filter and backward adjoints of a linear log, compiled: arrays in, arrays out. `.py_func` is their reference."""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def filter_forward(  # type: ignore[no-untyped-def]
    start, transitions, noises, corrections, starts, residual, jacobian, noise, innovation, weights, gains
):
    """Log-likelihood of all measurements; fills innovation (r,), weights (k, m, m) = S^-1 and gains (k, n, m).

    start (n, n): covariance before the first transition. transitions, noises (k, n, n): to each epoch. corrections (k, n):
    subtracted from the error behind each epoch. starts (k + 1,): rows of each epoch in residual (r,) and jacobian (r, n), whose
    R is noise (k, m, m), of which the part that an epoch has is used.
    """
    n = len(start)
    mean, cov, total = np.zeros(n), start.copy(), 0.0
    for k in range(len(transitions)):
        if k > 0:
            mean = mean - corrections[k - 1]
        mean = transitions[k] @ mean
        cov = transitions[k] @ cov @ transitions[k].T + noises[k]
        cov = (cov + cov.T) / 2
        first, last = starts[k], starts[k + 1]
        m = last - first
        if m == 0:
            continue
        h = jacobian[first:last]
        cross = cov @ h.T
        nu = residual[first:last] - h @ mean
        factor = np.linalg.cholesky(h @ cross + noise[k, :m, :m])
        half = np.linalg.inv(factor)
        weight = half.T @ half
        white = half @ nu
        total -= 0.5 * (white @ white + m * math.log(2 * math.pi))
        for i in range(m):
            total -= math.log(factor[i, i])
        gain = cross @ weight
        mean = mean + gain @ nu
        keep = np.eye(n) - gain @ h
        cov = keep @ cov @ keep.T + gain @ noise[k, :m, :m].copy() @ gain.T
        innovation[first:last] = nu
        weights[k, :m, :m] = weight
        gains[k, :, :m] = gain
    return total


@njit(cache=True)
def adjoin_backward(  # type: ignore[no-untyped-def]
    transitions, starts, jacobian, innovation, weights, gains, pulls, holds, state_pulls, state_holds
):
    """Fills pulls u (r,) and holds D (k, m, m) of the measurements, state_pulls l (k, n) and state_holds L (k, n, n) of the
    states before them, from the end on:
        u = S^-1 nu - K' l+, D = S^-1 + K' L+ K, l = l+ + H' u, L = H' S^-1 H + (I - K H)' L+ (I - K H),
    with l+ = Phi' l and L+ = Phi' L Phi of the epoch behind."""
    count, n = len(transitions), transitions.shape[1]
    pull, hold = np.zeros(n), np.zeros((n, n))
    for k in range(count - 1, -1, -1):
        if k < count - 1:
            pull = transitions[k + 1].T @ pull
            hold = transitions[k + 1].T @ hold @ transitions[k + 1]
        first, last = starts[k], starts[k + 1]
        m = last - first
        if m > 0:
            h = jacobian[first:last]
            gain = np.ascontiguousarray(gains[k, :, :m])
            weight = np.ascontiguousarray(weights[k, :m, :m])
            u = weight @ innovation[first:last] - gain.T @ pull
            seen = hold @ gain
            pulls[first:last] = u
            holds[k, :m, :m] = weight + gain.T @ seen
            pull = pull + h.T @ u
            keep = np.eye(n) - gain @ h
            hold = h.T @ weight @ h + keep.T @ hold @ keep
            hold = (hold + hold.T) / 2
        state_pulls[k] = pull
        state_holds[k] = hold
