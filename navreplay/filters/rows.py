"""Rows of a solution while it grows, one per node, and what a smoother needs of them."""

from dataclasses import dataclass, field, replace

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
    """t_ns: (k,). states: (k, w) packed. covariances: (k, n, n). status: (k,) of RowStatus. needs: of a smoother, where one
    follows. agreement: (k,) of smoothed rows, see `backward_agreement`."""

    t_ns: Times
    states: Floats
    covariances: Floats
    status: np.ndarray
    needs: "_Needs | None"
    agreement: Floats | None = None

    @classmethod
    def allocate(cls, t_ns: Times, state: NavState, cov: Floats, keep: bool) -> "Rows":
        """Rows at t_ns (k,), of which the first holds state and cov (n, n); keep: room for what a smoother needs."""
        k, first = len(t_ns), state.pack()
        states, covariances = np.empty((k, len(first))), np.empty((k, *cov.shape))
        states[0], covariances[0] = first, cov
        status = np.full(k, RowStatus.PREDICTED, dtype=np.int8)
        status[0] = RowStatus.UPDATED
        return cls(t_ns, states, covariances, status, _Needs(np.empty_like(covariances)) if keep else None)

    def put(self, rows: slice, moved: Propagated) -> None:
        """Writes propagated nodes."""
        self.states[rows], self.covariances[rows] = moved.states, moved.covariances
        if self.needs is not None:
            self.needs.transitions[rows] = moved.transitions

    def correct(self, row: int, updated: Updated) -> None:
        """Writes a measurement epoch over its propagated node."""
        self.states[row], self.covariances[row], self.status[row] = updated.state.pack(), updated.cov, updated.status
        if self.needs is not None:
            self.needs.corrected.append(row)
            self.needs.prior_states.append(updated.prior_state.pack())
            self.needs.prior_covariances.append(updated.prior_cov)

    def until(self, row: int) -> "Rows":
        """The rows up to that one."""
        kept = slice(0, row + 1)
        needs = None if self.needs is None else replace(self.needs, transitions=self.needs.transitions[kept])
        return Rows(self.t_ns[kept], self.states[kept], self.covariances[kept], self.status[kept], needs)

    def smoothed(self, model: ErrorModel, considered: int) -> "Rows":
        """The rows given all measurements; the smoother's needs are dropped. Rows stay as they are where none were kept. The
        last `considered` error states are biases that are not estimated."""
        if self.needs is None:
            return self
        told = self.covariances[:, :2, :2].copy()
        states = smooth(self.needs.forward_pass(self.states, self.covariances), model, considered)
        status = np.full_like(self.status, RowStatus.SMOOTHED)
        agreement = _agreement(self.states, told, states, self.covariances[:, :2, :2])
        return replace(self, states=states, status=status, needs=None, agreement=agreement)


@dataclass(frozen=True, eq=False, slots=True)
class _Needs:
    """transitions (k, n, n), and of each corrected row its index, packed state and covariance before."""

    transitions: Floats
    corrected: list[int] = field(default_factory=list)
    prior_states: list[Floats] = field(default_factory=list)
    prior_covariances: list[Floats] = field(default_factory=list)

    def forward_pass(self, states: Floats, covariances: Floats) -> ForwardPass:
        """With the rows as they were filtered."""
        n = covariances.shape[1]
        priors = np.reshape(self.prior_states, (-1, states.shape[1])), np.reshape(self.prior_covariances, (-1, n, n))
        return ForwardPass(states, covariances, self.transitions, np.array(self.corrected, dtype=np.intp), *priors)


def _agreement(filtered: Floats, told: Floats, smoothed: Floats, left: Floats) -> Floats:
    """(k,) normalised squares of the horizontal differences between filtered and smoothed states (k, w), whose covariance is
    the difference of theirs, told and left (k, 2, 2); NaN where the smoother had hardly anything to add (Rauch et al., AIAA
    Journal 3 (1965) 1445)."""
    moved = ned_between(filtered[:, :3], smoothed[:, :3])[:, :2]
    gained = told - left
    squares = normalised_squares(moved, gained)
    least = np.linalg.eigvalsh(gained)[:, 0] / np.trace(told, axis1=1, axis2=2)
    return np.where(least > _LEAST_GAIN, squares, np.nan)


def backward_agreement(squares: list[Floats]) -> float | None:
    """Median over all parts (k,) of a solution, over its expected value; None where nothing was smoothed."""
    known = np.concatenate(squares) if squares else np.empty(0)
    known = known[np.isfinite(known)]
    return float(np.median(known) / chdtri(2, 0.5)) if len(known) else None
