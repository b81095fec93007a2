"""Fixed-interval smoothing behind a forward filter.

Source: Rauch, Tung and Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965) 1445, for a
closed-loop error state: the forward pass keeps at every node the state before and after its update, and the backward pass
carries the difference between the smoothed and the predicted state of the node behind.
"""

from typing import NamedTuple

import numpy as np

from navreplay.error_models.error_model import ErrorModel
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats
from navreplay.update.gaussian import symmetric

__all__ = ["ForwardPass", "smooth"]


class ForwardPass(NamedTuple):
    """A forward pass over k nodes.

    states, covariances: (k, w) packed and (k, n, n) after the update of each node, if it had one. prior_states,
    prior_covariances: the same before it, behind any inflation and clock jump. transitions: (k, n, n) from the node before to
    each; the first is not used.
    """

    states: Floats
    covariances: Floats
    prior_states: Floats
    prior_covariances: Floats
    transitions: Floats


def smooth(forward: ForwardPass, model: ErrorModel) -> tuple[Floats, Floats]:
    """Smoothed packed states (k, w) and covariances (k, n, n)."""
    gains = _gains(forward)
    states, covariances = forward.states.copy(), forward.covariances.copy()
    for k in range(len(states) - 2, -1, -1):
        behind = NavState.unpack(states[k + 1])
        error = model.difference(behind, NavState.unpack(forward.prior_states[k + 1]))
        states[k] = model.retract(NavState.unpack(states[k]), gains[k] @ error).pack()
        change = covariances[k + 1] - forward.prior_covariances[k + 1]
        covariances[k] = symmetric(covariances[k] + gains[k] @ change @ gains[k].T)
    return states, covariances


def _gains(forward: ForwardPass) -> Floats:
    """(k - 1, n, n) P_k Phi' (P_k+1|k)^-1, solved in units of each state's own standard deviation."""
    prior = forward.prior_covariances[1:]
    std = np.sqrt(np.diagonal(prior, axis1=1, axis2=2))
    scaled = prior / (std[:, :, None] * std[:, None, :])
    cross = forward.transitions[1:] @ forward.covariances[:-1] / std[:, :, None]
    return np.asarray(np.swapaxes(np.linalg.solve(scaled, cross) / std[:, :, None], 1, 2))
