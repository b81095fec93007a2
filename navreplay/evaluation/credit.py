"""What can be said of a solution without a reference: its measurements, its innovations, its distance to the fixes.

Squares are compared by medians with those of chi-square, which outliers do not move: 1 is right, 4 is a standard deviation half
of what it should be. NIS: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), 5.4.
"""

import re
from collections import Counter
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from navreplay.evaluation.metrics import interpolate, normalised_squares
from navreplay.geodesy.earth import move_lla, ned_between
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats, GnssFixSeries, Times, Trajectory

__all__ = [
    "Closeness",
    "FixErrors",
    "KindUse",
    "compare_with_fixes",
    "compare_with_reference",
    "expected_accuracy",
    "position_noise",
    "use_of",
]

_FIGURE = re.compile(r"\d[\d.e+-]*")
_WINDOW_NS = 30_000_000_000
_LEAST_IN_WINDOW = 5
_IN_A_ROW = 5
"""Rejections in a row from which on they are no longer taken for outliers: faults of single fixes are shorter."""
_TOO_LARGE = 2.5
"""Median square over the expected one from which on rejections are what the told noise brings about, not outliers."""
_SAME_M = 1e-3
"""Fixes as near to a reference as this are the reference."""
_GAP_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class KindUse:
    """One kind of measurement. read = used + rejected. unexplained: of the rejected, those that outliers do not explain.
    reason: the most frequent one, empty without. nis: median normalised innovation square of all read over its expected
    value. windows: of 30 s; windows_off: those in which that is beyond 4."""

    kind: str
    read: int
    used: int
    rejected: int
    unexplained: int
    reason: str
    nis: float
    windows: int
    windows_off: int


@dataclass(frozen=True, slots=True)
class Closeness:
    """Horizontal distance of the solution to its fixes [m]: median, p95, over count fixes outside outages. square: median
    normalised square against both covariances over its expected value. windows: of 30 s; windows_off: those in which that is
    beyond 4."""

    count: int
    median: float
    p95: float
    square: float
    windows: int
    windows_off: int


@dataclass(frozen=True, slots=True)
class FixErrors:
    """Horizontal RMS errors [m] of fixes and solution against the reference, at the same count epochs outside outages.
    own: the reference is made of these fixes, and judges neither."""

    count: int
    fixes: float
    solution: float
    own: bool = False


def use_of(series: InnovationSeries) -> KindUse:
    """What became of the measurements of a kind."""
    rejected = ~series.used
    reasons = Counter(_FIGURE.sub("…", text) for text, bad in zip(series.reason, rejected.tolist(), strict=True) if bad)
    expected = _expected(np.isfinite(series.residual).sum(axis=1))
    ratio = series.nis / expected
    windows = _windows(series.t_ns, ratio)
    return KindUse(
        kind=series.kind,
        read=len(series.t_ns),
        used=int(series.used.sum()),
        rejected=int(rejected.sum()),
        unexplained=_count_unexplained(series, rejected, _median(ratio)),
        reason=reasons.most_common(1)[0][0] if reasons else "",
        nis=_median(ratio),
        windows=len(windows),
        windows_off=int((windows > 4).sum()),
    )


def _count_unexplained(series: InnovationSeries, rejected: NDArray[np.bool_], ratio: float) -> int:
    """Of the rejected: all, where the bulk of the kind is too far off for its noise; else those that stand in a row or, of
    satellites, in epochs of which more than half were rejected."""
    if not ratio <= _TOO_LARGE:
        return int(rejected.sum())
    if series.sources:
        _, epoch = np.unique(series.t_ns, return_inverse=True)
        lost = np.bincount(epoch, rejected) > np.bincount(epoch) / 2
        return int((rejected & lost[epoch]).sum())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rejected, [False]]).astype(np.int8)))
    runs = edges[1::2] - edges[::2]
    return int(runs[runs >= _IN_A_ROW].sum())


def _expected(dof: NDArray[np.int_]) -> Floats:
    """(k,) medians of chi-square."""
    return np.asarray(chdtri(np.maximum(dof, 1), 0.5))


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _windows(t_ns: Times, ratio: Floats) -> Floats:
    """Medians of ratio (k,) over windows of 30 s, of those that hold enough."""
    window = (t_ns - t_ns[0]) // _WINDOW_NS if len(t_ns) else t_ns
    parts = (ratio[window == number] for number in np.unique(window))
    return np.array([_median(part) for part in parts if len(part) >= _LEAST_IN_WINDOW])


