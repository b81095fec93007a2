"""Several sensors that aid one filter: their epochs joined, each judged by a gate of its own."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from navreplay.aiding.epochs import Aiding, Observed
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats, Times
from navreplay.update.gaussian import Innovation
from navreplay.update.measurement import join
from navreplay.update.record import Recorder
from navreplay.update.reopening import Widening
from navreplay.update.verdict import EpochGate, Verdict

__all__ = ["JointAiding", "JointGate", "JointVerdict"]


class JointAiding:
    """Epochs of one or the other sensor, and of several where they share a time."""

    def __init__(self, parts: Sequence[Aiding]) -> None:
        self.name = " and ".join(part.name for part in parts)
        self._parts = tuple(parts)
        self._t_ns = np.unique(np.concatenate([part.t_ns for part in parts]))
        self._epochs = tuple(_epochs_at(self._t_ns, part.t_ns) for part in parts)

    @property
    def t_ns(self) -> Times:
        """(e,) times of all epochs."""
        return self._t_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """What there is at the epoch with that index, in the order of the parts."""
        measured = []
        for part, epochs in zip(self._parts, self._epochs, strict=True):
            own = int(epochs[epoch])
            if own >= 0:
                measurement, state, cov = part.observe(own, state, cov, dtheta, dt)
                measured += [] if measurement is None else [measurement]
        return Observed(join(measured) if measured else None, state, cov)


def _epochs_at(t_ns: Times, own_ns: Times) -> np.ndarray:
    """(e,) index into own_ns (k,) of each of the times t_ns (e,), -1 where it is none of them."""
    epochs = np.full(len(t_ns), -1)
    epochs[np.searchsorted(t_ns, own_ns)] = np.arange(len(own_ns))
    return epochs


class JointVerdict(NamedTuple):
    """The verdicts of the gates on their parts of an epoch, with the index of each part's components."""

    verdicts: tuple[Verdict, ...]
    rows: tuple[np.ndarray, ...]

    @property
    def passed(self) -> np.ndarray:
        """(k,) indices of the components to use."""
        return np.concatenate([rows[verdict.passed] for verdict, rows in zip(self.verdicts, self.rows, strict=True)])

    @property
    def widenings(self) -> tuple[Widening, ...]:
        """Those of all parts."""
        return tuple(widening for verdict in self.verdicts for widening in verdict.widenings)

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdicts on them."""
        for verdict, rows in zip(self.verdicts, self.rows, strict=True):
            own = tuple(kinds[i] for i in rows)
            verdict.record(recorder, t_ns, own, innovation.select(rows), noise[rows[:, None], rows])


class JointGate:
    """Judges each sensor by a gate of its own, so that one's failure does not count for the other: main for all kinds but
    those of the others."""

    def __init__(self, main: EpochGate, others: Sequence[tuple[frozenset[str], EpochGate]]) -> None:
        self._gates = (main, *(gate for _, gate in others))
        self._others = tuple(kinds for kinds, _ in others)

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> JointVerdict:
        """The verdicts on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        owners = np.array([self._owner(kind) for kind in kinds])
        verdicts, parts = [], []
        for index, gate in enumerate(self._gates):
            rows = np.flatnonzero(owners == index)
            if len(rows):
                own = tuple(kinds[i] for i in rows)
                verdicts.append(gate.judge(own, innovation.select(rows), noise[rows[:, None], rows]))
                parts.append(rows)
        return JointVerdict(tuple(verdicts), tuple(parts))

    def _owner(self, kind: str) -> int:
        """Index of the gate that judges a kind."""
        return next((index for index, kinds in enumerate(self._others, start=1) if kind in kinds), 0)
