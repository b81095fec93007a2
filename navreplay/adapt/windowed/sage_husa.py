"""Sage-Husa adaptive filter, for R.

Source: Sage and Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control Conference (1969) 760, with
the fading weight of later practice: R_k = (1 - d_k) R_k-1 + d_k (nu nu' - H P H'), d_k = (1 - b) / (1 - b^(k+1)).
What is averaged is each component's ratio of estimated to told variance, which scales the told R and keeps its
correlations; with a constant diagonal R that is the printed recursion on the diagonal. A floor guards positivity, since
nu nu' - H P H' of one epoch may be negative.
Assumes: model and Q are right, noise changes slowly against 1 / (1 - b) epochs.
Fails: with Q wrong or P far from converged; the printed start (d_0 = 1) believes the first epoch alone, so the told R here
counts as `told_epochs` epochs.
When well specified: mean NEES per state 1 to 1.3, NIS per component 0.9 to 1.05.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.ratio import excess_ratio, scale_noise
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Fading", "SageHusa"]


class Fading(NamedTuple):
    """ratio of estimated to told variance; epochs: how many stand behind it."""

    ratio: float
    epochs: int


@dataclass(frozen=True, slots=True)
class SageHusa:
    """forgetting: b, per epoch. floor: least ratio of used to told variance. told_epochs: weight of the told R at the start."""

    forgetting: float = 0.98
    floor: float = 0.05
    told_epochs: int = 10

    def init(self) -> Mapping[str, Fading]:
        """The told R for every label."""
        return {}

    def adapt(self, state: Mapping[str, Fading], prior: Gaussian, innovation: Innovation) -> Adaptation[Mapping[str, Fading]]:
        """R scaled by the fading mean of each component's ratios, this epoch's included."""
        told = Fading(1.0, self.told_epochs)
        pairs = zip(innovation.labels, excess_ratio(innovation).tolist(), strict=True)
        fadings = {label: self._fade(state.get(label, told), ratio) for label, ratio in pairs}
        ratio = np.array([fading.ratio for fading in fadings.values()])
        return Adaptation(prior, scale_noise(innovation.noise, ratio), {**state, **fadings})

    def _fade(self, last: Fading, ratio: float) -> Fading:
        weight = (1 - self.forgetting) / (1 - self.forgetting ** (last.epochs + 1))
        return Fading(max((1 - weight) * last.ratio + weight * ratio, self.floor), last.epochs + 1)
