"""Whether a datum belongs to those before it, by a kernel estimate of their density.

Ge et al., Sensors 20 (2020) 6041, (20)-(24), with the bandwidth of Silverman, Density Estimation (1986), 3.4.2. In print (23)
has the variance where the standard deviation is meant, and K(3 sigma) is read as the normal density three sigma out.
"""

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["is_credible", "kernel_density", "silverman_bandwidth"]

_TINY = np.finfo(np.float64).tiny


def silverman_bandwidth(std: Floats, count: int) -> Floats:
    """1.06 std count^(-1/5) of standard deviations (k,)."""
    return 1.06 * std * count ** (-0.2)


def kernel_density(samples: Floats, at: Floats, bandwidth: Floats) -> Floats:
    """(k,) density at the points at (k,) of Gaussian kernels of the given bandwidth (k,) on samples (k, n)."""
    width = np.maximum(bandwidth, _TINY)[:, None]
    return np.exp(-0.5 * ((at[:, None] - samples) / width) ** 2).mean(axis=1) / (np.sqrt(2 * np.pi) * width[:, 0])


def is_credible(samples: Floats, datum: Floats) -> NDArray[np.bool_]:
    """(k,) whether the density of samples (k, n) at datum (k,) exceeds that of N(0, s^2) at 3 s, s their root mean square."""
    std = np.maximum(np.sqrt((samples**2).mean(axis=1)), _TINY)
    least = np.exp(-4.5) / (np.sqrt(2 * np.pi) * std)
    return np.asarray(kernel_density(samples, datum, silverman_bandwidth(std, samples.shape[1])) > least)
