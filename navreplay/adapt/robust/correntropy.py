"""Maximum correntropy update: prior and measurement errors weighted by a Gaussian kernel.

Source: Chen, Liu, Zhao and Principe, Maximum correntropy Kalman filter, Automatica 76 (2017) 70; its square-root cubature form
(MCSCKF) in Liu et al., ISA Transactions 80 (2018) 195. The stacked errors of prior and measurement under the posterior are
whitened by chol(P) and chol(R) and weighted by exp(-e^2 / (2 width^2)); P and R are divided by the weights in their
whitened axes, and the update repeated until the weights settle. A floor keeps weights from vanishing, without which single
runs diverge. The posterior covariance is that of the divided P and R, so that a distrusted fix also counts less in it; the
source takes the told ones there.
Assumes: outliers in either, seldom and in single epochs.
Fails: where the prior is overconfident (good measurements look like outliers); the whitened axes of P depend on the order
of the states. Weights below 1 for ordinary errors make it conservative: about 15 % in R at a width of 2.
When well specified: mean NEES per state 0.8 to 1.05, NIS per component 0.7 to 0.85.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, symmetric

__all__ = ["Correntropy"]


@dataclass(frozen=True, slots=True)
class Correntropy:
    """width: of the kernel [standard deviations]. floor: least weight. iterations: at most; tolerance: change of the weights
    that ends them."""

    width: float = 2.0
    floor: float = 0.02
    iterations: int = 20
    tolerance: float = 1e-3

    def init(self) -> None:
        """Nothing to remember."""

    def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
        """Prior and R divided by their weights."""
        root_prior = _root(prior.cov)
        root_noise = _root(innovation.noise)
        seen = solve_triangular(root_prior, innovation.cross, lower=True)
        sensed = solve_triangular(root_noise, innovation.residual, lower=True)
        # whitened by both: S = R^(1/2) (B' diag(1/w) B + diag(1/v)) R^(T/2)
        seen = solve_triangular(root_noise, seen.T, lower=True).T
        n = len(seen)
        weight: Floats = np.ones(n + len(sensed))
        for _ in range(self.iterations):
            wide = seen / weight[:n, None]
            pull = np.linalg.solve(seen.T @ wide + np.diag(1 / weight[n:]), sensed)
            new = self._weigh(np.concatenate([wide @ pull, pull / weight[n:]]))
            settled = np.abs(new - weight).max() < self.tolerance
            weight = new
            if settled:
                break
        cov, noise = _widen(root_prior, weight[:n]), _widen(root_noise, weight[n:])
        return Adaptation(Gaussian(prior.mean, cov), noise, state)

    def _weigh(self, error: Floats) -> Floats:
        return np.asarray(np.maximum(np.exp(-(error**2) / (2 * self.width**2)), self.floor))


def _root(cov: Floats) -> Floats:
    """Lower Cholesky factor of cov (n, n), taken of its correlations."""
    std = np.sqrt(np.diagonal(cov))
    return np.asarray(std[:, None] * np.linalg.cholesky(cov / (std[:, None] * std)))


def _widen(root: Floats, weight: Floats) -> Floats:
    return symmetric((root / weight) @ root.T)
