"""Per-component ratios of estimated to told noise variance, which IAE and Sage-Husa average in their own ways."""

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation

__all__ = ["excess_ratio", "scale_noise"]


def excess_ratio(innovation: Innovation) -> Floats:
    """(m,) (nu_i^2 - spread_ii) / R_ii: unbiased for the variance ratio of one epoch, and of either sign."""
    excess = innovation.residual**2 - innovation.spread.diagonal()
    return np.asarray(excess / innovation.noise.diagonal())


def scale_noise(noise: Floats, ratio: Floats) -> Floats:
    """noise (m, m) with its variances multiplied by ratio (m,) and its correlations kept."""
    root = np.sqrt(ratio)
    return np.asarray(noise * root[:, None] * root)
