"""Strong tracking: the prior is inflated by a fading factor when innovations exceed what is predicted.

Source: Zhou and Frank, Strong tracking filtering of nonlinear time-varying stochastic systems with coloured noise, Int. J.
Control 65 (1996) 295; as in Lou et al. (2019), eqs. (44)-(48): V_k = (rho V_k-1 + nu nu') / (1 + rho), V_1 = nu nu',
lambda = max(1, tr(O) / tr(M)) with O = V - R and M = H P H'; `softening` is Zhou and Frank's factor on R in O.
Traces over metres and metres per second mean nothing: here each component is normalised by its nominal standard
deviation, the square root of its S of the epoch.
lambda multiplies what of the prior the measurement sees: P + (lambda - 1) P H' (H P H')^-1 H P, for which H P H' becomes
lambda H P H', as printed. Eq. (32) multiplies all of P but Q; on our drives that let the covariance of what is weakly observed
(heading, biases) grow until it overflowed.
Assumes: R is right, so that an excess comes from the model.
Fails: rho = 0.95 is a memory of about two epochs, and where P is small against R the quotient is mostly noise: lambda exceeds 1
about every other epoch in nominal conditions. An outlier inflates the prior and is believed; so is noise larger than told.
When well specified: mean NEES per state 0.8 to 0.95, NIS per component 0.75 to 0.9.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, symmetric

__all__ = ["StrongTracking"]


@dataclass(frozen=True, slots=True)
class StrongTracking:
    """forgetting: rho. softening: factor on R; larger ones inflate less often."""

    forgetting: float = 0.95
    softening: float = 1.0

    def init(self) -> Mapping[str, float]:
        """By label, its normalised V: none yet."""
        return {}

    def adapt(self, state: Mapping[str, float], prior: Gaussian, innovation: Innovation) -> Adaptation[Mapping[str, float]]:
        """Prior times lambda; the told R."""
        predicted, told = np.diagonal(innovation.spread), np.diagonal(innovation.noise)
        nominal = predicted + told
        square = innovation.residual**2 / nominal
        last = np.array([state.get(label, now) for label, now in zip(innovation.labels, square.tolist(), strict=True)])
        faded = (self.forgetting * last + square) / (1 + self.forgetting)
        factor = (faded - self.softening * told / nominal).sum() / (predicted / nominal).sum()
        after = {**state, **dict(zip(innovation.labels, faded.tolist(), strict=True))}
        return Adaptation(_stretch(prior, innovation, factor) if factor > 1 else prior, innovation.noise, after)


def _stretch(prior: Gaussian, innovation: Innovation, factor: float) -> Gaussian:
    """prior with the covariance of the measurement's prediction multiplied by factor."""
    std = np.sqrt(np.diagonal(innovation.spread))
    # more components than states leave it singular
    inverse = np.linalg.pinv(innovation.spread / (std[:, None] * std), rcond=1e-12, hermitian=True)
    seen = innovation.cross / std
    return Gaussian(prior.mean, symmetric(prior.cov + (factor - 1) * seen @ inverse @ seen.T))
