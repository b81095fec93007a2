"""Single-epoch positions and velocities from ranges: iterated weighted least squares, all epochs at once.

Unknowns: antenna position and a clock offset per constellation in the epoch, from pseudoranges; velocity and one clock drift,
from range rates. Faulty measurements are excluded one after the other by the largest normalised residual (Baarda, A testing
procedure for use in geodetic networks, 1968). Levels and dilution of precision: Groves (2013), 9.4 and 9.4.3.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy import earth
from navreplay.measurements.range_epochs import RangeEpochs, arrange_ranges, correct_ranges
from navreplay.options import RangeOptions
from navreplay.timeline import FixStatus, Floats, GnssFixSeries, LogError, RangeSeries, Times

__all__ = ["PointSolution", "fixes_of", "interpolate_positions", "solve_points"]

_BLOCK = 2048
"""Epochs solved at a time, which bounds the memory."""
_FROM_CENTRE = 8
_REFINEMENTS = 3
_LIMIT = 3.3
"""Normalised residual beyond which a measurement is excluded: one good one in a thousand is."""
_MOST_EXCLUDED = 12
_WORST_DILUTION = 20.0
_GOOD_DILUTION = 6.0
_LEAST_RADIUS, _LARGEST_RADIUS = 6.0e6, 9.0e6


@dataclass(frozen=True, eq=False, slots=True)
class PointSolution:
    """Per epoch (e,), with g clock groups as named.

    pos_e (e, 3) [m] and vel_e (e, 3) [m/s], Earth-fixed, NaN where not solved. clock (e, g) [m], NaN for a constellation not
    in the epoch. drift (e,) [m/s]. cov_pos (e, 3 + g, 3 + g): position NED and clocks [m^2]; cov_vel (e, 4, 4): velocity NED
    and drift; from the told noise, enlarged where the residuals show more. dop (e, 4): geometric, position, horizontal,
    vertical. used, excluded (e,): pseudoranges that stand behind the position, and that contradicted the others.
    """

    t_ns: Times
    groups: tuple[str, ...]
    pos_e: Floats
    vel_e: Floats
    clock: Floats
    drift: Floats
    cov_pos: Floats
    cov_vel: Floats
    dop: Floats
    used: NDArray[np.intp]
    excluded: NDArray[np.intp]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(e,) epochs with a position."""
        return np.asarray(np.isfinite(self.pos_e[:, 0]))

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """(e,) epochs whose position a faulty satellite could not have bent unseen: two more are there than are needed, well
        spread. All that are solved, where there is no such epoch."""
        spare = self.used - 3 - np.isfinite(self.clock).sum(axis=1)
        good = self.solved & (spare >= 2) & (self.dop[:, 1] < _GOOD_DILUTION)
        return np.asarray(good if good.any() else self.solved)


class _Padded(NamedTuple):
    """Rows of a block of epochs as (e, m), present where True; group one-hot (e, m, g)."""

    present: NDArray[np.bool_]
    pseudorange: Floats
    rate: Floats
    weight: Floats
    rate_weight: Floats
    sat_pos_e: Floats
    sat_vel_e: Floats
    membership: Floats


class _Fit(NamedTuple):
    """Of a linear problem: solution (e, p), inverse normal matrix (e, p, p), weights left (e, m), weighted square of the
    residuals over redundancy (e,)."""

    solution: Floats
    cov: Floats
    weight: Floats
    variance: Floats


def solve_points(ranges: RangeSeries, options: RangeOptions) -> tuple[PointSolution, RangeEpochs, dict[str, int]]:
    """Points of all epochs, with the corrected ranges they came from and the rows left out, by reason.

    Raises LogError when no row may be used, or no epoch has enough satellites for a position.
    """
    epochs, left_out = arrange_ranges(ranges, options)
    rough = _solve_rough(epochs)
    if not np.isfinite(rough[:, 0]).any():
        most = int(np.diff(epochs.starts).max())
        raise LogError(
            f"ranges: no epoch can be solved for a position; the most satellites in one are {most}, of systems "
            f"{', '.join(epochs.groups)}, and a position needs three and one more per system"
        )
    corrected, low = correct_ranges(epochs, ranges, interpolate_positions(epochs.t_ns, rough), options)
    blocks = [_solve_block(corrected, rough, slice(i, i + _BLOCK)) for i in range(0, len(rough), _BLOCK)]
    columns = [np.concatenate(column) for column in zip(*blocks, strict=True)]
    return PointSolution(corrected.t_ns, corrected.groups, *columns), corrected, left_out | low


def interpolate_positions(t_ns: Times, pos_e: Floats) -> Floats:
    """pos_e (e, 3) at t_ns (e,) with the epochs that are NaN filled linearly from their neighbours."""
    known = np.isfinite(pos_e[:, 0])
    since = (t_ns - t_ns[0]) / 1e9
    return np.stack([np.interp(since, since[known], pos_e[known, axis]) for axis in range(3)], axis=1)


