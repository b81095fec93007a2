"""Expectation maximisation of the predicted covariance and of R, epoch by epoch (EM-KF).

Source: Lai, Yang et al., A novel robust SINS/GPS Kalman filter with unknown noise (2022), eqs. (26)-(41). An epoch makes
`iterations` steps from P(0) = F P F' + Q and R(0), the last estimate:
    K = P(i) H' (H P(i) H' + R(i))^-1, x(i+1) = x + K nu, P+(i+1) = P(i) - K H P(i)                               (26)-(28)
    R(i+1) = A = E[(z - H x)(z - H x)'], P(i+1) = B = P+(i+1) + (x(i+1) - x)(x(i+1) - x)'                   (31), (38), (39)
and takes x(S), P+(S). Eq. (30) prints A with the residual of the prediction, z - H x; the expectation (23) that it stands for
has that of the posterior, z - H x(i+1). `Em` is derived, `PrintedEm` as printed.
A floor under R in units of the told R clips eigenvalues, which is the M-step under that constraint. From epoch to epoch
each component's ratio to its told variance is kept, with the told correlations: those of one epoch are an outer product.
Assumes: prediction errors and noise Gaussian with unknown covariances that one epoch's residual can tell.
Property: the likelihood of the residual never falls from one iteration to the next (derived form; the printed one fails it).
Fails: P(1) is a posterior, and updating it again counts the same residual twice: from S = 2 the covariance is overconfident
several times over and the filter may diverge, which is why the default is S = 1 (the paper does not tell its S). R of one
epoch has one residual behind it and is as noisy as that, unless `memory` ties it to the told R. With more than one component
the likelihood is unbounded as S grows. NIS is fitted by construction and tells nothing.
When well specified, with S = 1: mean NEES per state 3 to 7, NIS per component 1.5 to 5 (`PrintedEm`: 2 to 5, 1.2 to 3).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from navreplay.adapt.ratio import scale_noise
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, condition, symmetric

__all__ = ["Em", "Estimate", "PrintedEm", "floor_noise", "improve"]


class Estimate(NamedTuple):
    """What the iterations change: prior, the innovation's moments that follow from it, and R = noise (m, m)."""

    prior: Gaussian
    innovation: Innovation
    noise: Floats


def improve(now: Estimate, floor: float, printed: bool = False) -> Estimate:
    """One step of expectation and maximisation; floor in units of the told R."""
    residual, cross, spread, told = now.innovation[:4]
    weight = np.linalg.inv(spread + now.noise)
    gain, seen_gain = cross @ weight, spread @ weight
    step, seen = gain @ residual, seen_gain @ residual
    left = symmetric(seen_gain @ now.noise)
    error = residual if printed else residual - seen
    posterior = condition(now.prior, now.innovation, now.noise, gain)
    innovation = now.innovation._replace(cross=gain @ now.noise + np.outer(step, seen), spread=left + np.outer(seen, seen))
    prior = Gaussian(now.prior.mean, posterior.cov + np.outer(step, step))
    return Estimate(prior, innovation, floor_noise(np.outer(error, error) + left, told, floor))


def floor_noise(noise: Floats, told: Floats, floor: float) -> Floats:
    """noise (m, m) with its eigenvalues in units of told (m, m) raised to floor."""
    root = np.linalg.cholesky(told)
    white = np.linalg.solve(root, np.linalg.solve(root, noise).T)
    values, vectors = np.linalg.eigh(symmetric(white))
    back = root @ vectors
    return symmetric((back * np.maximum(values, floor)) @ back.T)


@dataclass(frozen=True, slots=True)
class Em:
    """iterations: S, per epoch; with 1 the update still has P as predicted and R as the last epoch left it.
    floor: least ratio of used to told variance.
    memory: share of the last estimate, against the told R, in an epoch's first R."""

    iterations: int = 1
    floor: float = 0.05
    memory: float = 1.0

    printed: ClassVar[bool] = False

    def init(self) -> Mapping[str, float]:
        """By label, the ratio of estimated to told variance: none yet."""
        return {}

    def adapt(self, state: Mapping[str, float], prior: Gaussian, innovation: Innovation) -> Adaptation[Mapping[str, float]]:
        """Prior and R before the last iteration, whose update is then the filter's own."""
        told = innovation.noise
        ratio = np.array([1 + self.memory * (state.get(label, 1.0) - 1) for label in innovation.labels])
        now = Estimate(prior, innovation, scale_noise(told, ratio))
        for _ in range(self.iterations - 1):
            now = improve(now, self.floor, self.printed)
        found = improve(now, self.floor, self.printed).noise
        ratios = (np.diagonal(found) / np.diagonal(told)).tolist()
        return Adaptation(now.prior, now.noise, {**state, **dict(zip(innovation.labels, ratios, strict=True))})


@dataclass(frozen=True, slots=True)
class PrintedEm(Em):
    """With the residual of the prediction in (30), as printed."""

    printed: ClassVar[bool] = True
