"""The default method: the filter with the noise it is told, unless its own innovations refute that (`checked`).

The first pass is `iekf`, and is the result where the log bears its noise out. Each kind of measurement is then looked at over
the whole log, by medians, which faults of single epochs do not move:
    d_k = z_k - leftover_k-1, the change between epochs that the inertial sensors did not see: 2 R and what they drift by in
          between, whatever the filter believes of R (the differences of Ge et al., Sensors 20 (2020) 6041, section 3);
    nu_k, the innovation: spread + R.
Of ranges, what all of an epoch share (the receiver clock) is taken from both by a median over its satellites, and noise is only
scaled up: among reflections the quiet majority says nothing of the few, which a filter that believes it would follow.
Told too small, R is scaled to what d shows, and if measurements are still shut out, to what nu shows: then the errors stay for
longer than an epoch, and a filter that trusts them less is the honest one. Told too large, R is scaled down, but to no less
than twice the deviations that d shows and a tenth of those told: a receiver that smooths has errors that stay and d does
not see, and nobody tells a variance a hundred times too large by chance.
Assumes: noise whose told size is wrong by one factor per kind, through most of the log.
Fails: noise that changes in level (see `auto`); a wrong process noise, which is not looked for.
When well specified: bit-identical to `iekf`.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from navreplay.calibration.settled import Settled
from navreplay.options import FilterOptions
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats, Times

__all__ = ["Review"]

_SCALES = {"position": "position_noise_scale", "velocity": "velocity_noise_scale"}
_RANGE_SCALES = {"range": "pseudorange_noise_scale", "range_rate": "range_rate_noise_scale"}
_LEAST_SATELLITES = 4
"""At an epoch, for a median over them to be their clock."""
_LEAST_EPOCHS = 30
_MEDIAN_OF_SQUARE = 0.4549
"""Median of a squared standard normal variable."""
_MOST_REJECTED = 0.05
_MARGIN = 2.0
_LEAST_FACTOR = 0.1


@dataclass(frozen=True, slots=True)
class Review:
    """trusted: factors of standard deviation up to this, and down to its inverse, are not acted upon. looks: at most so many
    passes are looked at; the second pass is final where it is borne out."""

    trusted: float = 1.7
    looks: int = 2

    def amend(self, options: FilterOptions, solution: Solution, amended: bool = False) -> Settled | None:
        """Options that the innovations of a solution made with options ask for; None where they bear the told noise out.
        amended: the options were asked for by a look before; then noise is not scaled down further."""
        factors: dict[str, float] = {}
        reasons = []
        for series in solution.innovations:
            if series.kind not in _SCALES | _RANGE_SCALES or series.step is None or _count_epochs(series) < _LEAST_EPOCHS:
                continue
            factor, reason = self._factor(series)
            if factor > 1.0 or (factor < 1.0 and not amended and not series.sources):
                factors[series.kind] = factor
                reasons.append(reason)
        if not factors:
            return None
        scaled, scales = _scale(options, factors)
        return Settled(scaled, None, scales, tuple(reasons))

    def _factor(self, series: InnovationSeries) -> tuple[float, str]:
        """Of the standard deviations of a kind, 1 where they are borne out, and the sentence that tells it."""
        assert series.step is not None
        rejected = 1 - float(np.mean(series.used))
        noise = np.square(series.noise_std)
        if series.sources:
            step, innovation = (_without_clock(series.t_ns, values[:, 0])[:, None] for values in (series.step, series.residual))
            by_innovation = sqrt(_ratio(np.square(innovation), noise))
        else:
            step = series.step
            by_innovation = sqrt(_ratio(np.square(series.residual) - (np.square(series.std) - noise), noise))
        by_step = sqrt(_ratio(np.square(step), 2 * noise))
        text = f"{series.kind}: "
        if rejected > _MOST_REJECTED:
            text += f"{100 * rejected:.0f} % were rejected; "
        if by_step > self.trusted and (rejected > _MOST_REJECTED or by_innovation > self.trusted):
            return by_step, f"{text}from epoch to epoch they scatter {by_step:.3g} times as much as told, and are taken so"
        if rejected > _MOST_REJECTED and by_innovation > self.trusted:
            return by_innovation, (
                f"{text}they are off by {by_innovation:.3g} times what was told, for longer than an epoch, and are taken so"
            )
        cautious = max(_MARGIN * by_step, _LEAST_FACTOR)
        if cautious < 1 / self.trusted and rejected <= _MOST_REJECTED:
            return cautious, (
                f"{text}from epoch to epoch they scatter {by_step:.3g} times as much as told; with a margin for errors that "
                f"stay, "
                f"{cautious:.3g} times that is taken"
            )
        return 1.0, ""


def _count_epochs(series: InnovationSeries) -> int:
    return len(np.unique(series.t_ns)) if series.sources else len(series.t_ns)


def _scale(options: FilterOptions, factors: dict[str, float]) -> tuple[FilterOptions, dict[str, float]]:
    """Options with the standard deviations of kinds times factors, and the scales that these then are."""
    fixes = {_SCALES[kind]: getattr(options, _SCALES[kind]) * by for kind, by in factors.items() if kind in _SCALES}
    ranges = {
        _RANGE_SCALES[kind]: getattr(options.ranges, _RANGE_SCALES[kind]) * by
        for kind, by in factors.items()
        if kind in _RANGE_SCALES
    }
    return replace(options, **fixes, ranges=replace(options.ranges, **ranges)), fixes | ranges


def _without_clock(t_ns: Times, values: Floats) -> Floats:
    """values (k,) less the median of their epoch, as large as their noise was before; NaN at epochs of few satellites."""
    known = np.flatnonzero(np.isfinite(values))
    order = known[np.lexsort((values[known], t_ns[known]))]
    _, starts, epoch, counts = np.unique(t_ns[order], return_index=True, return_inverse=True, return_counts=True)
    low, high = order[starts + (counts - 1) // 2], order[starts + counts // 2]
    median = np.where(counts >= _LEAST_SATELLITES, (values[low] + values[high]) / 2, np.nan)
    left = np.full(len(values), np.nan)
    left[order] = (values[order] - median[epoch]) * np.sqrt(counts / np.maximum(counts - 1, 1))[epoch]
    return left


def _ratio(square: Floats, variance: Floats) -> float:
    """Of squares (k, m), some unknown, to variances (k, m), by the median over all."""
    ratio = (square / variance)[np.isfinite(square)]
    return max(float(np.median(ratio)) / _MEDIAN_OF_SQUARE, 1e-8) if len(ratio) else 1.0
