"""Variational Bayes estimation of R.

Source: Särkkä and Nummenmaa, Recursive noise adaptive Kalman filtering by variational Bayesian approximations, IEEE
Trans. Automatic Control 54 (2009) 596. Each component's variance is inverse gamma with shape a and scale b:
    prediction: a = rho a, b = rho b; update: a = a + 1/2 and, until they settle, R = b / a, posterior of the state with R,
    b = rho b- + E[(z - H x)^2] / 2
What is inverse gamma is each component's ratio to its told variance, which scales the told R and keeps its correlations;
with a constant diagonal R that is the published filter.
Assumes: P is right, noise white and slowly varying against 1 / (1 - rho) epochs.
Fails: on single outliers (they raise R for its whole memory), and with Q wrong; against IAE and Sage-Husa the estimate cannot
become negative and the present residual counts at once.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.joint import posterior_square
from navreplay.adapt.ratio import scale_noise
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["InverseGamma", "VariationalBayes"]


class InverseGamma(NamedTuple):
    """Distribution of a variance ratio: its density falls as ratio^-(shape + 1) exp(-scale / ratio)."""

    shape: float
    scale: float


@dataclass(frozen=True, slots=True)
class VariationalBayes:
    """forgetting: rho, per epoch. told_epochs: weight of the told R at the start. iterations: per epoch."""

    forgetting: float = 0.98
    told_epochs: int = 10
    iterations: int = 3

    def init(self) -> Mapping[str, InverseGamma]:
        """The told R for every label."""
        return {}

    def adapt(
        self, state: Mapping[str, InverseGamma], prior: Gaussian, innovation: Innovation
    ) -> Adaptation[Mapping[str, InverseGamma]]:
        """R of the last iteration."""
        start = InverseGamma(self.told_epochs / 2, self.told_epochs / 2)
        before = np.array([state.get(label, start) for label in innovation.labels])
        shape, scale = self.forgetting * before[:, 0] + 0.5, self.forgetting * before[:, 1]
        told = np.diagonal(innovation.noise)
        ratio = before[:, 1] / before[:, 0]
        for _ in range(self.iterations):
            square = posterior_square(innovation, scale_noise(innovation.noise, ratio)) / told
            ratio = (scale + square / 2) / shape
        after = map(InverseGamma, shape.tolist(), (ratio * shape).tolist())
        noise = scale_noise(innovation.noise, ratio)
        return Adaptation(prior, noise, {**state, **dict(zip(innovation.labels, after, strict=True))})
