"""Differences between a receiver and an INS over one epoch each, which the redundant-measurement methods have in common.

Ge et al., Sensors 20 (2020) 6041, (12)-(14): d_k = (zG_k - zG_k-1) - (zI_k - zI_k-1). In closed loop the second bracket must
not reach over a correction, so it is h(x_k|k-1) - h(x_k-1|k-1), and d_k is the residual of now against the prediction less
the residual of the last epoch against the corrected state (`Innovation.leftover`).
The paper's steady errors leave the differences, but a receiver clock's drift is not steady: what all pseudoranges, or all
range rates, of an epoch share is taken out of them (`remove_common`). Where fewer than four are there, what the filter
predicts of the clock has to do.
"""

from collections.abc import Mapping
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation

__all__ = ["CLOCKED", "Trail", "Trails", "difference_steps", "extend_trails", "remove_common", "stack_trails"]

CLOCKED = ("range ", "range_rate ")
_LEAST_SHARED = 4


class Trail(NamedTuple):
    """One label's past without a gap. differences: oldest first, in units of the told standard deviation, so that twice the
    ratio of true to told variance is their mean square. doubtful: how many in a row were not credible. t_ns, told: time and
    told variance of the last epoch."""

    differences: tuple[float, ...]
    doubtful: int
    t_ns: int
    told: float


Trails = Mapping[str, Trail]


def remove_common(labels: tuple[str, ...], values: Floats, variances: Floats) -> Floats:
    """values (m,) of an epoch less what the receiver clock adds to all of a kind; NaN stand for unknown ones and stay.

    The common part is the mean weighted by variances (m,) without those further than four robust sigmas from the median. It is
    a mean because its sum over epochs is the mean of the sums; a median's is not, and would look like correlated noise. What
    is left is stretched to the variance that it had with its own share in the mean.
    """
    result = values.copy()
    for kind in CLOCKED:
        rows = [i for i, label in enumerate(labels) if label.startswith(kind) and values[i] == values[i]]
        if len(rows) >= _LEAST_SHARED:
            result[rows] = _centre(values[rows], variances[rows])
    return result


def _centre(x: Floats, variance: Floats) -> Floats:
    middle = len(x) // 2
    distance = np.abs(x - np.sort(x)[middle]) / np.sqrt(variance)
    good = distance <= 4 * 1.4826 * np.sort(distance)[middle]
    weight = np.where(good, 1 / variance, 0.0)
    total = weight.sum()
    left = variance + np.where(good, -1, 1) / total
    return np.asarray((x - weight @ x / total) * np.sqrt(variance / left))


def extend_trails(trails: Trails, innovation: Innovation, length: int, longest_step: float) -> dict[str, Trail]:
    """The trails (at most length differences) of the labels of this epoch; one whose last epoch is not the filter's last, or
    lies further back than longest_step [s], begins anew."""
    told = np.diagonal(innovation.noise)
    seen = {label: trail.t_ns for label, trail in trails.items()}
    step = remove_common(innovation.labels, difference_steps(seen, innovation, longest_step), told)
    extended = {}
    for label, value, variance in zip(innovation.labels, step.tolist(), told.tolist(), strict=True):
        if isfinite(value):
            last = trails[label]
            scaled = value / ((variance + last.told) / 2) ** 0.5
            extended[label] = Trail((*last.differences, scaled)[-length:], last.doubtful, innovation.t_ns, variance)
        else:
            extended[label] = Trail((), 0, innovation.t_ns, variance)
    return extended


def difference_steps(seen: Mapping[str, int], innovation: Innovation, longest_step: float) -> Floats:
    """(m,) residual of now less that behind the last update; NaN where there is none to compare with. seen: when each label
    was last seen [ns]; no step is longer than longest_step [s]."""
    leftover = innovation.leftover
    if leftover is None or innovation.t_ns - leftover.t_ns > longest_step * 1e9:
        return np.full(len(innovation.labels), np.nan)
    before = [
        leftover.residual[label] if label in seen and seen[label] == leftover.t_ns else nan for label in innovation.labels
    ]
    return innovation.residual - before


def stack_trails(trails: list[Trail], length: int) -> tuple[Floats, Floats]:
    """Differences (k, length), oldest first and zeros before them, and how many each trail has (k,)."""
    stacked = np.zeros((len(trails), length))
    counts = [len(trail.differences) for trail in trails]
    for row, trail, count in zip(stacked, trails, counts, strict=True):
        if count:
            row[-count:] = trail.differences
    return stacked, np.array(counts, dtype=np.float64)
