"""The backward pass between two corrected nodes: no inverse, and no state but through its covariance."""

import numpy as np
from numba import njit

from navreplay.timeline import Floats

__all__ = ["carry_back"]


@njit(cache=True)
def carry_back(transitions: Floats, covariances: Floats, pull: Floats, loss: Floats, tie: Floats, moves: Floats) -> None:
    """Over k nodes, the last of which is corrected and stays as it is: covariances (k, n + p, n + p), filtered, become
    smoothed; moves (k, n) are the corrections of the states; pull (n,), loss (n, n) and tie (n, p), of the last node before
    its correction, become those behind the first. transitions (k, n + p, n + p): from the node before to each.

    pull is P^-1 (x^s - x), loss P^-1 (P^s - P) P^-1, tie P^-1 (P_xp^s - P_xp): a transition carries each back by its transpose.
    """
    n, p = tie.shape
    k = len(covariances)
    for j in range(k - 2, -1, -1):
        phi = np.ascontiguousarray(transitions[j + 1, :n, :n])
        back = np.ascontiguousarray(phi.T)
        pull[:] = back @ pull
        loss[:] = back @ (loss @ phi)
        cov = np.ascontiguousarray(covariances[j, :n, :n])
        moves[j] = cov @ pull
        smoothed = cov + cov @ (loss @ cov)
        covariances[j, :n, :n] = (smoothed + smoothed.T) / 2
        if p:
            tie[:] = back @ tie
            cross = covariances[j, :n, n:] + cov @ tie
            covariances[j, :n, n:] = cross
            covariances[j, n:, :n] = cross.T
