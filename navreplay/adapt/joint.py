"""Moments that follow from those of an innovation alone, by the joint Gaussian of state and prediction."""

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.gaussian import Gaussian, Innovation, solve, symmetric

__all__ = ["inflate", "posterior_square"]


def posterior_square(innovation: Innovation, noise: Floats) -> Floats:
    """(m,) expected square of each measurement error under the posterior with R = noise (m, m).

    The posterior residual is R S^-1 nu, the posterior's spread H P H' - H P H' S^-1 H P H' = R S^-1 H P H'.
    """
    keep = solve(innovation.spread + noise, noise).T
    return np.asarray((keep @ innovation.residual) ** 2 + (keep * innovation.spread).sum(axis=1))


def inflate(prior: Gaussian, innovation: Innovation, extra: Floats) -> tuple[Gaussian, Innovation]:
    """Prior and innovation with variances extra (n,) added to the prior.

    H, of which an innovation tells only P H', is (P H')' P^-1: solved in units of each state's own standard deviation.
    """
    std = np.sqrt(np.diagonal(prior.cov))
    jacobian = (np.linalg.solve(prior.cov / (std[:, None] * std), innovation.cross / std[:, None]) / std[:, None]).T
    added = jacobian.T * extra[:, None]
    spread = symmetric(innovation.spread + jacobian @ added)
    wider = Gaussian(prior.mean, prior.cov + np.diag(extra))
    return wider, innovation._replace(cross=innovation.cross + added, spread=spread)
