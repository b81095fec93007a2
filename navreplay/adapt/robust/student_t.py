"""Measurement noise with Student's t distribution.

Source: Piche, Särkkä and Hartikainen, Recursive outlier-robust filtering and smoothing for nonlinear systems using the
multivariate Student-t distribution, IEEE MLSP (2012), with independent components. A t-distributed error is Gaussian with
variance R / w, w of Gamma(dof / 2, dof / 2); until they settle
    w = (dof + 1) / (dof + E[(z - H x)^2] / R), posterior of the state with R / w.
The told R is t's scale, so that a residual of the size told is left alone.
Assumes: noise symmetric with heavy tails, independent between components and epochs; the prior is good.
Fails: on biased or time-correlated errors, and when the prior is overconfident. On Gaussian noise it loses a few percent.
When well specified: mean NEES per state 0.9 to 1.25, NIS per component 0.8 to 0.92.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.adapt.joint import posterior_square
from navreplay.adapt.ratio import scale_noise
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["StudentT"]


@dataclass(frozen=True, slots=True)
class StudentT:
    """dof: degrees of freedom; large ones are nearly Gaussian. iterations: at most; tolerance: relative change of the
    weights that ends them."""

    dof: float = 4.0
    iterations: int = 20
    tolerance: float = 1e-3

    def init(self) -> None:
        """Nothing to remember."""

    def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
        """R divided by the weights."""
        told = np.diagonal(innovation.noise)
        weight = np.ones(len(told))
        noise = innovation.noise
        for _ in range(self.iterations):
            new = (self.dof + 1) / (self.dof + posterior_square(innovation, noise) / told)
            settled = np.abs(new - weight).max() < self.tolerance
            weight = new
            noise = scale_noise(innovation.noise, 1 / weight)
            if settled:
                break
        return Adaptation(prior, noise, state)