def fixes_of(points: PointSolution) -> GnssFixSeries:
    """The trusted epochs as fixes of a single-point receiver. Raises LogError when there are none."""
    solved = np.flatnonzero(points.trusted)
    if not len(solved):
        raise LogError("ranges: no epoch gives a position after faulty satellites are excluded")
    lla = earth.lla_from_ecef(points.pos_e[solved])
    c_en = earth.matrix_en(lla[:, 0], lla[:, 1])
    vel_n = np.einsum("kji,kj->ki", c_en, points.vel_e[solved])
    status = np.full(len(solved), FixStatus.SINGLE, dtype=np.int8)
    cov_pos, cov_vel = points.cov_pos[solved, :3, :3], points.cov_vel[solved, :3, :3]
    return GnssFixSeries(points.t_ns[solved], lla, vel_n, cov_pos, cov_vel, status)


def _solve_rough(epochs: RangeEpochs) -> Floats:
    """(e, 3) positions without weights or corrections, from the Earth's centre; NaN where there are too few satellites."""
    blocks = []
    for first in range(0, len(epochs.t_ns), _BLOCK):
        padded = _pad(epochs, slice(first, first + _BLOCK))
        flat = padded._replace(weight=padded.present.astype(np.float64))
        pos_e = np.zeros((len(flat.present), 3))
        for _ in range(_FROM_CENTRE):
            design, misfit, _ = _linearise(flat, pos_e)
            pos_e = pos_e + _fit(design, misfit, flat.weight).solution[:, :3]
        radius = np.linalg.norm(pos_e, axis=1)
        good = (_redundancy(flat.weight, flat.membership) >= 0) & (radius > _LEAST_RADIUS) & (radius < _LARGEST_RADIUS)
        blocks.append(np.where(good[:, None], pos_e, np.nan))
    return np.concatenate(blocks)


def _solve_block(epochs: RangeEpochs, rough: Floats, block: slice) -> tuple[np.ndarray, ...]:
    padded = _pad(epochs, block)
    start = rough[block]
    pos_e = np.where(np.isfinite(start), start, [earth.SEMI_MAJOR_AXIS, 0.0, 0.0])
    for _ in range(_REFINEMENTS):
        design, misfit, _ = _linearise(padded, pos_e)
        fit = _exclude(design, misfit, padded.weight, padded.membership)
        pos_e = pos_e + fit.solution[:, :3]
    redundancy = _redundancy(fit.weight, padded.membership)
    unit = _inverse_normal(design, (fit.weight > 0).astype(np.float64))
    seen = np.asarray((padded.membership * (fit.weight > 0)[..., None]).any(axis=1))
    towards_n = _to_local(pos_e, len(epochs.groups))
    dop = _dilution(towards_n @ unit @ np.swapaxes(towards_n, 1, 2), seen)
    solved = np.isfinite(start[:, 0]) & (redundancy >= 0) & (dop[:, 1] < _WORST_DILUTION)
    cov_pos = towards_n @ (fit.cov * np.maximum(fit.variance, 1)[:, None, None]) @ np.swapaxes(towards_n, 1, 2)
    vel_e, drift, cov_vel = _solve_velocity(padded, design, fit.weight, pos_e, solved)
    used = (fit.weight > 0).sum(axis=1)
    return (
        np.where(solved[:, None], pos_e, np.nan),
        vel_e,
        np.where(seen & solved[:, None], fit.solution[:, 3:], np.nan),
        drift,
        np.where(solved[:, None, None], cov_pos, np.nan),
        cov_vel,
        np.where(solved[:, None], dop, np.nan),
        used,
        padded.present.sum(axis=1) - used,
    )


def _solve_velocity(
    padded: _Padded, design: Floats, left: Floats, pos_e: Floats, solved: NDArray[np.bool_]
) -> tuple[Floats, Floats, Floats]:
    """Velocity (e, 3), drift (e,) and their covariance (e, 4, 4), from the rates of the satellites that gave the position."""
    weight = np.where(left > 0, padded.rate_weight, 0.0)
    lines = np.concatenate([design[..., :3], np.ones((*weight.shape, 1))], axis=2)
    seen = np.nan_to_num(padded.rate) + np.einsum("emi,emi->em", design[..., :3], padded.sat_vel_e)
    one_clock = np.ones((*weight.shape, 1))
    fit = _exclude(lines, seen, weight, one_clock)
    good = solved & (_redundancy(fit.weight, one_clock) >= 0)
    towards_n = _to_local(pos_e, 1)
    cov = towards_n @ (fit.cov * np.maximum(fit.variance, 1)[:, None, None]) @ np.swapaxes(towards_n, 1, 2)
    unknown = np.where(good, 0.0, np.nan)
    return fit.solution[:, :3] + unknown[:, None], fit.solution[:, 3] + unknown, cov + unknown[:, None, None]


