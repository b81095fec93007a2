"""Likelihood of a window of innovations as a function of R, the objective of maximum-likelihood estimation.

Source: Gao et al., Maximum likelihood-based measurement noise covariance estimation using sequential quadratic programming
for cubature Kalman filter (2021), eq. (35): J(R) = sum over j of ln|H P H' + R| + nu' (H P H' + R)^-1 nu. Here R_j = D T_j D
with T_j the told R of the epoch and D = diag(exp(x / 2)): x is the logarithm of each component's ratio to its told variance.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from navreplay.adapt.likelihood import _likelihood_kernel
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation

__all__ = ["Stack", "misfit", "stack_innovations"]


class Stack(NamedTuple):
    """w innovations over the same m components: residual (w, m), spread (w, m, m), noise (w, m, m).

    A component that an epoch lacks has residual 0, spread 1 and noise 0 there, which leaves J and its gradient as without it.
    """

    residual: Floats
    spread: Floats
    noise: Floats


def stack_innovations(epochs: Sequence[Innovation], labels: tuple[str, ...]) -> Stack:
    """The components named labels (m,) of the epochs."""
    if all(epoch.labels == labels for epoch in epochs):
        parts = zip(*((epoch.residual, epoch.spread, epoch.noise) for epoch in epochs), strict=True)
        return Stack(*map(np.array, parts))
    size = len(labels)
    position = {label: i for i, label in enumerate(labels)}
    stack = Stack(
        np.zeros((len(epochs), size)), np.tile(np.eye(size), (len(epochs), 1, 1)), np.zeros((len(epochs), size, size))
    )
    for k, epoch in enumerate(epochs):
        rows = np.array([i for i, label in enumerate(epoch.labels) if label in position], dtype=np.intp)
        at = np.array([position[epoch.labels[i]] for i in rows], dtype=np.intp)
        part = epoch.select(rows)
        stack.residual[k, at] = part.residual
        stack.spread[k, at[:, None], at] = part.spread
        stack.noise[k, at[:, None], at] = part.noise
    return stack


def misfit(log_ratio: Floats, stack: Stack) -> tuple[float, Floats, Floats]:
    """J per epoch of the window, its gradient (m,) by log_ratio (m,), and the diagonal (m,) of its expected curvature (exact
    for uncorrelated noise)."""
    gradient, curvature = np.empty(len(log_ratio)), np.empty(len(log_ratio))
    value = _likelihood_kernel.misfit(log_ratio, *stack, gradient, curvature)
    count = len(stack.residual)
    return value / count, gradient / count, curvature / count
