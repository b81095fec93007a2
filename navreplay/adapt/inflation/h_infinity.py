"""H-infinity filter: the prior is widened so that the worst case, not the mean square, is bounded.

Source: Simon, Optimal State Estimation (2006), section 11.3, whose update with gain K = P_k H' R^-1 and
P_k^-1 = P^-1 - gamma^-2 L'L + H' R^-1 H is that of a Kalman filter with the prior (P^-1 - gamma^-2 L'L)^-1; as HRCKF in
Zhang et al., J. Navigation 68 (2015) 549 (there the gain is that of the unchanged prior). L scales every state by its
nominal standard deviation, that of the first epoch's prior; in mixed units gamma would mean nothing.
gamma has a lower bound, where the widened prior ceases to be positive: gamma^2 is at least `margin` times the largest
eigenvalue of L P L', so that no variance grows more than margin / (margin - 1) times.
Assumes: errors of bounded energy, nothing about their distribution.
Fails: a state that is not observed is widened again at every epoch, faster the larger it is, so that its covariance loses
meaning; after an outage the bound, not gamma, decides. R it does not adapt.
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
        cov = prior.cov + (axes * (values**2 / (bound - values))) @ axes.T
        return Adaptation(Gaussian(prior.mean, symmetric(cov)), innovation.noise, nominal)