def _pad(epochs: RangeEpochs, block: slice) -> _Padded:
    first, last = epochs.starts[:-1][block], epochs.starts[1:][block]
    widest = max(int((last - first).max()), 1)
    index = first[:, None] + np.arange(widest)
    present = index < last[:, None]
    rows = np.minimum(index, len(epochs.sat) - 1)
    weight = np.where(present, _weights(epochs.pseudorange_std)[rows], 0.0)
    has_rate = present & np.isfinite(epochs.range_rate[rows])
    rate_weight = np.where(has_rate, _weights(epochs.range_rate_std)[rows], 0.0)
    membership = (epochs.group[rows][..., None] == np.arange(len(epochs.groups))) & present[..., None]
    return _Padded(
        present,
        epochs.pseudorange[rows],
        epochs.range_rate[rows],
        weight,
        rate_weight,
        epochs.sat_pos_e[rows],
        epochs.sat_vel_e[rows],
        membership.astype(np.float64),
    )


def _weights(std: Floats) -> Floats:
    """Before correction the noise may be unknown, and weights do not matter."""
    return np.where(np.nan_to_num(std) > 0, std, 1.0) ** -2.0


def _linearise(padded: _Padded, pos_e: Floats) -> tuple[Floats, Floats, Floats]:
    """Design (e, m, 3 + g), pseudorange less distance (e, m) and distance (e, m) at pos_e (e, 3)."""
    towards = padded.sat_pos_e - pos_e[:, None, :]
    distance = np.linalg.norm(towards, axis=2)
    design = np.concatenate([-towards / distance[..., None], padded.membership], axis=2)
    return design, padded.pseudorange - distance, distance


def _inverse_normal(design: Floats, weight: Floats) -> Floats:
    """(e, p, p); an unknown that no measurement speaks of gets a row of the unit matrix."""
    normal = np.einsum("emp,em,emq->epq", design, weight, design, optimize=True)
    size = np.diagonal(normal, axis1=1, axis2=2)
    dead = size <= 0
    scale = np.sqrt(np.where(dead, 1.0, size))
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    # where there are too few measurements the matrix is singular; those epochs are recognised by their number
    unit = np.eye(normal.shape[1])
    scaled = scaled + unit * np.where(dead, 1.0, 1e-12)[:, :, None]
    return np.asarray(np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :]))


def _fit(design: Floats, misfit: Floats, weight: Floats) -> _Fit:
    inverse = _inverse_normal(design, weight)
    solution = np.einsum("epq,emq,em->ep", inverse, design, weight * misfit, optimize=True)
    return _Fit(solution, inverse, weight, np.zeros(len(weight)))


def _redundancy(weight: Floats, membership: Floats) -> NDArray[np.intp]:
    """(e,) measurements beyond three and one for each clock offset among them."""
    alive = weight > 0
    clocks = (membership * alive[..., None]).any(axis=1).sum(axis=1)
    return np.asarray(alive.sum(axis=1) - 3 - np.maximum(clocks, 1))


def _exclude(design: Floats, misfit: Floats, weight: Floats, membership: Floats) -> _Fit:
    """Weighted fit, with the worst measurement left out again and again where it contradicts the others and two more would
    remain than are needed: with one to spare a fault shows, but not whose it is."""
    fit = _fit(design, misfit, weight)
    solution, cov, left = fit.solution.copy(), fit.cov.copy(), weight.copy()
    variance = np.ones(len(weight))
    open_ = np.arange(len(weight))
    for _ in range(_MOST_EXCLUDED + 1):
        residual = misfit[open_] - np.einsum("emp,ep->em", design[open_], solution[open_])
        share = np.einsum("emp,epq,emq->em", design[open_], cov[open_], design[open_], optimize=True) * left[open_]
        normalised = np.abs(residual) * np.sqrt(left[open_] / np.maximum(1 - share, 1e-6))
        normalised[share > 1 - 1e-6] = 0
        redundancy = _redundancy(left[open_], membership[open_])
        variance[open_] = (left[open_] * residual**2).sum(axis=1) / np.maximum(redundancy, 1)
        worst = normalised.argmax(axis=1)
        failed = (normalised.max(axis=1) > _LIMIT) & (redundancy > 1)
        if not failed.any():
            break
        open_, worst = open_[failed], worst[failed]
        left[open_, worst] = 0
        again = _fit(design[open_], misfit[open_], left[open_])
        solution[open_], cov[open_] = again.solution, again.cov
    return _Fit(solution, cov, left, variance)


def _to_local(pos_e: Floats, clocks: int) -> Floats:
    """(e, 3 + clocks, 3 + clocks) that turns Earth-fixed coordinates into NED and leaves clocks alone."""
    lla = earth.lla_from_ecef(pos_e)
    turn = np.tile(np.eye(3 + clocks), (len(pos_e), 1, 1))
    turn[:, :3, :3] = np.swapaxes(earth.matrix_en(lla[:, 0], lla[:, 1]), 1, 2)
    return turn


def _dilution(unit_n: Floats, seen: NDArray[np.bool_]) -> Floats:
    """(e, 4) geometric, position, horizontal and vertical dilution from unweighted covariances in NED (e, 3 + g, 3 + g)."""
    squares = np.diagonal(unit_n, axis1=1, axis2=2)
    clocks = np.where(seen, squares[:, 3:], 0.0).sum(axis=1)
    position = squares[:, :3].sum(axis=1)
    return np.sqrt(np.stack([position + clocks, position, squares[:, :2].sum(axis=1), squares[:, 2]], axis=1))
