"""Rows of a solution while it grows, one per node, and what a smoother needs of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.evaluation.metrics import normalised_squares
from navreplay.filters.smoother import ForwardPass, smooth
from navreplay.filters.update import Updated
from navreplay.geodesy.earth import ned_between
from navreplay.mechanisation.strapdown import NavState
from navreplay.solution import RowStatus
from navreplay.timeline import Floats, Times

__all__ = ["Rows", "backward_agreement"]

_LEAST_GAIN = 0.05
"""Of the variance: less than that share taken away says nothing, rounding and the floor of the measurements do."""


@dataclass(frozen=True, eq=False, slots=True)
class Rows:
    """t_ns: (k,). states: (k, w) packed. covariances: (k, n, n). status: (k,) of RowStatus. forward: what a smoother needs.
    agreement: (k,) of smoothed rows, see `backward_agreement`."""

    t_ns: Times
    states: Floats
    covariances: Floats
    status: np.ndarray
    forward: ForwardPass | None
    agreement: Floats | None = None

    @classmethod
    def allocate(cls, t_ns: Times, state: NavState, cov: Floats, keep: bool) -> "Rows":
        """Rows at t_ns (k,), of which the first holds state and cov (n, n); keep: room for what a smoother needs."""
        k, first = len(t_ns), state.pack()
        states, covariances = np.empty((k, len(first))), np.empty((k, *cov.shape))
        states[0], covariances[0] = first, cov
        status = np.full(k, RowStatus.PREDICTED, dtype=np.int8)
        status[0] = RowStatus.UPDATED
        if not keep:
            return cls(t_ns, states, covariances, status, None)
        needs = np.empty_like(states), np.empty_like(covariances), np.empty_like(covariances)
        return cls(t_ns, states, covariances, status, ForwardPass(states, covariances, *needs))

    def put(self, rows: slice, moved: Propagated) -> None:
        """Writes propagated nodes."""
        self.states[rows], self.covariances[rows] = moved.states, moved.covariances
        if self.forward is not None:
            self.forward.prior_states[rows], self.forward.prior_covariances[rows] = moved.states, moved.covariances
            self.forward.transitions[rows] = moved.transitions

    def correct(self, row: int, updated: Updated) -> None:
        """Writes a measurement epoch over its propagated node."""
        self.states[row], self.covariances[row], self.status[row] = updated.state.pack(), updated.cov, updated.status
        if self.forward is not None:
            self.forward.prior_states[row] = updated.prior_state.pack()
            self.forward.prior_covariances[row] = updated.prior_cov

    def until(self, row: int) -> "Rows":
        """The rows up to that one."""
        kept = slice(0, row + 1)
        forward = None if self.forward is None else ForwardPass(*(part[kept] for part in self.forward))
        return Rows(self.t_ns[kept], self.states[kept], self.covariances[kept], self.status[kept], forward)

    def smoothed(self, model: ErrorModel) -> "Rows":
        """The rows given all measurements; the smoother's needs are dropped. Rows stay as they are where none were kept."""
        if self.forward is None:
            return self
        states, covariances = smooth(self.forward, model)
        status = np.full_like(self.status, RowStatus.SMOOTHED)
        agreement = _agreement(self, states, covariances)
        return replace(self, states=states, covariances=covariances, status=status, forward=None, agreement=agreement)


def _agreement(forward: Rows, states: Floats, covariances: Floats) -> Floats:
    """(k,) normalised squares of the horizontal differences between forward and smoothed rows, whose covariance is the
    difference of theirs; NaN where the smoother had hardly anything to add (Rauch et al., AIAA Journal 3 (1965) 1445)."""
    moved = ned_between(forward.states[:, :3], states[:, :3])[:, :2]
    told = forward.covariances[:, :2, :2]
    gained = told - covariances[:, :2, :2]
    squares = normalised_squares(moved, gained)
    least = np.linalg.eigvalsh(gained)[:, 0] / np.trace(told, axis1=1, axis2=2)
    return np.where(least > _LEAST_GAIN, squares, np.nan)


def backward_agreement(squares: list[Floats]) -> float | None:
    """Median over all parts (k,) of a solution, over its expected value; None where nothing was smoothed."""
    known = np.concatenate(squares) if squares else np.empty(0)
    known = known[np.isfinite(known)]
    return float(np.median(known) / chdtri(2, 0.5)) if len(known) else None
