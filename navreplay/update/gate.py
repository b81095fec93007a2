"""Innovation gate: each kind of an epoch's measurement is tested by itself, and one shut out too long is let in again.

A kind that fails says nothing against another of the same epoch, and one that passes nothing for another. Epochs that
contradict the filter in a row are at first taken for faults. After `reset_after` of them, and 10 s where the filter had agreed
with the kind before, they are evidence against the filter.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from navreplay.options import GateOptions
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation, chi_square
from navreplay.update.record import Judged, Recorder
from navreplay.update.reopening import Widening

__all__ = ["Gate", "Verdict"]

_PATIENCE_NS = 10_000_000_000
"""How long a filter that has agreed with a kind is believed against it: what an inertial filter bridges well by itself."""


class Verdict(NamedTuple):
    """passed (k,): indices of the components to use. nis: normalised square per kind. reasons: per kind, empty where used.
    widenings: of the kinds that were shut out too long, which pass with them."""

    passed: np.ndarray
    nis: dict[str, float]
    reasons: dict[str, str]
    widenings: tuple[Widening, ...]

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts each kind's components into the record with the verdict on them."""
        for kind, rows in _rows_of(kinds).items():
            part = innovation.select(rows)
            recorder.add(t_ns, kind, Judged(part, noise[rows[:, None], rows], self.nis[kind], self.reasons[kind]))


@cache
def _rows_of(kinds: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {kind: np.array([i for i, k in enumerate(kinds) if k == kind]) for kind in dict.fromkeys(kinds)}


class _Run(NamedTuple):
    """agreed: epochs of a kind that passed since the last reopening. epochs that failed in a row since start_ns."""

    agreed: int = 0
    epochs: int = 0
    start_ns: int = 0


class Gate:
    """Chi-square gate with a count, by kind, of the epochs rejected in a row."""

    def __init__(self, options: GateOptions) -> None:
        self._options = options
        self._runs: dict[str, _Run] = {}

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        rows = _rows_of(kinds)
        nis = {kind: self._square(innovation, noise, at) for kind, at in rows.items()}
        limit = {kind: self._limit(len(at)) for kind, at in rows.items()}
        failed = [kind for kind in rows if not nis[kind] <= limit[kind]]
        reopened = [kind for kind in rows if self._count(kind, kind in failed, innovation.t_ns)]
        widenings = tuple(self._widen(kind, innovation.residual[rows[kind]], innovation.t_ns) for kind in reopened)
        failed = [kind for kind in failed if kind not in reopened]
        reasons = {
            kind: f"innovation {nis[kind]:.1f} beyond the gate of {limit[kind]:.1f}" if kind in failed else "" for kind in rows
        }
        passed = np.array([i for i, kind in enumerate(kinds) if kind not in failed], dtype=np.intp)
        return Verdict(passed, nis, reasons, widenings)

    def _count(self, kind: str, failed: bool, t_ns: int) -> bool:
        """Counts an epoch of a kind; whether the kind has been shut out too long."""
        run = self._runs.get(kind, _Run())
        if not failed:
            # behind a long run of failures agreement begins anew: the last ones may have been right
            self._runs[kind] = _Run(1 if run.epochs >= self._options.reset_after > 0 else run.agreed + 1)
            return False
        run = run._replace(epochs=run.epochs + 1, start_ns=run.start_ns if run.epochs else t_ns)
        self._runs[kind] = run
        after = self._options.reset_after
        patient = run.agreed >= after and t_ns - run.start_ns < _PATIENCE_NS
        return 0 < after <= run.epochs and not patient

    def _widen(self, kind: str, residual: Floats, t_ns: int) -> Widening:
        run = self._runs[kind]
        self._runs[kind] = _Run()
        return Widening(kind, float(residual @ residual), run.epochs, (t_ns - run.start_ns) / 1e9)

    def _limit(self, size: int) -> float:
        return float(chdtri(size, 1 - self._options.probability)) if self._options.probability < 1 else float("inf")

    @staticmethod
    def _square(innovation: Innovation, noise: Floats, rows: np.ndarray) -> float:
        square = rows[:, None], rows
        return chi_square(innovation.residual[rows], innovation.spread[square] + noise[square])
