"""Statistics of errors, and the chi-square test of normalised squared errors.

NEES and NIS: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 5.4;
the bounds are two-sided 95 % of chi-square for a single epoch.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from navreplay.solution import InnovationSeries
from navreplay.timeline import Floats

__all__ = ["Consistency", "Statistics", "compute_nis", "judge_squares", "summarise"]


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of one signed error: rms, mean, std; p50, p68, p95 and max of its magnitude; count. All NaN when count is 0."""

    count: int
    rms: float
    mean: float
    std: float
    p50: float
    p68: float
    p95: float
    max: float


@dataclass(frozen=True, slots=True)
class Consistency:
    """Normalised squared errors: degrees of freedom (also the expected mean), mean, 95 % bounds of one epoch, share of
    epochs inside the bounds (0.95 expected) and below the upper one (0.975 expected), count."""

    dof: int
    count: int
    mean: float
    lower: float
    upper: float
    share_inside: float
    share_below_upper: float


def summarise(error: Floats) -> Statistics:
    """Statistics of error (k,); NaN entries are left out."""
    known = error[np.isfinite(error)]
    if len(known) == 0:
        return Statistics(0, *[float("nan")] * 7)
    p50, p68, p95 = np.percentile(np.abs(known), [50, 68, 95])
    rms = float(np.sqrt(np.mean(known**2)))
    return Statistics(
        len(known), rms, float(known.mean()), float(known.std()), float(p50), float(p68), float(p95), float(np.abs(known).max())
    )


def judge_squares(values: Floats, dof: int) -> Consistency:
    """Normalised squared errors (k,) of dof degrees of freedom against chi-square; NaN entries are left out."""
    known = values[np.isfinite(values)]
    lower, upper = chdtri(dof, [0.975, 0.025])
    if len(known) == 0:
        return Consistency(dof, 0, float("nan"), float(lower), float(upper), float("nan"), float("nan"))
    below = known <= upper
    inside = below & (known >= lower)
    return Consistency(
        dof, len(known), float(known.mean()), float(lower), float(upper), float(inside.mean()), float(below.mean())
    )


def compute_nis(innovations: Iterable[InnovationSeries], used_only: bool = True) -> dict[str, Consistency]:
    """Consistency of the innovations of each kind; of those used only, or of all. Degrees of freedom: components that are not
    NaN, where they vary the most frequent number."""
    judged = {}
    for series in innovations:
        dof = np.isfinite(series.residual).sum(axis=1)
        usual = int(np.bincount(dof).argmax()) if len(dof) else len(series.labels)
        rows = (dof == usual) & (series.used | (not used_only))
        judged[series.kind] = judge_squares(series.nis[rows], max(usual, 1))
    return judged
