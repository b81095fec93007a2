"""Gate for ranges: every pseudorange and range rate of an epoch is tested by itself, against all the others.

The largest innovation, normalised after conditioning on the prior and all other measurements still in, leaves if it is beyond
the limit, and the rest is judged anew (Baarda's data snooping with the prior as one more observation). So a receiver clock
whose prediction is loose hides no fault, and one fault does not spoil its neighbours.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from navreplay.options import GateOptions
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation, solve
from navreplay.update.record import JudgedRows, Recorder, step_of
from navreplay.update.reopening import Widening

__all__ = ["RangeGate", "RangeVerdict"]


class RangeVerdict(NamedTuple):
    """passed (k,): indices of the components to use. reasons (m,): empty where used. widenings: where the gate must be reopened
    after epochs without agreement; then nothing passes before it is judged anew."""

    passed: np.ndarray
    reasons: tuple[str, ...]
    widenings: tuple[Widening, ...]

    def record(self, recorder: Recorder, t_ns: int, kinds: Sequence[str], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdict on each."""
        told = np.diagonal(noise)
        total = np.diagonal(innovation.spread) + told
        nominal = np.diagonal(innovation.noise)
        step = step_of(innovation)
        ranges = kinds.count("range")
        for kind, part in (("range", slice(0, ranges)), ("range_rate", slice(ranges, len(kinds)))):
            if part.start < part.stop:
                rows = JudgedRows(
                    innovation.labels[part],
                    innovation.residual[part],
                    total[part],
                    told[part],
                    nominal[part],
                    self.reasons[part],
                    step[part],
                )
                recorder.add_rows(t_ns, kind, rows)


class RangeGate:
    """Keeps the count of epochs in a row in which most pseudoranges contradicted the prediction."""

    def __init__(self, options: GateOptions) -> None:
        self._reset_after = options.reset_after
        self._limit = float(chdtri(1, 1 - options.probability)) if options.probability < 1 else float("inf")
        self._run = 0
        self._start_ns = 0

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> RangeVerdict:
        """The verdict on an innovation with R = noise (m, m): pseudoranges first, then range rates."""
        squares, passed = _exclude(innovation.residual, innovation.spread + noise, self._limit)
        reasons = tuple(
            "" if good else f"normalised square {square:.1f} beyond the gate of {self._limit:.1f}"
            for good, square in zip(passed.tolist(), squares.tolist(), strict=True)
        )
        ranges = kinds.count("range")
        lost = ranges - int(passed[:ranges].sum())
        if 2 * lost <= ranges:
            self._run = 0
            return RangeVerdict(np.flatnonzero(passed), reasons, ())
        self._start_ns = self._start_ns if self._run else innovation.t_ns
        self._run += 1
        if not 0 < self._reset_after <= self._run:
            return RangeVerdict(np.flatnonzero(passed), reasons, ())
        seconds = (innovation.t_ns - self._start_ns) / 1e9
        run, self._run = self._run, 0
        variance = float(np.median(np.square(innovation.residual[:ranges])))
        return RangeVerdict(np.empty(0, dtype=np.intp), reasons, (Widening("range", variance, run, seconds),))


def _exclude(residual: Floats, cov: Floats, limit: float) -> tuple[Floats, np.ndarray]:
    """Normalised squares (m,), each when it was last looked at, and which components (m,) are left."""
    precision = solve(cov, np.eye(len(cov)))
    squares = np.zeros(len(residual))
    left = np.ones(len(residual), dtype=np.bool_)
    while left.any():
        alive = np.flatnonzero(left)
        weight = np.diagonal(precision)[alive]
        squares[alive] = (precision[alive] @ residual) ** 2 / weight
        worst = alive[squares[alive].argmax()]
        if squares[worst] <= limit:
            break
        left[worst] = False
        # what is left of the inverse when a row and column leave the matrix
        column = precision[:, worst].copy()
        precision -= column[:, None] * column / column[worst]
        precision[worst, :] = precision[:, worst] = 0.0
    return squares, left
