"""Velocities against the motion of the positions: over windows of some seconds, displacement against the integral of velocity.

With v measured = s v(t - d), a window's displacement is (1/s) times the integral plus (d/s) times the change of velocity: two
regressors whose noise is small against the displacement, whatever the noise of a single fix. Axis by axis, NED.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.earth import ned_between
from navreplay.timeline import Floats, GnssFixSeries, Times

__all__ = ["Fit", "Windows", "fit", "gather_windows"]

_WINDOW_S = 10.0
_LONGEST_STEP_S = 2.5
_LEAST_WINDOWS = 12
_OUTLIER = 4.0


class Windows(NamedTuple):
    """moved (k, 3): displacements of the positions [m]; summed (k, 3): integrals of the velocity [m]; changed (k, 3): changes
    of the velocity [m/s]; start_s (k,); apart (float): windows that overlap count as this share of an independent one. scatter
    (3,): standard deviation of a displacement by the noise of the fixes, at most [m]."""

    moved: Floats
    summed: Floats
    changed: Floats
    start_s: Floats
    apart: float
    scatter: Floats


class Fit(NamedTuple):
    """scale: of the velocity, s above, with standard deviation scale_std. delay: d [s], with delay_std. explained: share of the
    displacements' power that is left unexplained, 0 to 1 and more."""

    scale: float
    scale_std: float
    delay: float
    delay_std: float
    left: float


def gather_windows(fixes: GnssFixSeries) -> Windows | None:
    """Windows without gaps in positions or velocities; None where there are too few."""
    at_p, at_v = np.flatnonzero(fixes.has_position), np.flatnonzero(fixes.has_velocity)
    if min(len(at_p), len(at_v)) < 2 * _LEAST_WINDOWS:
        return None
    t_p, t_v = _seconds(fixes, at_p), _seconds(fixes, at_v)
    place = ned_between(np.broadcast_to(fixes.lla[at_p[0]], (len(at_p), 3)), fixes.lla[at_p])
    vel = fixes.vel_n[at_v]
    steps = np.diff(t_v)
    total = np.vstack([np.zeros(3), np.cumsum((vel[1:] + vel[:-1]) / 2 * steps[:, None], axis=0)])
    longest = max(_LONGEST_STEP_S, 2.5 * float(np.median(steps)), 2.5 * float(np.median(np.diff(t_p))))
    window = max(_WINDOW_S, 4 * longest)
    ends = np.searchsorted(t_p, t_p + window)
    starts = np.flatnonzero(ends < len(t_p))
    ends = ends[starts]
    whole = (t_p[starts] >= t_v[0]) & (t_p[ends] <= t_v[-1])
    for t in (t_p, t_v):
        broken = np.concatenate([[0], np.cumsum(np.diff(t) > longest)])
        before, behind = (np.interp(t_p[edge], t, broken) for edge in (starts, ends))
        whole &= behind - before < 0.5
    starts, ends = starts[whole], ends[whole]
    if len(starts) < _LEAST_WINDOWS:
        return None
    every = max(1, len(starts) // 2000)
    starts, ends = starts[::every], ends[::every]
    summed, speed = (np.column_stack([np.interp(t_p, t_v, part[:, i]) for i in range(3)]) for part in (total, vel))
    apart = float(np.median(np.diff(t_p[starts]))) / window if len(starts) > 1 else 1.0
    scatter = np.sqrt(2.0) * _roughness(t_p, place)
    differences = (part[ends] - part[starts] for part in (place, summed, speed))
    return Windows(*differences, t_p[starts], min(apart, 1.0), scatter)


def _seconds(fixes: GnssFixSeries, rows: NDArray[np.intp]) -> Floats:
    t_ns: Times = fixes.t_ns[rows]
    return np.asarray((t_ns - fixes.t_ns[0]) / 1e9)


def _roughness(t: Floats, place: Floats) -> Floats:
    """(3,) noise of positions by their third differences, which motion passes on to little of."""
    third = np.diff(place, 3, axis=0)
    return np.asarray(np.median(np.abs(third), axis=0) * 1.4826 / np.sqrt(20.0))


def fit(moved: Floats, summed: Floats, changed: Floats, apart: float) -> Fit:
    """The scale and delay of velocities, from displacements, integrals and changes (k,) of one axis, or of several behind each
    other. Outlying windows are left out in a second look."""
    design = np.column_stack([summed, changed])
    good = np.ones(len(moved), dtype=np.bool_)
    for _ in range(2):
        normal = design[good].T @ design[good] + 1e-9 * np.eye(2)
        solution = np.linalg.solve(normal, design[good].T @ moved[good])
        residual = moved - design @ solution
        spread = 1.4826 * float(np.median(np.abs(residual[good])))
        good = np.abs(residual) <= _OUTLIER * spread + 1e-9
    independent = max(float(good.sum()) * apart, 3.0)
    power = max(float(np.mean(moved[good] ** 2)), 1e-12)
    variance = float(np.mean(residual[good] ** 2)) * independent / max(independent - 2, 1.0)
    cov = np.linalg.inv(normal / float(good.sum())) * variance / independent
    inverse = float(solution[0])
    inverse = inverse if abs(inverse) > 1e-6 else 1e-6
    return Fit(
        1 / inverse,
        float(np.sqrt(cov[0, 0])) / inverse**2,
        float(solution[1]) / inverse,
        float(np.sqrt(cov[1, 1])) / abs(inverse),
        float(np.mean(residual[good] ** 2)) / power,
    )
