"""Covariances of a bank's hypotheses, compiled: arrays in, arrays out. `.py_func` of each kernel is its reference in tests."""

import numpy as np
from numba import njit


@njit(cache=True)
def carry(transitions, noises, q_scales, beyond_told, covariances, means, covs):  # type: ignore[no-untyped-def]
    """Moves M hypotheses over k nodes, and corrects the mixture's covariances there.

    transitions, noises (k, n, n): from the node before to each, noises as told. q_scales (M,): of each hypothesis.
    beyond_told: average of q_scales, less one. Changed: covariances (k, n, n) of the mixture, which were moved with the told
    noise; means (M, n) and covs (M, n, n), from before the first node to the last.
    """
    n = means.shape[1]
    phi, noise = np.eye(n), np.zeros((n, n))
    for node in range(transitions.shape[0]):
        step = transitions[node]
        phi = np.dot(step, phi)
        moved = np.dot(np.dot(step, noise), step.T)
        for i in range(n):
            for j in range(i + 1):
                noise[i, j] = noise[j, i] = (moved[i, j] + moved[j, i]) / 2 + noises[node, i, j]
        covariances[node] += beyond_told * noise
    for hypothesis in range(means.shape[0]):
        covs[hypothesis] = np.dot(np.dot(phi, covs[hypothesis]), phi.T) + q_scales[hypothesis] * noise
        means[hypothesis] = np.dot(phi, means[hypothesis])


@njit(cache=True)
def update(residual, jacobian, noises, estimated, means, covs, log_likelihood):  # type: ignore[no-untyped-def]
    """Updates M hypotheses by residual (m,), which the nominal state has left, with jacobian (m, n) and noises (M, m, m).
    States behind the first `estimated` are biases that are considered: they move by nothing and keep their covariance.

    Changed: means (M, n), covs (M, n, n); filled: log_likelihood (M,) but for a constant. Returns whether every S is positive
    definite; where not, what is changed means nothing.
    """
    m, n = jacobian.shape
    white = np.empty((m, n + 1))
    for h in range(means.shape[0]):
        seen = np.dot(jacobian, covs[h])
        spread = np.dot(seen, jacobian.T) + noises[h]
        own = residual - np.dot(jacobian, means[h])
        # forward: the Cholesky factor in place of spread's lower half, and [J P, residual] whitened by it
        total = 0.0
        for i in range(m):
            for j in range(i + 1):
                value = spread[i, j]
                for k in range(j):
                    value -= spread[i, k] * spread[j, k]
                if i > j:
                    spread[i, j] = value / spread[j, j]
                elif value > 0:
                    spread[i, i] = np.sqrt(value)
                else:
                    return False
            for c in range(n + 1):
                value = seen[i, c] if c < n else own[i]
                for k in range(i):
                    value -= spread[i, k] * white[k, c]
                white[i, c] = value / spread[i, i]
            total += 2 * np.log(spread[i, i]) + white[i, n] ** 2
        log_likelihood[h] = -total / 2
        for i in range(n):
            for k in range(m if i < estimated else 0):
                means[h, i] += white[k, i] * white[k, n]
            for j in range(i + 1):
                value = (covs[h, i, j] + covs[h, j, i]) / 2
                for k in range(m if j < estimated else 0):
                    value -= white[k, i] * white[k, j]
                covs[h, i, j] = covs[h, j, i] = value
    return True
