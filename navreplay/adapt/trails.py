"""Differences between a receiver and an INS over one epoch each, which the redundant-measurement methods have in common.

Ge et al., Sensors 20 (2020) 6041, (12)-(14): d_k = (zG_k - zG_k-1) - (zI_k - zI_k-1). In closed loop the second bracket must
not reach over a correction, so it is h(x_k|k-1) - h(x_k-1|k-1), and d_k is the residual of now against the prediction less
the residual of the last epoch against the corrected state (`Innovation.leftover`).
The paper's steady errors leave the differences, but a receiver clock's drift is not steady: what all pseudoranges, or all
range rates, of an epoch share is taken out of them as their median, which makes the variance of n of them low by about
0.4 / n. Where fewer than four are there, what the filter predicts of the clock has to do.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from navreplay.filters.core import Innovation
from navreplay.timeline import Floats

__all__ = ["Trail", "Trails", "extend_trails", "remove_common", "stack_trails"]

_CLOCKED = ("range", "range_rate")
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


def remove_common(labels: tuple[str, ...], values: Floats) -> Floats:
    """values (m,) of an epoch less what the receiver clock adds to all of a kind; NaN stand for unknown ones and stay."""
    kinds = np.array([label.partition(" ")[0] for label in labels])
    result = values.copy()
    for kind in _CLOCKED:
        rows = np.flatnonzero((kinds == kind) & np.isfinite(values))
        if len(rows) >= _LEAST_SHARED:
            result[rows] -= np.median(values[rows])
    return result


def extend_trails(trails: Trails, innovation: Innovation, length: int, longest_step: float) -> dict[str, Trail]:
    """The trails (at most length differences) of the labels of this epoch; one whose last epoch is not the filter's last, or
    lies further back than longest_step [s], begins anew."""
    told = np.diagonal(innovation.noise).tolist()
    step = remove_common(innovation.labels, _difference(trails, innovation, longest_step)).tolist()
    extended = {}
    for label, value, variance in zip(innovation.labels, step, told, strict=True):
        if np.isfinite(value):
            last = trails[label]
            scaled = value / ((variance + last.told) / 2) ** 0.5
            extended[label] = Trail((*last.differences, scaled)[-length:], last.doubtful, innovation.t_ns, variance)
        else:
            extended[label] = Trail((), 0, innovation.t_ns, variance)
    return extended


def _difference(trails: Trails, innovation: Innovation, longest_step: float) -> Floats:
    """(m,) residual of now less that behind the last update; NaN where there is none to compare with."""
    leftover = innovation.leftover
    step = np.full(len(innovation.labels), np.nan)
    if leftover is None or innovation.t_ns - leftover.t_ns > longest_step * 1e9:
        return step
    for i, label in enumerate(innovation.labels):
        if label in trails and trails[label].t_ns == leftover.t_ns:
            step[i] = innovation.residual[i] - leftover.residual[label]
    return step


def stack_trails(trails: list[Trail], length: int) -> tuple[Floats, Floats]:
    """Differences (k, length), oldest first and zeros before them, and how many each trail has (k,)."""
    stacked = np.zeros((len(trails), length))
    for row, trail in zip(stacked, trails, strict=True):
        count = len(trail.differences)
        row[length - count :] = trail.differences
    return stacked, np.array([len(trail.differences) for trail in trails], dtype=np.float64)
