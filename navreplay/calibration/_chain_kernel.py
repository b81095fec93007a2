"""Forward-backward pass of a hidden Markov chain, compiled: arrays in, arrays out. `.py_func` is its reference."""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def pass_chain(first, move, density, posterior, moves):  # type: ignore[no-untyped-def]
    """Log-likelihood of a chain; fills posterior (k, s) of the states and adds to moves (s, s) their expected transitions.

    first (s,): probabilities before the first epoch. move (s, s): from row to column. density (k, s): log-density of each
    epoch's data in each state. Rabiner, A tutorial on hidden Markov models, Proc. IEEE 77 (1989) 257, with scaling.
    """
    count, states = density.shape
    total = 0.0
    likelihood = np.empty((count, states))
    ahead = first.copy()
    scale = np.empty(count)
    for k in range(count):
        top = density[k].max()
        for i in range(states):
            likelihood[k, i] = math.exp(density[k, i] - top)
            posterior[k, i] = ahead[i] * likelihood[k, i]
        scale[k] = posterior[k].sum()
        posterior[k] /= scale[k]
        total += math.log(scale[k]) + top
        for j in range(states):
            ahead[j] = 0.0
            for i in range(states):
                ahead[j] += posterior[k, i] * move[i, j]
    behind = np.ones(states)
    for k in range(count - 1, 0, -1):
        pulled = np.zeros(states)
        for i in range(states):
            for j in range(states):
                joint = move[i, j] * likelihood[k, j] * behind[j] / scale[k]
                moves[i, j] += posterior[k - 1, i] * joint
                pulled[i] += joint
        posterior[k] *= behind
        posterior[k] /= posterior[k].sum()
        behind = pulled
    posterior[0] *= behind
    posterior[0] /= posterior[0].sum()
    return total
