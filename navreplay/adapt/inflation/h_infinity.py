"""H-infinity filter: the prior is widened so that the worst case, not the mean square, is bounded.

Source: Simon, Optimal State Estimation (2006), section 11.3, whose update with gain K = P_k H' R^-1 and
P_k^-1 = P^-1 - gamma^-2 L'L + H' R^-1 H is that of a Kalman filter with the prior (P^-1 - gamma^-2 L'L)^-1; as HRCKF in
Zhang et al., J. Navigation 68 (2015) 549 (there the gain is that of the unchanged prior). L scales every state by its
nominal standard deviation, that of the first epoch's prior; in mixed units gamma would mean nothing.
gamma has a lower bound, where the widened prior ceases to be positive: gamma^2 is at least `margin` times the largest
eigenvalue of L P L', so that no variance grows more than margin / (margin - 1) times.
Only what the measurement sees is widened: of the excess X = P_k - P the part T X T' with T = P H' (H P H')^-1 H. As written, a
state that no measurement observes is widened at every epoch until it means nothing (58 km after 60 s of stars alone).
gamma: at the nominal covariance it adds a share 1 / (gamma^2 - 1) to a variance; the default, 1 %, is the least that still
guards, for noise that is told right costs as much: docs/methods/h-infinity.md.
Assumes: errors of bounded energy, nothing about their distribution.
Fails: after an outage the bound, not gamma, decides. R it does not adapt.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, symmetric

__all__ = ["HInfinity"]


@dataclass(frozen=True, slots=True)
class HInfinity:
    """gamma [nominal standard deviations]: smaller ones guard more. margin: of gamma^2 above its bound, greater than 1."""

    gamma: float = 10.0
    margin: float = 5.0

    def init(self) -> None:
        """Nominal standard deviations: not known before the first epoch."""

    def adapt(self, state: Floats | None, prior: Gaussian, innovation: Innovation) -> Adaptation[Floats | None]:
        """The widened prior; the told R."""
        nominal = np.sqrt(np.diagonal(prior.cov)) if state is None else state
        values, vectors = np.linalg.eigh(prior.cov / (nominal[:, None] * nominal))
        bound = max(self.gamma**2, self.margin * float(values[-1]))
        axes = nominal[:, None] * vectors
        excess = (axes * (values**2 / (bound - values))) @ axes.T
        seen = _seen(prior.cov, innovation)
        return Adaptation(Gaussian(prior.mean, symmetric(prior.cov + seen @ excess @ seen.T)), innovation.noise, nominal)


def _seen(cov: Floats, innovation: Innovation) -> Floats:
    """(n, n) T of cov (n, n): P H' (H P H')^-1 H P P^-1, solved in units of each one's own standard deviation."""
    std, spread = np.sqrt(np.diagonal(cov)), np.sqrt(np.diagonal(innovation.spread))
    inverse = np.linalg.pinv(innovation.spread / (spread[:, None] * spread), rcond=1e-12, hermitian=True)
    cross = innovation.cross / (std[:, None] * spread)
    back = np.linalg.solve(cov / (std[:, None] * std), cross @ inverse.T)
    return np.asarray(std[:, None] * (cross @ back.T) / std)
