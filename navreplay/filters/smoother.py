"""Fixed-interval smoothing behind a forward filter.

Source: Rauch, Tung and Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965) 1445, for a
closed-loop error state: the forward pass keeps at every node the state before and after its update, and the backward pass
carries the difference between the smoothed and the predicted state of the node behind,
    x^s_k = x_k + P_k Phi' u,   u = (P^-_k+1)^-1 (x^s_k+1 - x^-_k+1),
    P^s_k = P_k + P_k Phi' U Phi P_k,   U = (P^-_k+1)^-1 (P^s_k+1 - P^-_k+1) (P^-_k+1)^-1.
Where no update came between, u and U go back by Phi' alone (Bryson and Frazier, Smoothing for linear and nonlinear dynamic
systems, 1963), so that only corrected nodes cost an inverse.
Biases that are considered and not estimated: the gain of the states alone, and the cross-covariance carried back with it
(Woodbury and Junkins, On the consider Kalman filter, AIAA GNC 2010).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.error_models.error_model import ErrorModel
from navreplay.filters import _backward_kernel
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats
from navreplay.update.gaussian import symmetric

__all__ = ["ForwardPass", "smooth"]


class ForwardPass(NamedTuple):
    """A forward pass over k nodes, of which m were corrected by a measurement, inflation or clock jump.

    states, covariances: (k, w) packed and (k, n, n), behind the correction of each node, if it had one. transitions: (k, n, n)
    from the node before to each; the first is not used. corrected: (m,) rising indices. prior_states, prior_covariances:
    (m, w), (m, n, n) of these before a measurement, behind any inflation and clock jump.
    """

    states: Floats
    covariances: Floats
    transitions: Floats
    corrected: NDArray[np.intp]
    prior_states: Floats
    prior_covariances: Floats


def smooth(forward: ForwardPass, model: ErrorModel, considered: int = 0) -> Floats:
    """Smoothed packed states (k, w); the covariances of the forward pass become the smoothed ones in place. The last
    `considered` error states are biases, which stay as told."""
    states, cov = forward.states.copy(), forward.covariances
    n, last = cov.shape[1] - considered, len(states) - 1
    moves = np.zeros((len(states), cov.shape[1]))
    driven = considered > 0 and bool(forward.transitions[1:, :n, n:].any())
    stops = set(range(1, last)) if driven else set(forward.corrected.tolist()) - {0, last}
    prior = dict(zip(forward.corrected.tolist(), range(len(forward.corrected)), strict=True))
    before = _Moments(forward.states[last], cov[last].copy())
    for first in [*sorted(stops, reverse=True), 0]:
        if last in prior:
            before = _Moments(forward.prior_states[prior[last]], forward.prior_covariances[prior[last]])
        pull, loss, tie = _look_back(model, before, states[last], cov[last], n)
        before = _Moments(forward.states[first], cov[first].copy())
        leg = slice(first, last + 1)
        if driven:
            _step_back(forward.transitions[last], cov[first], pull, loss, tie, moves[first, :n])
        else:
            _backward_kernel.carry_back(forward.transitions[leg], cov[leg], pull, loss, tie, moves[leg, :n])
        states[first] = model.retract(NavState.unpack(states[first]), moves[first]).pack()
        last = first
    between = np.setdiff1d(np.arange(1, len(states) - 1), sorted(stops))
    if len(between):
        states[between] = model.retract(NavState.unpack(states[between]), moves[between]).pack()
    return states


class _Moments(NamedTuple):
    """A packed state (w,) and its covariance (n + p, n + p)."""

    state: Floats
    cov: Floats


def _look_back(model: ErrorModel, before: _Moments, state: Floats, cov: Floats, n: int) -> tuple[Floats, Floats, Floats]:
    """P^-1 (x^s - x) (n,), P^-1 (P^s - P) P^-1 (n, n), P^-1 (P_xp^s - P_xp) (n, p) of a node before its correction, whose
    smoothed state and cov are given; solved in units of each state's own standard deviation."""
    error = model.difference(NavState.unpack(state), NavState.unpack(before.state))[:n]
    std = np.sqrt(np.diagonal(before.cov)[:n])
    scaled = before.cov[:n, :n] / (std[:, None] * std)
    change = (cov[:n] - before.cov[:n]) / std[:, None]
    change[:, :n] /= std
    solved = np.linalg.solve(scaled, np.column_stack([error / std, change]))
    loss = np.linalg.solve(scaled, solved[:, 1 : n + 1].T)
    return solved[:, 0] / std, symmetric(loss) / (std[:, None] * std), solved[:, n + 1 :] / std[:, None]


def _step_back(phi: Floats, cov: Floats, pull: Floats, loss: Floats, tie: Floats, move: Floats) -> None:
    """One step over a transition phi (n + p, n + p) by which the biases drive the states: cov (n + p, n + p) becomes smoothed,
    move (n,) the correction."""
    n = len(pull)
    cross = cov[:n, :] @ phi[:n, :].T
    move[:] = cross @ pull
    cov[:n, :n] = symmetric(cov[:n, :n] + cross @ loss @ cross.T)
    cov[:n, n:] += cross @ tie
    cov[n:, :n] = cov[:n, n:].T
