"""Consider parameters: biases that a filter reckons with and does not estimate (Schmidt-Kalman filter).

Source: Schmidt, Application of state-space methods to navigation problems, Advances in Control Systems 3 (1966) 293; Lou et
al., IEEE Access 7 (2019), eqs. (21)-(31), (52)-(60). The filter runs on states and biases (`ConsideredModel`) with a gain whose
rows of the biases are zero, so that P_pp stays and the rest follows from the Joseph form, which at that gain equals (57)-(60).
Eq. (24), whose lower left block is that of an optimal gain, is not used.
Assumes: biases are constant over the log, independent of each other, of the told covariance, and in the fix that a filter
starts from as in all others.
Fails: a bias that could be estimated is left in the solution; biases told too large make the filter lean on the IMU.
When well specified: mean NEES per state 0.85 to 1.15, NIS per component 0.9 to 1.1 (psteckf: see the tracking's file).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from navreplay.adapt.inflation.partial_tracking import PartialTracking
from navreplay.aiding.epochs import Aiding, Observed
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.considered import ConsideredModel
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.filters.bank import Bank
from navreplay.filters.presets import Method
from navreplay.filters.update import Estimator, Updater
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.moments.linearised import Linearised
from navreplay.options import FilterOptions
from navreplay.timeline import Floats, LogError, Times
from navreplay.update.adapter import is_measured
from navreplay.update.gaussian import Gaussian, Innovation, condition, kalman_gain
from navreplay.update.measurement import Measurement
from navreplay.update.record import Recorder
from navreplay.update.verdict import EpochGate

__all__ = ["ConsideredAiding", "PartialTracker", "Schmidt", "Setup", "check_considers", "set_up"]


@dataclass(frozen=True, eq=False, slots=True)
class Schmidt(Linearised):
    """A rule that is of first order at the measurement, with a gain of zero for the states behind the first `estimated`, whose
    variances stay told (p,)."""

    rule: Linearised
    estimated: int
    told: Floats

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n + p, n + p) to the nodes of a leg, by the rule within."""
        return self.rule.propagate(model, state, cov, leg)

    def condition(self, prior: Gaussian, innovation: Innovation, noise: Floats) -> Gaussian:
        """Posterior with R = noise (m, m); where the prior was inflated, biases get their told variance back and keep their
        correlations."""
        gain = kalman_gain(innovation, noise)
        gain[self.estimated :] = 0
        posterior = condition(prior, innovation, noise, gain)
        variance = np.diagonal(posterior.cov)[self.estimated :]
        if not (variance == self.told).all():
            back = np.append(np.ones(self.estimated), np.sqrt(self.told / variance))
            posterior = posterior._replace(cov=posterior.cov * back * back[:, None])
        return self.rule.settle(posterior)


class ConsideredAiding:
    """The measurements of inner, with their Jacobian against biases."""

    def __init__(self, inner: Aiding, model: ConsideredModel) -> None:
        self._inner = inner
        self._model = model

    @property
    def name(self) -> str:
        """What they are called in messages, in the plural."""
        return self._inner.name

    @property
    def t_ns(self) -> Times:
        """(e,) times of the epochs."""
        return self._inner.t_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The measurement with index epoch, with Jacobian (m, n + p); cov (n + p, n + p)."""
        n = self._model.inner.size
        measurement, state, own = self._inner.observe(epoch, state, cov[:n, :n], dtheta, dt)
        cov = cov.copy()
        cov[:n, :n] = own
        if measurement is None:
            return Observed(None, state, cov)
        jacobian = np.hstack([measurement.jacobian, self._model.influence(measurement)])
        return Observed(measurement._replace(jacobian=jacobian), state, cov)


class PartialTracker(Updater):
    """The single filter with partially strong tracking; it gathers the Q of the interval between epochs with a measurement."""

    def __init__(
        self,
        aiding: Aiding,
        gate: EpochGate,
        model: ConsideredModel,
        method: Method,
        recorder: Recorder,
        tracking: PartialTracking,
    ) -> None:
        super().__init__(aiding, gate, model, method, recorder)
        self._tracking = tracking
        self._tracked = tracking.init()
        self._process = np.zeros((model.inner.size, model.inner.size))

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n + p, n + p) to the nodes of a leg, by the moment rule."""
        moved = super().propagate(state, cov, leg.keeping())
        n = len(self._process)
        for transition, noise in zip(moved.transitions[:, :n, :n], moved.noises[:, :n, :n], strict=True):
            self._process = transition @ self._process @ transition.T + noise
        return moved

    def _prior_covariance(self, cov: Floats, measurement: Measurement) -> Floats:
        measured = is_measured(measurement.kinds)
        if not measured.any():
            return cov
        if not measured.all():
            measurement = measurement.select(np.flatnonzero(measured))
        inflated, self._tracked = self._tracking.inflate(self._tracked, cov, self._process, measurement)
        self._process = np.zeros_like(self._process)
        return inflated


class Setup(NamedTuple):
    """What the epoch loop drives: aiding, error model and method, with biases behind the states or without."""

    aiding: Aiding
    model: ErrorModel
    method: Method

    def start_covariance(self, cov: Floats) -> Floats:
        """Of the model's states, where those that aiding starts from have covariance cov (n, n)."""
        return self.model.start_covariance(cov) if isinstance(self.model, ConsideredModel) else cov

    def estimator(self, gate: EpochGate, recorder: Recorder) -> Estimator:
        """A filter at the start of a stretch."""
        if self.method.weighting is not None:
            estimated = self.model.inner.size if isinstance(self.model, ConsideredModel) else self.model.size
            return Bank(self.aiding, gate, self.model, self.method, self.method.weighting, recorder, estimated)
        tracking = self.method.tracking
        if tracking is None or not isinstance(self.model, ConsideredModel):
            return Updater(self.aiding, gate, self.model, self.method, recorder)
        return PartialTracker(self.aiding, gate, self.model, self.method, recorder, tracking)


def check_considers(method: Method, options: FilterOptions) -> None:
    """Raises LogError where consider parameters are asked for and cannot be combined with the method."""
    if not (method.considers or options.consider.every_method is True):
        return
    if not _can_consider(method):
        raise LogError(
            f"filter: consider parameters need linearised filters, which '{method.name}' is not; set "
            "consider.every_method = false, or take 'eckf'"
        )


def _can_consider(method: Method) -> bool:
    return isinstance(method.rule, Linearised)


def set_up(aiding: Aiding, model: ErrorModel, method: Method, options: FilterOptions) -> Setup:
    """What to run a method with on aiding and its error model; with consider parameters where method or options have them,
    as `check_considers` allows."""
    asked = options.consider.every_method
    if asked == "ranges":
        asked = isinstance(model, ClockedModel) and _can_consider(method)
    if not (method.considers or asked):
        return Setup(aiding, model, method)
    assert isinstance(method.rule, Linearised)  # as `check_considers` holds
    considered = ConsideredModel.of(model, options.consider)
    rule = Schmidt(method.rule, model.size, np.diagonal(considered.bias_cov))
    return Setup(ConsideredAiding(aiding, considered), considered, replace(method, rule=rule))
