"""Redundant-measurement filter for noise that is correlated in time: what ERMAKF means to be, derived.

Source: own derivation from the differences of Ge et al., Sensors 20 (2020) 6041, (12)-(14). Differences over one epoch add up
to those over a lag L, in which the INS is still never differenced across a correction; half their mean square is v_L
(`lag_memory`). What lasts longer than the lags is in no difference: it is in the level, the part of the innovations in which
satellites contradict each other (`redundancy`). The curve of v_L and level says how large noise is, which share of it is
correlated, and for how long (`lag_curve`).
That curve is shared by all components of a kind (all pseudoranges, all range rates), since the surroundings make it; each has
a variance of its own. Noise that lasts T has window / T independent values in a window, hence few, so variances are taken for
inverse-gamma distributed about that of the kind, and the kind's about the told one: with n values of mean square s^2, and a
belief in c that counts as b, R = (b c + n s^2) / (b + n). A satellite that is new has the R of its surroundings, and R leaves
the told one by as much as there are independent values that speak against it. The kind's scale is the maximum-likelihood one
of the t-distribution with b + 2 degrees of freedom that this makes of single values, in which each weighs inverse to its R
(Lange, Little, Taylor, J. Am. Stat. Assoc. 84 (1989) 881), so that one bad satellite does not speak for all; one iteration of
it is done per epoch.
Assumes: noise of one correlation in all components of a kind, and told variances that are right relative to each other.
Fails: where a bias is common to satellites (heights under an atmosphere unlike its model); with four satellites or fewer,
and on position fixes, which show no level: noise that lasts and a drift of the INS are then not to be told apart, the drift is
believed, and R is too small (half of it with 20 s, a quarter with 60 s); for half a window after noise has changed; and where
epochs of another sensor lie between those of the receiver, no difference is formed and the level alone is left. R
says how large the errors are, not that they stay: a filter that takes correlated noise for white still believes their mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.redundant.lag_curve import Correlation, fit_curve, fit_variances, independent_values
from navreplay.adapt.redundant.lag_memory import LagMemory, add_levels, extend_memory, forget, rows_of
from navreplay.adapt.redundant.redundancy import level_squares
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["ErmakfDerived", "estimate_ratios"]


_LEAST = 1e-12
_SHORTEST_STEP = 1e-3


def estimate_ratios(
    sums: Floats, weights: Floats, before: Floats, belief: float, interval: float
) -> tuple[Floats, Correlation]:
    """Ratios (k,) to the told variance of components of one kind, and the correlation they share.

    sums, weights (k, lags + 1): of a memory with epochs interval [s] apart. before (k,): the ratios estimated so far. belief:
    how many values what is believed of a component counts as.
    """
    trust = before.mean() / before
    curve = fit_curve((trust @ sums) / np.maximum(trust @ weights, _LEAST), weights.sum(axis=0))
    own, share = fit_variances(sums / np.maximum(weights, _LEAST), weights, curve)
    count = share * independent_values(curve.correlation, weights.max(axis=1), interval)
    freedom, total = belief + 2, count.sum()
    mean = curve.variance * freedom / belief  # of the inverse-gamma distribution with that scale
    common = (freedom + total * mean) / (freedom + total)
    return (belief * common + count * own) / (belief + count), curve.correlation


@dataclass(frozen=True, slots=True)
class ErmakfDerived:
    """window [s]: of what is remembered. belief: how many independent values of its own noise a component needs to count as
    much as its surroundings. longest_step [s]: no difference over one epoch reaches further. floor: least ratio of estimated to
    told variance."""

    window: float = 30.0
    belief: float = 2.0
    longest_step: float = 1.5
    floor: float = 0.01

    def init(self) -> LagMemory:
        """Nothing seen yet."""
        return forget()

    def adapt(self, state: LagMemory, prior: Gaussian, innovation: Innovation) -> Adaptation[LagMemory]:
        """R scaled by the variance estimated for each component."""
        elapsed = (innovation.t_ns - state.t_ns) / 1e9 if state.rows else self.longest_step
        interval = min(max(elapsed, _SHORTEST_STEP), self.longest_step)
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
            found, correlation = estimate_ratios(sums[rows], weights[rows], before[rows], self.belief, interval)
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
