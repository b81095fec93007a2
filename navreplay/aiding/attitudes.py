"""Aiding by measured attitudes: of a star tracker, an AHRS, or the heading of two antennas."""

from navreplay.aiding.epochs import Observed
from navreplay.error_models.error_model import ErrorModel
from navreplay.measurements.attitudes import attitude_measurement, attitude_noise, heading_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import AttitudeOptions, GateOptions
from navreplay.timeline import AttitudeSeries, Floats, Times
from navreplay.update.gate import Gate
from navreplay.update.verdict import EpochGate

__all__ = ["AttitudeAiding"]


class AttitudeAiding:
    """Attitudes with their told noise, for any error model."""

    name = "attitudes"
    kinds = frozenset({"attitude", "heading"})

    def __init__(self, attitude: AttitudeSeries, model: ErrorModel, options: AttitudeOptions) -> None:
        self.model = model
        self._attitude = attitude
        self._noise = attitude_noise(attitude, options)
        self._measure = heading_measurement if attitude.heading_only else attitude_measurement

    @property
    def t_ns(self) -> Times:
        """(e,) times of the attitudes."""
        return self._attitude.t_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The attitude with index epoch."""
        return Observed(self._measure(state, self._attitude, epoch, self._noise[epoch], self.model.size), state, cov)

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate of its own, with nothing counted yet."""
        return Gate(options)
