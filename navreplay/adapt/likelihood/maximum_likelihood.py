"""Maximum-likelihood estimation of R over a window of innovations: the estimator of MLCKF.

Source: Gao et al. (2021), eq. (35) (see `likelihood`), by sequential quadratic programming with the analytic gradient
(`MaximumLikelihood`), and by a genetic algorithm as its rival (`GeneticLikelihood`, differential evolution). The paper sums
over the whole history; the window is our extension for noise that changes. The unknowns are the logarithms of each
component's ratio to its told variance, between bounds, since the minimum can lie at R = 0; SQP starts from the last estimate.
Assumes: P is right and the innovations of the window white; noise is constant over it.
Fails: in the first epochs, where the estimate collapses: so the told R holds until a component has `least` epochs. Takes an
error of Q for R. Outliers stay in the window for its whole length. Theory: the error of a variance from n epochs is about
(r + s) sqrt(2 / n) with s the spread.
When well specified: mean NEES per state 1.1 to 1.6, NIS per component 0.95 to 1.05.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.likelihood.gaussian_likelihood import Stack, misfit, stack_innovations
from navreplay.adapt.ratio import scale_noise
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["GeneticLikelihood", "History", "MaximumLikelihood"]

_LEAST_CURVATURE = 0.04
"""Below it (R far under the spread) J hardly depends on R, and steps of its inverse would be wild."""


class History(NamedTuple):
    """epochs: the innovations of the window. log_ratios: by label, the last estimate."""

    epochs: tuple[Innovation, ...]
    log_ratios: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class MaximumLikelihood:
    """window [epochs]: length. least [epochs]: that a component needs. floor, ceiling: bounds of used to told variance."""

    window: int = 50
    least: int = 15
    floor: float = 0.05
    ceiling: float = 1e4

    def init(self) -> History:
        """An empty window."""
        return History((), {})

    def adapt(self, state: History, prior: Gaussian, innovation: Innovation) -> Adaptation[History]:
        """R of the window, this epoch's innovation included."""
        # what the likelihood does not need is not kept
        epoch = innovation._replace(cross=np.empty((0, len(innovation.labels))), leftover=None)
        epochs = (*state.epochs, epoch)[-self.window :]
        counts = [sum(label in epoch.labels for epoch in epochs) for label in innovation.labels]
        ready = tuple(label for label, count in zip(innovation.labels, counts, strict=True) if count >= self.least)
        found = dict(state.log_ratios)
        if ready:
            start = np.array([found.get(label, 0.0) for label in ready])
            log_ratio = self.solve(stack_innovations(epochs, ready), start)
            found.update(zip(ready, log_ratio.tolist(), strict=True))
        ratio = np.exp([found.get(label, 0.0) for label in innovation.labels])
        return Adaptation(prior, scale_noise(innovation.noise, ratio), History(epochs, found))

    def solve(self, stack: Stack, start: Floats) -> Floats:
        """log_ratio (m,) of the least misfit, searched from start (m,)."""
        # in units that make the curvature about 1, the first step of SQP is nearly Newton's
        from scipy.optimize import minimize  # slow to load, and hardly any other method needs it

        unit = 1 / np.sqrt(np.maximum(misfit(start, stack)[2], _LEAST_CURVATURE))

        def objective(x: Floats) -> tuple[float, Floats]:
            """Misfit and gradient (m,) in variables scaled to unit curvature."""
            value, gradient, _ = misfit(x * unit, stack)
            return value, gradient * unit

        bounds = np.log([self.floor, self.ceiling]) / unit[:, None]
        # J per epoch to 1e-5: the estimate to half a percent, against a statistical error of twenty
        options = {"maxiter": 30, "ftol": 1e-5}
        found = minimize(objective, start / unit, method="SLSQP", jac=True, bounds=bounds, options=options)
        return np.asarray(found.x * unit)


@dataclass(frozen=True, slots=True)
class GeneticLikelihood(MaximumLikelihood):
    """generations: of each epoch's search. members: of the population per component. seed: of its draws."""

    generations: int = 20
    members: int = 5
    seed: int = 1

    def solve(self, stack: Stack, start: Floats) -> Floats:
        """log_ratio (m,) of the least misfit found, start (m,) being one of the first generation."""
        from scipy.optimize import differential_evolution  # as above

        bounds = [(np.log(self.floor), np.log(self.ceiling))] * len(start)
        found = differential_evolution(
            lambda members: np.array([misfit(log_ratio, stack)[0] for log_ratio in members.T]),
            bounds,
            maxiter=self.generations,
            popsize=self.members,
            rng=self.seed,
            x0=start,
            polish=False,
            tol=1e-6,
            vectorized=True,
            updating="deferred",
        )
        return np.asarray(found.x)
