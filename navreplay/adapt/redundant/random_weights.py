"""Weights for a random weighting estimate, repeatable by seed and epoch."""

import numpy as np

from navreplay.timeline import Floats

__all__ = ["random_weights"]


def random_weights(seed: int, t_ns: int, counts: Floats, length: int, concentration: float, draws: int) -> Floats:
    """Weights (k, length) of the last counts (k,) places of each row, zero before; each row sums to one.

    The mean of so many draws from the Dirichlet distribution of the given concentration (1: flat), from a generator of the
    seed and the time of the epoch alone. A large concentration, or many draws, come close to equal weights.
    """
    rng = np.random.default_rng([seed, t_ns])
    parts = rng.standard_gamma(concentration, (draws, len(counts), length))
    parts *= np.arange(length, 0, -1) <= counts[:, None]
    total = parts.sum(axis=2, keepdims=True)
    return np.asarray((parts / np.maximum(total, np.finfo(np.float64).tiny)).mean(axis=0))
