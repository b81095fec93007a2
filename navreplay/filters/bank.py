"""A bank of filters that differ in the scale of Q or R and share one mechanisation: multiple-model adaptive estimation.

Source: Magill, IEEE Trans. Automatic Control 10 (1965) 434; Si, Wang and Niu, High precision attitude estimation algorithm for
SINS/CNS integrated navigation with unknown noise characteristics, eqs. (8)-(18). Each hypothesis has an error mean d_j and a
covariance P_j about the one nominal state, moved by the one Phi and Q of the mechanisation:
    d_j <- Phi d_j ;  P_j <- Phi P_j Phi' + theta_j Q ;  output P = sum w_j (P_j + (d_j - d) (d_j - d)'),  d = sum w_j d_j
After an epoch d moves into the nominal and is subtracted from every d_j; their differences and the P_j stay. Between epochs
d = 0 and P <- Phi P Phi' + (sum w_j theta_j) Q, which needs no hypothesis.
Assumes: hypotheses stay close enough to the nominal for one Phi, which holds wherever the single filter's linearisation does.
What must hold of the weights, and when they fail: `navreplay.filters.weights`.
"""

from typing import Any, NamedTuple

import numpy as np

from navreplay.adapt.fixed import Fixed
from navreplay.aiding.epochs import Aiding
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.filters import _bank_kernel
from navreplay.filters.presets import Method
from navreplay.filters.update import Updated
from navreplay.filters.weights import Mmae
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.solution import RowStatus
from navreplay.timeline import Floats, LogError
from navreplay.update.adapter import adapt_measured, is_measured
from navreplay.update.gaussian import Gaussian, Leftover, symmetric
from navreplay.update.measurement import Measurement
from navreplay.update.record import Recorder
from navreplay.update.reopening import LossWatch, tell_widening, widen
from navreplay.update.verdict import EpochGate

__all__ = ["Bank", "Stack", "Update", "interact", "mix", "move_stack", "update_stack"]

_LEADS = 0.9
"""Weight above which a hypothesis is told to lead."""


class Stack(NamedTuple):
    """means (M, n) and covs (M, n, n) of the hypotheses' errors about the common nominal state."""

    means: Floats
    covs: Floats


class Update(NamedTuple):
    """The hypotheses after a measurement, and its log_likelihood (M,) under each, but for a constant."""

    stack: Stack
    log_likelihood: Floats


def mix(stack: Stack, weights: Floats) -> Gaussian:
    """Moments of the mixture with weights (M,): Si et al., eqs. (17)-(18)."""
    mean = weights @ stack.means
    apart = stack.means - mean
    return Gaussian(mean, _average(weights, stack.covs) + (weights * apart.T) @ apart)


def _average(weights: Floats, matrices: Floats) -> Floats:
    """(a, b) average of matrices (M, a, b) with weights (M,); tensordot would take three times as long."""
    return np.asarray((weights @ matrices.reshape(len(weights), -1)).reshape(matrices.shape[1:]))


def interact(stack: Stack, weights: Floats, transitions: Floats) -> tuple[Stack, Floats]:
    """The hypotheses and their weights (M,) where the right one changes with probabilities transitions (M, M), row to column:
    each goes on from the mixture of those that it may have followed, weighted by how likely it followed each (Blom and
    Bar-Shalom 1988, eqs. 3.2 to 3.5). The moments of the mixture over all stay what they are."""
    joint = weights[:, None] * transitions
    follows = joint.sum(axis=0)
    parts = [mix(stack, joint[:, j] / follows[j]) for j in range(len(follows))]
    return Stack(np.array([part.mean for part in parts]), np.array([part.cov for part in parts])), follows


def move_stack(stack: Stack, moved: Propagated, q_scales: Floats, weights: Floats) -> Stack:
    """The hypotheses behind the last node of moved, each with its own multiple q_scales (M,) of the noise. The covariances of
    moved, which is the mixture's with told noise, become those of the mixture with weights (M,)."""
    means, covs = stack.means.copy(), stack.covs.copy()
    beyond_told = float(weights @ q_scales) - 1
    _bank_kernel.carry(moved.transitions, moved.noises, q_scales, beyond_told, moved.covariances, means, covs)
    return Stack(means, covs)


