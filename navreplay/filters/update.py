"""The measurement epoch: measure, innovate, adapt, judge, condition, retract."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from navreplay.adapt.adapter import adapt_measured
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.filters.core import Gaussian, Innovation, Leftover
from navreplay.filters.presets import Method
from navreplay.filters.record import Recorder
from navreplay.measurements import Measurement
from navreplay.solution import RowStatus
from navreplay.strapdown import Leg, NavState
from navreplay.timeline import Floats, Times

__all__ = ["Aiding", "EpochGate", "Estimator", "Observed", "Updated", "Updater", "Verdict", "tell_inflation"]


class Observed(NamedTuple):
    """measurement: None where the epoch holds none. state and cov (n, n): as given, or with a clock jump absorbed."""

    measurement: Measurement | None
    state: NavState
    cov: Floats


class Updated(NamedTuple):
    """An epoch's outcome: state and cov (n, n), what they were before the measurement (clock jumps and inflation included),
    what became of it, and what was observed."""

    state: NavState
    cov: Floats
    prior_state: NavState
    prior_cov: Floats
    status: RowStatus
    observed: Observed


class Verdict(Protocol):
    """What a gate says of an epoch."""

    @property
    def passed(self) -> np.ndarray:
        """(k,) indices of the components to use."""
        ...

    @property
    def inflation(self) -> float:
        """Factor on the prior covariance, above 1 where the gate had to be reopened."""
        ...

    @property
    def run(self) -> int:
        """Rejected epochs in a row."""
        ...

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdict on them."""
        ...


class EpochGate(Protocol):
    """Judges the innovations of an epoch."""

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        ...


class Aiding(Protocol):
    """Measurements by epoch."""

    @property
    def name(self) -> str:
        """What they are called in messages, in the plural."""
        ...

    @property
    def t_ns(self) -> Times:
        """(e,) times of the epochs."""
        ...

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The measurement with index epoch; dtheta (3,) [rad] and dt [s] are those of the step before it."""
        ...


class Estimator(Protocol):
    """What the epoch loop drives: state and covariance (n, n) go through it, and what else it carries it keeps."""

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov to the nodes of a leg (see `ErrorModel.propagate`)."""
        ...

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Updated:
        """The epoch of that index, from state and cov; dtheta (3,) [rad] and dt [s] are those of the step before it."""
        ...


def tell_inflation(recorder: Recorder, t_ns: int, aiding: Aiding, verdict: Verdict) -> None:
    """Records that a gate was reopened."""
    text = f"{aiding.name} were rejected {verdict.run} epochs in a row; covariance times {verdict.inflation:.1f}"
    recorder.tell(t_ns, "warning", text)


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
            innovation = rule.innovate(adapted, measurement)
        verdict = self._gate.judge(measurement.kinds, innovation, noise)
        if verdict.inflation > 1:
            adapted = Gaussian(self._zero, adapted.cov * verdict.inflation)
            innovation = rule.innovate(adapted, measurement)
            tell_inflation(self._recorder, t_ns, self._aiding, verdict)
            if not len(verdict.passed):
                verdict = self._gate.judge(measurement.kinds, innovation, noise)
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
        return Updated(moved, posterior.cov, state, adapted.cov, RowStatus.UPDATED, observed)

    def _prior_covariance(self, cov: Floats, measurement: Measurement) -> Floats:
        """What an epoch starts from, of the propagated cov (n, n)."""
        return cov

    def _leave(self, t_ns: int, labels: tuple[str, ...], residual: Floats) -> None:
        self._leftover = Leftover(t_ns, dict(zip(labels, residual.tolist(), strict=True)))
