"""Moment rules: how the moments of a prediction are formed from those of the state."""

from dataclasses import dataclass

from navreplay.filters.core import Gaussian, Innovation
from navreplay.measurements import Measurement

__all__ = ["Linearised"]


@dataclass(frozen=True, slots=True)
class Linearised:
    """First order (extended Kalman filter): moments through the Jacobian at the nominal state."""

    def innovate(self, prior: Gaussian, measurement: Measurement) -> Innovation:
        """Innovation of a measurement whose residual was formed at the nominal state, against the prior error of mean (n,)."""
        cross = prior.cov @ measurement.jacobian.T
        labels = tuple(f"{kind} {label}" for kind, label in zip(measurement.kinds, measurement.labels, strict=True))
        residual = measurement.residual - measurement.jacobian @ prior.mean
        return Innovation(residual, cross, measurement.jacobian @ cross, measurement.noise, labels)
