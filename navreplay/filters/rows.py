"""Rows of a solution while it grows, one per node, and what a smoother needs of them."""

from dataclasses import dataclass, replace

import numpy as np

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import Propagated
from navreplay.filters.smoother import ForwardPass, smooth
from navreplay.filters.update import Updated
from navreplay.mechanisation.strapdown import NavState
from navreplay.solution import RowStatus
from navreplay.timeline import Floats, Times

__all__ = ["Rows"]


@dataclass(frozen=True, eq=False, slots=True)
class Rows:
    """t_ns: (k,). states: (k, w) packed. covariances: (k, n, n). status: (k,) of RowStatus. forward: what a smoother needs."""

    t_ns: Times
    states: Floats
    covariances: Floats
    status: np.ndarray
    forward: ForwardPass | None

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
        return replace(self, states=states, covariances=covariances, status=status, forward=None)