def update_stack(prior: Stack, residual: Floats, jacobian: Floats, noises: Floats, estimated: int) -> Update:
    """Every hypothesis given residual (m,) = H x + v against the nominal, jacobian H (m, n), by its own R of noises (M, m, m).

    With S = L L' and W = L^-1 H P the posterior P - W' W is that of the Joseph form (11) at the optimal gain, symmetric as it
    stands; likelihood (14). States behind the first `estimated` are biases that a Schmidt-Kalman filter considers: a gain of
    zero for them leaves P_pp, and what is above for all else. Raises LogError where an S is not positive definite.
    """
    means, covs, log_likelihood = prior.means.copy(), prior.covs.copy(), np.empty(len(noises))
    if not _bank_kernel.update(residual, jacobian, noises, estimated, means, covs, log_likelihood):
        raise LogError(
            "filter: the covariance of an innovation is not positive definite; are the scales of the bank plausible?"
        )
    return Update(Stack(means, covs), log_likelihood)


class Bank:
    """The estimator of a bank, with one kind of aiding. Keeps hypotheses, their adapters, the weights, and the record."""

    def __init__(
        self,
        aiding: Aiding,
        gate: EpochGate,
        model: ErrorModel,
        method: Method,
        weighting: Mmae,
        recorder: Recorder,
        estimated: int,
    ) -> None:
        """estimated: so many states of the model, from the first on, are estimated; those behind them are considered."""
        self._aiding = aiding
        self._gate = gate
        self._model = model
        self._method = method
        self._weighting = weighting
        self._recorder = recorder
        self._estimated = estimated
        self._q_scales, self._r_scales = np.array(weighting.hypotheses()).T
        self._labels = weighting.labels()
        size = len(self._labels)
        self._adapter_states: list[Any] = [method.adapter.init() for _ in range(size)]
        self._leftovers: list[Leftover | None] = [None] * size
        self._stack = Stack(np.zeros((size, model.size)), np.zeros((size, model.size, model.size)))
        self._weights = weighting.start(0)
        self._mixed: Floats | None = None
        self._leader = ""
        self._last_ns: int | None = None
        self._zero = np.zeros(model.size)
        self._watch = LossWatch()

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and the mixture's cov (n, n) to the nodes of a leg, where covariances are the mixture's."""
        self._share(cov)
        moved = self._model.propagate(state, cov, leg.keeping())
        self._stack = move_stack(self._stack, moved, self._q_scales, self._weights.values)
        return moved

    def _share(self, cov: Floats) -> None:
        """What cov (n, n) holds beyond the mixture belongs to every hypothesis: the start, a clock jump, what a model sets."""
        if cov is not self._mixed:
            self._stack = self._stack._replace(covs=self._stack.covs + (cov - mix(self._stack, self._weights.values).cov))
            self._mixed = cov

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Updated:
        """The epoch of that index, from state and the mixture's cov (n, n); dtheta (3,) [rad] and dt [s] are those of the step
        before it."""
        observed = self._aiding.observe(epoch, state, cov, dtheta, dt)
        measurement, state, cov = observed
        self._share(cov)
        if measurement is None:
            return Updated(state, cov, state, cov, RowStatus.PREDICTED, observed)
        t_ns = int(self._aiding.t_ns[epoch])
        prior, noises = self._adapt(t_ns, measurement)
        mixture = Gaussian(self._zero, cov) if prior is self._stack else mix(prior, self._weights.values)
        noise = _average(self._weights.values, noises)
        innovation = self._method.rule.innovate(mixture, measurement)._replace(t_ns=t_ns)
        verdict = self._gate.judge(measurement.kinds, innovation, noise)
        if verdict.widenings:
            prior = prior._replace(covs=widen(prior.covs, self._model.names, verdict.widenings))
            mixture = mix(prior, self._weights.values)
            innovation = self._method.rule.innovate(mixture, measurement)._replace(t_ns=t_ns)
            for widening in verdict.widenings:
                tell_widening(self._recorder, t_ns, widening)
            if not len(verdict.passed):
                verdict = self._gate.judge(measurement.kinds, innovation, noise)
        lost = self._watch.lost(t_ns, verdict.widenings)
        verdict.record(self._recorder, t_ns, measurement.kinds, innovation, noise)
        if not len(verdict.passed):
            self._leave(t_ns, innovation.labels, measurement, self._stack.means)
            return Updated(state, cov, state, cov, RowStatus.REJECTED, observed)
        stack = self._condition(t_ns, prior, measurement, noises, verdict.passed)
        self._leave(t_ns, innovation.labels, measurement, stack.means)
        posterior = mix(stack, self._weights.values)
        self._stack = stack._replace(means=stack.means - posterior.mean)
        self._interact(t_ns)
        moved = self._model.retract(state, posterior.mean)
        self._mixed = symmetric(posterior.cov)
        return Updated(moved, self._mixed, state, mixture.cov, RowStatus.UPDATED, observed, lost)

    def _interact(self, t_ns: int) -> None:
        """What may have changed in the interval between the epoch before and that at t_ns; likewise in the one to come."""
        before, self._last_ns = self._last_ns, t_ns
        transitions = None if before is None else self._weighting.transitions((t_ns - before) / 1e9)
        if transitions is not None:
            self._stack, follows = interact(self._stack, self._weights.values, transitions)
            self._weights = self._weights._replace(logs=np.log(follows))

    def _condition(self, t_ns: int, prior: Stack, measurement: Measurement, noises: Floats, passed: np.ndarray) -> Stack:
        """The hypotheses given the components with index passed (k,), and weighed by those of them that a sensor has measured:
        standstill says nothing of the noise in motion."""
        stack, measured = prior, is_measured([measurement.kinds[i] for i in passed])
        for rows, weighs in ((passed[measured], True), (passed[~measured], False)):
            if len(rows):
                part = measurement.residual[rows], measurement.jacobian[rows], noises[:, rows[:, None], rows]
                stack, log_likelihood = update_stack(stack, *part, self._estimated)
                if weighs:
                    self._weigh(t_ns, log_likelihood)
        return stack

    def _adapt(self, t_ns: int, measurement: Measurement) -> tuple[Stack, Floats]:
        """Prior and R (M, m, m) that the hypotheses' adapters choose; the stack itself where nothing can be chosen."""
        rule, adapter = self._method.rule, self._method.adapter
        if isinstance(adapter, Fixed):
            return self._stack, self._scale(measurement)
        priors, noises = [], []
        scaled = self._scale(measurement)
        for j, prior in enumerate(map(Gaussian, *self._stack)):
            told = measurement._replace(noise=scaled[j])
            innovation = rule.innovate(prior, told)._replace(t_ns=t_ns, leftover=self._leftovers[j])
            adapted, noise, self._adapter_states[j] = adapt_measured(adapter, self._adapter_states[j], prior, innovation)
            priors.append(adapted)
            noises.append(noise)
        return Stack(np.array([p.mean for p in priors]), np.array([p.cov for p in priors])), np.array(noises)

    def _scale(self, measurement: Measurement) -> Floats:
        """(M, m, m) the told R of each hypothesis; that of standstill is not scaled."""
        roots = np.where(is_measured(measurement.kinds), np.sqrt(self._r_scales)[:, None], 1.0)
        return np.asarray(measurement.noise * roots[:, :, None] * roots[:, None, :])

    def _weigh(self, t_ns: int, log_likelihood: Floats) -> None:
        self._weights = self._weighting.weigh(self._weights, t_ns, log_likelihood)
        values = self._weights.values
        self._recorder.weigh(t_ns, self._labels, values)
        if self._weights.restarted:
            self._recorder.tell(t_ns, "info", f"the bank doubts {self._leader or 'its leader'}: all weights are even again")
            self._leader = ""
        leader = self._labels[int(values.argmax())]
        if leader != self._leader and values.max() > _LEADS:
            self._recorder.tell(t_ns, "info", f"the bank follows {leader}, whose weight exceeds {_LEADS:g}")
            self._leader = leader

    def _leave(self, t_ns: int, labels: tuple[str, ...], measurement: Measurement, means: Floats) -> None:
        """Keeps what the epoch's measurement was off from each hypothesis, whose errors have means (M, n)."""
        residuals = measurement.residual - means @ measurement.jacobian.T
        self._leftovers = [Leftover(t_ns, dict(zip(labels, row, strict=True))) for row in residuals.tolist()]
