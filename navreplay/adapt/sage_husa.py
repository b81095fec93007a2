"""Sage-Husa adaptive filter, for R.

Source: Sage and Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control Conference (1969) 760, with
the fading weight of later practice: R_k = (1 - d_k) R_k-1 + d_k (nu nu' - H P H'), d_k = (1 - b) / (1 - b^(k+1)).
What is averaged is each component's ratio of estimated to told variance, which scales the told R and keeps its
correlations; with a constant diagonal R that is the printed recursion on the diagonal. A floor guards positivity, since
nu nu' - H P H' of one epoch may be negative.
Assumes: model and Q are right, noise changes slowly against 1 / (1 - b) epochs.
Fails: with Q wrong or P far from converged; the printed start (d_0 = 1) believes the first epoch alone, so the told R here
counts as `told_epochs` epochs.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.adapter import Adaptation
from navreplay.adapt.ratio import excess_ratio, scale_noise
from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["SageHusa", "SageHusaState"]


class SageHusaState(NamedTuple):
    """ratio (m,) of estimated to told variance; epochs: how many stand behind it."""

    ratio: Floats
    epochs: int


@dataclass(frozen=True, slots=True)
class SageHusa:
    """forgetting: b, per epoch. floor: least ratio of used to told variance. told_epochs: weight of the told R at the start."""

    forgetting: float = 0.98
    floor: float = 0.05
    told_epochs: int = 10

    def init(self) -> SageHusaState:
        """The told R."""
        return SageHusaState(np.ones(1), self.told_epochs)

    def adapt(self, state: SageHusaState, prior: Gaussian, innovation: Innovation) -> Adaptation[SageHusaState]:
        """R scaled by the fading mean of the ratios, this epoch's included."""
        weight = (1 - self.forgetting) / (1 - self.forgetting ** (state.epochs + 1))
        ratio = np.maximum((1 - weight) * state.ratio + weight * excess_ratio(innovation), self.floor)
        return Adaptation(prior, scale_noise(innovation.noise, ratio), SageHusaState(ratio, state.epochs + 1))
