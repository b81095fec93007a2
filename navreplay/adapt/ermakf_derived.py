"""TODO"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.adapt.adapter import Adaptation
from navreplay.adapt.lag_curve import Correlation, fit_curve, fit_levels, independent_values
from navreplay.adapt.lag_memory import LagMemory, add_levels, extend_memory, forget, rows_of
from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.redundancy import level_squares
from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["ErmakfDerived", "estimate_ratios"]


def estimate_ratios(
    sums: Floats, weights: Floats, before: Floats, freedom: float, interval: float
) -> tuple[Floats, Correlation]:
    """Ratios (k,) to the told variance of components of one kind, and the correlation they share, from sums and weights
    (k, lags + 1) of a memory with epochs interval [s] apart. before (k,): the ratios estimated so far. freedom: degrees of
    freedom of what is believed beforehand."""
    trust = before.mean() / before
    pooled = weights.sum(axis=0)
    curve = fit_curve((trust @ sums) / np.maximum(trust @ weights, _LEAST), pooled)
    own, share = fit_levels(sums / np.maximum(weights, _LEAST), weights, curve)
    count = share * independent_values(curve.correlation, weights.max(axis=1), interval)
    common = (freedom + count.sum() * curve.variance * freedom / (freedom - 2)) / (freedom + count.sum())
    return ((freedom - 2) * common + count * own) / (freedom - 2 + count), curve.correlation


_LEAST = 1e-12


@dataclass(frozen=True, slots=True)
class ErmakfDerived:
    """window [s]: of what is remembered. freedom: degrees of freedom, above 2, of what is believed beforehand. longest_step
    [s]: no difference over one epoch reaches further. floor: least ratio of used to told variance."""

    window: float = 30.0
    freedom: float = 4.0
    longest_step: float = 1.5
    floor: float = 0.01

    def init(self) -> LagMemory:
        """Nothing seen yet."""
        return forget()

    def adapt(self, state: LagMemory, prior: Gaussian, innovation: Innovation) -> Adaptation[LagMemory]:
        """R scaled by the variance estimated for each component."""
        interval = min((innovation.t_ns - state.t_ns) / 1e9, self.longest_step)
        memory = extend_memory(state, innovation, self.window, self.longest_step)
        here = rows_of(memory, innovation.labels)
        kinds = _rows_by_kind(innovation.labels)
        remembered = memory.weights.sum(axis=(0, 2))[here] > 0
        before = _guess_new(np.where(remembered, memory.ratio[here], np.nan), kinds)
        squares, shares = level_squares(innovation, np.diagonal(innovation.noise) * before)
        memory = add_levels(memory, here, squares, shares, before, interval)
        sums, weights = memory.sums.sum(axis=0)[here], memory.weights.sum(axis=0)[here]
        ratio, used = np.empty(len(here)), np.empty(len(here))
        for rows in kinds:
            found, correlation = estimate_ratios(sums[rows], weights[rows], before[rows], self.freedom, interval)
            ratio[rows] = np.maximum(found, self.floor)
            used[rows] = ratio[rows] * self._enlarge(correlation, interval)
        known = memory.ratio.copy()
        known[here] = ratio
        return Adaptation(prior, scale_noise(innovation.noise, used), memory._replace(ratio=known))

    def _enlarge(self, correlation: Correlation, interval: float) -> float:
        """R over the variance of noise of that correlation at epochs interval [s] apart."""
        return 1.0


def _rows_by_kind(labels: tuple[str, ...]) -> list[NDArray[np.intp]]:
    """Indices of the labels of each kind (the first word)."""
    kinds = [label.partition(" ")[0] for label in labels]
    return [np.array([i for i, other in enumerate(kinds) if other == kind]) for kind in dict.fromkeys(kinds)]


def _guess_new(ratio: Floats, kinds: list[NDArray[np.intp]]) -> Floats:
    """ratio (m,) with NaN, of components that are new, replaced by the harmonic mean of their kind, or 1."""
    guessed = ratio.copy()
    for rows in kinds:
        new = np.isnan(ratio[rows])
        if new.any():
            guessed[rows[new]] = 1.0 if new.all() else 1 / (1 / ratio[rows[~new]]).mean()
    return guessed
