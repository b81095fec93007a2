"""The measurement update: one innovation, one conditioning, for every filter."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from navreplay.timeline import Floats, LogError

__all__ = ["Gaussian", "Innovation", "Leftover", "chi_square", "condition", "kalman_gain", "solve", "symmetric"]

_FLOOR = 1e-12
"""Of the eigenvalues of a covariance against the largest: what double precision leaves of it."""


class Gaussian(NamedTuple):
    """mean (n,) and covariance cov (n, n) of the error state."""

    mean: Floats
    cov: Floats


class Leftover(NamedTuple):
    """What an epoch's measurement was off from the state behind its update. t_ns: the epoch. residual: by label, measured minus
    predicted from the corrected state; of components that were not used, too."""

    t_ns: int
    residual: Mapping[str, float]


class Innovation(NamedTuple):
    """A measurement against its prediction.

    residual (m,): measured minus predicted. cross (n, m): covariance of state and prediction. spread (m, m): covariance of
    the prediction without noise. noise (m, m): nominal R. labels (m,): one per component, e.g. ``position north``. t_ns: the
    epoch. leftover: of the epoch before, None where the state in between is not carried by the same filter.
    """

    residual: Floats
    cross: Floats
    spread: Floats
    noise: Floats
    labels: tuple[str, ...]
    t_ns: int = 0
    leftover: Leftover | None = None

    def select(self, rows: np.ndarray) -> "Innovation":
        """The components with index in rows (k,)."""
        square = rows[:, None], rows
        labels = tuple(self.labels[i] for i in rows)
        return self._replace(
            residual=self.residual[rows],
            cross=self.cross[:, rows],
            spread=self.spread[square],
            noise=self.noise[square],
            labels=labels,
        )


def symmetric(matrix: Floats) -> Floats:
    """The symmetric part of matrix (n, n)."""
    return np.asarray((matrix + matrix.T) / 2)


def kalman_gain(innovation: Innovation, noise: Floats) -> Floats:
    """Gain K (n, m) = cross S^-1 with S = spread + noise (m, m)."""
    return solve(innovation.spread + noise, innovation.cross.T).T


def condition(prior: Gaussian, innovation: Innovation, noise: Floats, gain: Floats | None = None) -> Gaussian:
    """Posterior with R = noise (m, m), for any gain (n, m); without one the optimal gain.

    The Joseph form written for joint moments: [I, -K] [[P, C], [C', S]] [I, -K]' = P - K C' - C K' + K S K'; with C = P H' and
    S = H P H' + R it is (I - K H) P (I - K H)' + K R K'.
    """
    k = kalman_gain(innovation, noise) if gain is None else gain
    spread = innovation.spread + noise
    shared = k @ innovation.cross.T
    cov = prior.cov - shared - shared.T + k @ spread @ k.T
    return Gaussian(prior.mean + k @ innovation.residual, symmetric(cov))


def chi_square(residual: Floats, cov: Floats) -> float:
    """residual' cov^-1 residual, of residual (m,) and cov (m, m)."""
    return float(residual @ solve(cov, residual))


def solve(cov: Floats, right: Floats) -> Floats:
    """cov^-1 right by Cholesky, of the covariance (m, m) of an innovation and right (m, ...).

    The bare LAPACK call, whose wrappers would cost ten times the work at these sizes. Where rounding has taken definiteness
    from a finite cov, its eigenvalues are kept above a floor. Raises LogError where cov is not finite.
    """
    _, solution, info = dposv(cov, right, lower=True)
    return np.asarray(solution) if info == 0 else _solve_floored(cov, right)


def _solve_floored(cov: Floats, right: Floats) -> Floats:
    if not np.isfinite(cov).all():
        raise LogError(
            "filter: the covariance of an innovation is not finite; are the standard deviations told plausible (neither zero "
            "nor beyond all bounds)?"
        )
    values, axes = np.linalg.eigh(symmetric(cov))
    floored = np.maximum(values, _FLOOR * max(float(np.abs(values).max()), np.finfo(float).tiny))
    turned = axes.T @ right
    return np.asarray(axes @ (turned.T / floored).T)
