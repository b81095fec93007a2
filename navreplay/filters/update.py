"""The measurement epoch: measure, innovate, adapt, judge, condition, retract."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from navreplay.aiding.epochs import Aiding, Observed
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.filters.presets import Method
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.solution import RowStatus
from navreplay.timeline import Floats
from navreplay.update.adapter import adapt_measured
from navreplay.update.gaussian import Gaussian, Leftover
from navreplay.update.measurement import Measurement
from navreplay.update.record import Recorder
from navreplay.update.reopening import LossWatch, tell_widening, widen
from navreplay.update.verdict import EpochGate

__all__ = ["Estimator", "Updated", "Updater"]


class Updated(NamedTuple):
    """An epoch's outcome: state and cov (n, n), what they were before the measurement (clock jumps and inflation included),
    what became of it, and what was observed. lost: the filter has lost its way."""

    state: NavState
    cov: Floats
    prior_state: NavState
    prior_cov: Floats
    status: RowStatus
    observed: Observed
    lost: bool = False


class Estimator(Protocol):
    """What the epoch loop drives: state and covariance (n, n) go through it, and what else it carries it keeps."""

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov to the nodes of a leg (see `ErrorModel.propagate`)."""
        ...

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Updated:
        """The epoch of that index, from state and cov; dtheta (3,) [rad] and dt [s] are those of the step before it."""
        ...


class Updater:
    """The single filter, with one kind of aiding. Keeps the state of the adapter, the gate, and the record."""

    def __init__(self, aiding: Aiding, gate: EpochGate, model: ErrorModel, method: Method, recorder: Recorder) -> None:
        self._aiding = aiding
        self._gate = gate
        self._model = model
        self._method = method
        self._recorder = recorder
        self._adapter_state: Any = method.adapter.init()
        self._leftover: Leftover | None = None
        self._zero = np.zeros(model.size)
        self._watch = LossWatch()

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg, by the moment rule."""
        return self._method.rule.propagate(self._model, state, cov, leg)

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Updated:
        """The epoch of that index, from state and cov (n, n); dtheta (3,) [rad] and dt [s] are those of the step before it."""
        observed = self._aiding.observe(epoch, state, cov, dtheta, dt)
        measurement, state, cov = observed
        if measurement is None:
            return Updated(state, cov, state, cov, RowStatus.PREDICTED, observed)
        t_ns = int(self._aiding.t_ns[epoch])
        rule, adapter = self._method.rule, self._method.adapter
        prior = Gaussian(self._zero, self._prior_covariance(cov, measurement))
        innovation = rule.innovate(prior, measurement)._replace(t_ns=t_ns, leftover=self._leftover)
        labels = innovation.labels
        adapted, noise, self._adapter_state = adapt_measured(adapter, self._adapter_state, prior, innovation)
        if adapted is not prior:
            innovation = rule.innovate(adapted, measurement)._replace(t_ns=t_ns)
        verdict = self._gate.judge(measurement.kinds, innovation, noise)
        if verdict.widenings:
            adapted = Gaussian(self._zero, widen(adapted.cov, self._model.names, verdict.widenings))
            innovation = rule.innovate(adapted, measurement)._replace(t_ns=t_ns)
            for widening in verdict.widenings:
                tell_widening(self._recorder, t_ns, widening)
            if not len(verdict.passed):
                verdict = self._gate.judge(measurement.kinds, innovation, noise)
        lost = self._watch.lost(t_ns, verdict.widenings)
        verdict.record(self._recorder, t_ns, measurement.kinds, innovation, noise)
        if not len(verdict.passed):
            self._leave(t_ns, labels, measurement.residual)
            return Updated(state, cov, state, cov, RowStatus.REJECTED, observed)
        if len(verdict.passed) < len(noise):
            innovation = innovation.select(verdict.passed)
            noise = noise[verdict.passed[:, None], verdict.passed]
        posterior = rule.condition(adapted, innovation, noise)
        self._leave(t_ns, labels, measurement.residual - measurement.jacobian @ posterior.mean)
        moved = self._model.retract(state, posterior.mean)
        return Updated(moved, posterior.cov, state, adapted.cov, RowStatus.UPDATED, observed, lost)

    def _prior_covariance(self, cov: Floats, measurement: Measurement) -> Floats:
        """What an epoch starts from, of the propagated cov (n, n)."""
        return cov

    def _leave(self, t_ns: int, labels: tuple[str, ...], residual: Floats) -> None:
        self._leftover = Leftover(t_ns, dict(zip(labels, residual.tolist(), strict=True)))