def compare_with_fixes(
    solution: Solution, fixes: GnssFixSeries, lever_b: Floats, unaided: NDArray[np.bool_]
) -> Closeness | None:
    """Distance of a solution of the IMU to fixes of the antenna lever_b (3,) [m] from it; unaided (k,) are left out. The told
    covariances of the fixes count, and where the filter took others, those. None where no fix can be compared."""
    at = interpolate(solution, fixes.t_ns, max_step_s=inf)
    good = at.valid & fixes.has_position & ~unaided
    if not good.any():
        return None
    antenna = move_lla(at.lla[good], matrix_from_quat(at.q_nb[good]) @ lever_b)
    off = ned_between(antenna, fixes.lla[good])[:, :2]
    cov = at.cov[good, :2, :2] + _noise_at(solution, fixes, good)
    ratio = normalised_squares(off, cov) / chdtri(2, 0.5)
    distance = np.linalg.norm(off, axis=1)
    windows = _windows(fixes.t_ns[good], ratio)
    median, p95 = np.nanpercentile(distance, [50, 95]) if np.isfinite(distance).any() else (np.nan, np.nan)
    return Closeness(int(good.sum()), float(median), float(p95), _median(ratio), len(windows), int((windows > 4).sum()))


def _noise_at(solution: Solution, fixes: GnssFixSeries, rows: NDArray[np.bool_]) -> Floats:
    """(k, 2, 2) horizontal R of the fixes: as used where the filter took them up, else as told."""
    cov = fixes.cov_pos[rows, :2, :2].copy()
    for series in solution.innovations:
        if series.kind == "position" and not series.sources:
            _, here, there = np.intersect1d(fixes.t_ns[rows], series.t_ns, return_indices=True)
            cov[here] = np.square(series.noise_std[there, :2])[:, :, None] * np.eye(2)
    return np.asarray(cov)


def compare_with_reference(
    solution: Solution,
    fixes: GnssFixSeries,
    reference: Trajectory,
    levers_b: tuple[Floats, Floats],
    unaided: NDArray[np.bool_],
) -> FixErrors | None:
    """Errors of fixes and solution at the fixes' epochs. levers_b: from the IMU to the antenna and to the point of the
    reference. None where the reference, whose rows must lie within 1 s, covers no fix."""
    right = np.clip(np.searchsorted(reference.t_ns, fixes.t_ns), 1, max(len(reference) - 1, 1))
    if len(reference) < 2:
        return None
    span = reference.t_ns[right] - reference.t_ns[right - 1]
    share = (fixes.t_ns - reference.t_ns[right - 1]) / span
    at = interpolate(solution, fixes.t_ns, max_step_s=inf)
    good = at.valid & fixes.has_position & ~unaided & (share >= 0) & (share <= 1) & (span <= _GAP_NS)
    if not good.any():
        return None
    chord = ned_between(reference.lla[right - 1][good], reference.lla[right][good])
    truth = move_lla(reference.lla[right - 1][good], chord * share[good, None])
    turn = matrix_from_quat(at.q_nb[good])
    to_antenna, to_point = levers_b
    errors = (
        ned_between(truth, move_lla(fixes.lla[good], turn @ (to_point - to_antenna))),
        ned_between(truth, move_lla(at.lla[good], turn @ to_point)),
    )
    fix, own = (float(np.sqrt(np.mean(np.sum(np.square(error[:, :2]), axis=1)))) for error in errors)
    return FixErrors(int(good.sum()), fix, own, own=fix < _SAME_M)


def expected_accuracy(solution: Solution, factor: float, floor: float = 0.0) -> tuple[float, float]:
    """Median and 95 % over the rows of the horizontal standard deviation (root of the sum of both variances) [m], times
    factor, floor [m] at least."""
    std = np.maximum(factor * np.sqrt(solution.cov[:, 0, 0] + solution.cov[:, 1, 1]), floor)
    known = std[np.isfinite(std)]
    median, p95 = np.percentile(known, [50, 95]) if len(known) else (np.nan, np.nan)
    return float(median), float(p95)


def position_noise(solution: Solution) -> float:
    """Median of the horizontal standard deviation [m] that the filter took for its fixes; 0 without."""
    for series in solution.innovations:
        if series.kind == "position" and not series.sources:
            return float(np.median(np.linalg.norm(series.noise_std[:, :2], axis=1)))
    return 0.0
