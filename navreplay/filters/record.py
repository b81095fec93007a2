"""Collects what happens at measurement epochs, for the report: innovations per kind, and events."""

from dataclasses import dataclass, field

import numpy as np

from navreplay.filters.core import Innovation
from navreplay.solution import Event, InnovationSeries
from navreplay.timeline import Floats

__all__ = ["Judged", "Recorder"]

_UNITS = {"position": "m", "velocity": "m/s"}


@dataclass(frozen=True, eq=False, slots=True)
class Judged:
    """One kind's part of an innovation at an epoch: the R used (m, m), its normalised square, and why it was not used (empty:
    it was)."""

    innovation: Innovation
    noise: Floats
    nis: float
    reason: str


@dataclass(slots=True)
class Recorder:
    """Grows while a filter runs."""

    times: dict[str, list[int]] = field(default_factory=dict)
    judged: dict[str, list[Judged]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    def add(self, t_ns: int, kind: str, judged: Judged) -> None:
        """One kind's innovation at t_ns."""
        self.times.setdefault(kind, []).append(t_ns)
        self.judged.setdefault(kind, []).append(judged)

    def tell(self, t_ns: int, level: str, text: str) -> None:
        """An event at t_ns."""
        self.events.append(Event(t_ns, level, text))

    def series(self) -> tuple[InnovationSeries, ...]:
        """All innovations, a series per kind."""
        return tuple(self._series_of(kind) for kind in self.judged)

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
        )
