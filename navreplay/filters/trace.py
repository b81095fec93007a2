"""An estimator that keeps what it linearises, so that noise can be estimated from the whole log."""

from dataclasses import dataclass, field

import numpy as np

from navreplay.calibration.linear_log import LinearLog
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.error_models.noise_sources import without_sources
from navreplay.filters.update import Estimator, Updated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.timeline import Floats, Times
from navreplay.update.measurement import Measurement

__all__ = ["Tracer", "Traces"]


@dataclass(slots=True)
class Tracer:
    """Drives another estimator from epoch to epoch, without rows in between, and takes down each epoch. muted: by source whose
    process noise is kept apart, the model without it."""

    inner: Estimator
    model: ErrorModel
    t_ns: Times
    muted: dict[str, ErrorModel]
    start_ns: int = 0
    start: Floats | None = None
    moved: list[tuple[Floats, Floats, dict[str, Floats]]] = field(default_factory=list)
    corrections: list[Floats] = field(default_factory=list)
    epochs: list[int] = field(default_factory=list)
    measurements: list[Measurement | None] = field(default_factory=list)

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """As the estimator does; the last epoch's transition and noise, the share of each source apart."""
        if self.start is None:
            self.start_ns, self.start = leg.steps.start_ns, cov
        moved = self.inner.propagate(state, cov, leg.keeping())
        total = moved.noises[-1]
        sources = {}
        for name, model in self.muted.items():
            sources[name] = total - model.propagate(state, cov, leg.keeping()).noises[-1]
        self.moved.append((moved.transitions[-1], total - sum(sources.values()), sources))
        return moved

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Updated:
        """As the estimator does; its measurement and correction, and what a clock's jump added to the covariance."""
        updated = self.inner.update(epoch, state, cov, dtheta, dt)
        observed = updated.observed
        transition, rest, sources = self.moved[-1]
        self.moved[-1] = transition, rest + (observed.cov - cov), sources
        self.corrections.append(self.model.difference(updated.state, observed.state))
        self.measurements.append(observed.measurement)
        self.epochs.append(epoch)
        return updated

    def linear_log(self) -> LinearLog | None:
        """The epochs so far; None without a measurement."""
        known = [z for z in self.measurements if z is not None]
        if not known or self.start is None:
            return None
        k, m = len(self.epochs), max(len(z.residual) for z in known)
        told, counts = np.zeros((k, m, m)), np.zeros(k, dtype=np.int64)
        for i, z in enumerate(self.measurements):
            if z is not None:
                counts[i] = len(z.residual)
                told[i, : counts[i], : counts[i]] = z.noise
        moved = self.moved[:k]
        return LinearLog(
            start_ns=self.start_ns,
            start=self.start,
            t_ns=self.t_ns[self.epochs],
            transitions=np.array([transition for transition, _, _ in moved]),
            rest=np.array([rest for _, rest, _ in moved]),
            sources={name: np.array([sources[name] for _, _, sources in moved]) for name in moved[0][2]},
            corrections=np.array(self.corrections),
            starts=np.concatenate([[0], np.cumsum(counts)]),
            residual=np.concatenate([z.residual for z in known]),
            jacobian=np.concatenate([z.jacobian for z in known]),
            told=told,
            labels=tuple(f"{kind} {label}" for z in known for kind, label in zip(z.kinds, z.labels, strict=True)),
            kinds=tuple(kind for z in known for kind in z.kinds),
        )


@dataclass(slots=True)
class Traces:
    """Tracers of the stretches of a log. sources: whose process noise is kept apart."""

    sources: tuple[str, ...]
    tracers: list[Tracer] = field(default_factory=list)

    def follow(self, estimator: Estimator, model: ErrorModel, t_ns: Times) -> Tracer:
        """An estimator that takes down another one with that model and epochs t_ns (e,)."""
        muted = {name: without for name, without in without_sources(model).items() if name in self.sources}
        self.tracers.append(Tracer(estimator, model, t_ns, muted))
        return self.tracers[-1]

    def linear_logs(self) -> tuple[LinearLog, ...]:
        """Those of the stretches with a measurement."""
        return tuple(log for log in (tracer.linear_log() for tracer in self.tracers) if log is not None)
