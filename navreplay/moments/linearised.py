"""Moment rules: how the moments of a prediction are formed from those of the state, and what a measurement does to them."""

from dataclasses import dataclass
from typing import Protocol

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.timeline import Floats
from navreplay.update.gaussian import Gaussian, Innovation, condition
from navreplay.update.measurement import Measurement

__all__ = ["Linearised", "MomentRule"]


class MomentRule(Protocol):
    """What the epoch loop asks of a moment rule."""

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg (see `ErrorModel.propagate`)."""
        ...

    def innovate(self, prior: Gaussian, measurement: Measurement) -> Innovation:
        """Innovation of a measurement whose residual was formed at the nominal state, against the prior error of mean (n,)."""
        ...

    def condition(self, prior: Gaussian, innovation: Innovation, noise: Floats) -> Gaussian:
        """Posterior with R = noise (m, m)."""
        ...


@dataclass(frozen=True, slots=True)
class Linearised:
    """First order (extended Kalman filter): moments through the Jacobian at the nominal state."""

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg, by the model's transition."""
        return model.propagate(state, cov, leg)

    def innovate(self, prior: Gaussian, measurement: Measurement) -> Innovation:
        """Innovation of a measurement whose residual was formed at the nominal state, against the prior error of mean (n,)."""
        cross = prior.cov @ measurement.jacobian.T
        labels = tuple(f"{kind} {label}" for kind, label in zip(measurement.kinds, measurement.labels, strict=True))
        residual = measurement.residual - measurement.jacobian @ prior.mean
        return Innovation(residual, cross, measurement.jacobian @ cross, measurement.noise, labels)

    def condition(self, prior: Gaussian, innovation: Innovation, noise: Floats) -> Gaussian:
        """Posterior with R = noise (m, m), by the optimal gain."""
        return self.settle(condition(prior, innovation, noise))

    def settle(self, posterior: Gaussian) -> Gaussian:
        """The posterior of mean (n,) about the state that it moves to: the same, where errors add up."""
        return posterior
