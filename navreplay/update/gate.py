"""Innovation gate: each kind of an epoch's measurement is tested by itself, and a filter shut out too long is reopened."""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from navreplay.options import GateOptions
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation, chi_square
from navreplay.update.record import Judged, Recorder

__all__ = ["Gate", "Verdict"]


class Verdict(NamedTuple):
    """passed (k,): indices of the components to use. nis: normalised square per kind. reasons: per kind, empty where used.
    inflation: factor on the prior covariance, above 1 where the gate had to be reopened after `run` rejected epochs."""

    passed: np.ndarray
    nis: dict[str, float]
    reasons: dict[str, str]
    inflation: float
    run: int

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts each kind's components into the record with the verdict on them."""
        for kind, rows in _rows_of(kinds).items():
            part = innovation.select(rows)
            recorder.add(t_ns, kind, Judged(part, noise[rows[:, None], rows], self.nis[kind], self.reasons[kind]))


@cache
def _rows_of(kinds: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {kind: np.array([i for i, k in enumerate(kinds) if k == kind]) for kind in dict.fromkeys(kinds)}


class Gate:
    """Chi-square gate with a count of the epochs rejected in a row, by what an epoch measures first: a velocity that passes
    says nothing of positions, nor an attitude."""

    def __init__(self, options: GateOptions) -> None:
        self._options = options
        self._runs: dict[str, int] = {}

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        rows = _rows_of(kinds)
        nis = {kind: self._square(innovation, noise, at) for kind, at in rows.items()}
        limit = {kind: self._limit(len(at)) for kind, at in rows.items()}
        failed = [kind for kind in rows if nis[kind] > limit[kind]]
        inflation = 1.0
        leading = kinds[0]
        run = self._runs.get(leading, 0)
        if failed and len(failed) == len(rows):
            run += 1
            self._runs[leading] = run
            if 0 < self._options.reset_after <= run:
                # more than enough: the factor acts on the prior's part of S only
                inflation = 2 * max(nis[kind] / len(rows[kind]) for kind in failed)
                failed = []
                self._runs[leading] = 0
        elif leading not in failed:
            self._runs[leading] = 0
        reasons = {
            kind: f"innovation {nis[kind]:.1f} beyond the gate of {limit[kind]:.1f}" if kind in failed else "" for kind in rows
        }
        passed = np.array([i for i, kind in enumerate(kinds) if kind not in failed], dtype=np.intp)
        return Verdict(passed, nis, reasons, inflation, run)

    def _limit(self, size: int) -> float:
        return float(chdtri(size, 1 - self._options.probability)) if self._options.probability < 1 else float("inf")

    @staticmethod
    def _square(innovation: Innovation, noise: Floats, rows: np.ndarray) -> float:
        square = rows[:, None], rows
        return chi_square(innovation.residual[rows], innovation.spread[square] + noise[square])
