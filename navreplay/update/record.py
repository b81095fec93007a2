"""Collects what happens at measurement epochs, for the report: innovations per kind, and events."""

from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from navreplay.solution import Event, InnovationSeries, WeightSeries
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation

__all__ = ["Judged", "JudgedRows", "Recorder", "step_of"]

_UNITS = {
    "position": "m",
    "velocity": "m/s",
    "range": "m",
    "range_rate": "m/s",
    "attitude": "rad",
    "heading": "rad",
    "standstill": "m/s",
    "zero_rate": "rad/s",
    "no_slip": "m/s",
    "wheel_speed": "m/s",
    "wheel_turn": "rad/s",
    "climb": "m/s",
    "height_hold": "m/s",
}


@dataclass(frozen=True, eq=False, slots=True)
class Judged:
    """One kind's part of an innovation at an epoch: the R used (m, m), its normalised square, and why it was not used (empty:
    it was)."""

    innovation: Innovation
    noise: Floats
    nis: float
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class JudgedRows:
    """One kind's components at an epoch, each judged by itself: labels, residuals, variances of prediction and measurement
    together, of the noise used and of the noise told, reasons, and steps since the epoch before, each (m,)."""

    labels: tuple[str, ...]
    residual: Floats
    variance: Floats
    noise: Floats
    nominal: Floats
    reasons: tuple[str, ...]
    step: Floats


def step_of(innovation: Innovation) -> Floats:
    """(m,) residual less that of the epoch before, NaN where it had none."""
    before = {} if innovation.leftover is None else innovation.leftover.residual
    return np.asarray(innovation.residual - [before.get(label, np.nan) for label in innovation.labels])


@dataclass(slots=True)
class Recorder:
    """Grows while a filter runs."""

    times: dict[str, list[int]] = field(default_factory=dict)
    judged: dict[str, list[Judged]] = field(default_factory=dict)
    rows: dict[str, list[JudgedRows]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    labels: tuple[str, ...] = ()
    weights: list[tuple[int, Floats]] = field(default_factory=list)

    def add(self, t_ns: int, kind: str, judged: Judged) -> None:
        """One kind's innovation at t_ns."""
        self.times.setdefault(kind, []).append(t_ns)
        self.judged.setdefault(kind, []).append(judged)

    def add_rows(self, t_ns: int, kind: str, rows: JudgedRows) -> None:
        """One kind's innovations at t_ns, of components that differ from epoch to epoch."""
        self.times.setdefault(kind, []).append(t_ns)
        self.rows.setdefault(kind, []).append(rows)

    def tell(self, t_ns: int, level: str, text: str, kind: str = "") -> None:
        """An event at t_ns."""
        self.events.append(Event(t_ns, level, text, kind))

    def weigh(self, t_ns: int, labels: tuple[str, ...], weights: Floats) -> None:
        """Weights (M,) of a bank's hypotheses at t_ns, the same labels at every epoch."""
        self.labels = labels
        self.weights.append((t_ns, weights))

    def weight_series(self) -> WeightSeries | None:
        """All weights; None where no bank ran."""
        if not self.weights:
            return None
        t_ns, values = zip(*self.weights, strict=True)
        return WeightSeries(np.array(t_ns, dtype=np.int64), self.labels, np.array(values))

    def series(self) -> tuple[InnovationSeries, ...]:
        """All innovations, a series per kind."""
        return (*(self._series_of(kind) for kind in self.judged), *(self._series_of_rows(kind) for kind in self.rows))

    def _series_of(self, kind: str) -> InnovationSeries:
        rows = self.judged[kind]
        innovations = [row.innovation for row in rows]
        spread = np.array([np.diagonal(innovation.spread) for innovation in innovations])
        noise = np.array([np.diagonal(row.noise) for row in rows])
        return InnovationSeries(
            kind=kind,
            labels=tuple(label.removeprefix(f"{kind} ") for label in innovations[0].labels),
            unit=_UNITS[kind],
            t_ns=np.array(self.times[kind], dtype=np.int64),
            residual=np.array([innovation.residual for innovation in innovations]),
            std=np.sqrt(spread + noise),
            noise_std=np.sqrt(noise),
            nominal_std=np.sqrt(np.array([np.diagonal(innovation.noise) for innovation in innovations])),
            nis=np.array([row.nis for row in rows]),
            used=np.array([not row.reason for row in rows]),
            reason=tuple(row.reason for row in rows),
            step=np.array([step_of(innovation) for innovation in innovations]),
        )

    def _series_of_rows(self, kind: str) -> InnovationSeries:
        epochs = self.rows[kind]
        counts = [len(epoch.labels) for epoch in epochs]
        residual = np.concatenate([epoch.residual for epoch in epochs])
        variance = np.concatenate([epoch.variance for epoch in epochs])
        reasons = tuple(chain.from_iterable(epoch.reasons for epoch in epochs))
        return InnovationSeries(
            kind=kind,
            labels=(kind,),
            unit=_UNITS[kind],
            t_ns=np.repeat(np.array(self.times[kind], dtype=np.int64), counts),
            residual=residual[:, None],
            std=np.sqrt(variance)[:, None],
            noise_std=np.sqrt(np.concatenate([epoch.noise for epoch in epochs]))[:, None],
            nominal_std=np.sqrt(np.concatenate([epoch.nominal for epoch in epochs]))[:, None],
            nis=residual**2 / variance,
            used=np.array([not reason for reason in reasons]),
            reason=reasons,
            sources=tuple(label.removeprefix(f"{kind} ") for epoch in epochs for label in epoch.labels),
            step=np.concatenate([epoch.step for epoch in epochs])[:, None],
        )
