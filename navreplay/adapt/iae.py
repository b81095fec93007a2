"""Innovation-based adaptive estimation of R (IAE).

Source: Mohamed and Schwarz, Adaptive Kalman filtering for INS/GPS, J. Geodesy 73 (1999) 193, eq. (15): R = C_nu - H P H' with
C_nu the mean of nu nu' over a window.
Two departures, for logs whose told R varies from epoch to epoch: H P H' is taken of each epoch of the window (an outage
would else be subtracted from innovations that never had it), and what is averaged is each component's ratio of estimated
to told variance, which scales the told R and keeps its correlations. With a constant diagonal R both fall away.
Assumes: the model and Q are right and the innovations of the window white, so that what is left is R.
Fails: when Q is wrong (the error goes into R), when noise changes faster than the window, and on outliers, which stay in
the window for its whole length.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.adapt.adapter import Adaptation
from navreplay.adapt.ratio import excess_ratio, scale_noise
from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["Iae"]


@dataclass(frozen=True, slots=True)
class Iae:
    """window [epochs]: length; until it is full the told R holds. floor: least ratio of used to told variance."""

    window: int = 30
    floor: float = 0.05

    def init(self) -> Floats:
        """Ratios of the window's epochs (k, m), none yet."""
        return np.empty((0, 0))

    def adapt(self, state: Floats, prior: Gaussian, innovation: Innovation) -> Adaptation[Floats]:
        """R scaled by the window's mean ratio."""
        ratio = excess_ratio(innovation)[None]
        ratios = np.concatenate([state, ratio])[-self.window :] if len(state) else ratio
        if len(ratios) < self.window:
            return Adaptation(prior, innovation.noise, ratios)
        mean = np.maximum(ratios.mean(axis=0), self.floor)
        return Adaptation(prior, scale_noise(innovation.noise, mean), ratios)
