"""Errors of a solution against a reference, and whether its covariance told the truth about them.

Errors are estimated minus reference. The statistics themselves are in `statistics`, outages in `outages`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.evaluation.outages import OutageErrors, assess_outages, find_outages, mark_unaided, summarise_outages
from navreplay.evaluation.statistics import Consistency, Statistics, compute_nis, judge_squares, summarise
from navreplay.geodesy.earth import frame_turn_n, move_lla, ned_between, quat_en
from navreplay.geodesy.rotation import matrix_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat, skew
from navreplay.solution import Solution
from navreplay.timeline import Floats, LogError, Times, Trajectory

__all__ = [
    "Consistency",
    "ErrorSeries",
    "Evaluation",
    "Interpolated",
    "OutageErrors",
    "Statistics",
    "assess_outages",
    "compute_nis",
    "evaluate",
    "find_outages",
    "interpolate",
    "normalised_squares",
    "summarise",
    "summarise_outages",
]

_AXES = ("north", "east", "down")
_ATTITUDE_AXES = ("north", "east", "heading")


@dataclass(frozen=True, eq=False, slots=True)
class ErrorSeries:
    """Errors of one quantity. labels: of the three axes. unit: m, m/s or rad. error: (k, 3). std: (k, 3) from the covariance.
    nees: (k,), the reference's covariance included where known. Attitude is the rotation vector in n from the reference's
    attitude to the estimated one; its third component is the error of heading. NaN where the reference is unknown."""

    labels: tuple[str, str, str]
    unit: str
    error: Floats
    std: Floats
    nees: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Evaluation:
    """A solution judged by a reference, at the k reference epochs that the solution covers.

    t_ns: (k,). errors: by quantity: position, and velocity and attitude where the reference knows them; where attitudes were
    measured also inertial_attitude, against Earth-fixed axes (and so the stars) but resolved in NED, of which the position is
    no part as it is of attitude, NED turning with it. in_outage: (k,)
    bool, see `mark_unaided`. statistics: by stretch (all, outside, inside outages), quantity and component (the labels;
    horizontal and 3d for position and velocity). nees: by quantity. within_3_sigma: share of errors by quantity and label
    (0.9973 expected).
    """

    t_ns: Times
    errors: Mapping[str, ErrorSeries]
    in_outage: NDArray[np.bool_]
    statistics: Mapping[str, Mapping[str, Mapping[str, Statistics]]]
    nees: Mapping[str, Consistency]
    within_3_sigma: Mapping[str, Mapping[str, float]]
    outages: tuple[OutageErrors, ...]


class Interpolated(NamedTuple):
    """A solution at m epochs: valid (m,) bool, lla (m, 3), vel_n (m, 3), q_nb (m, 4), mean body rate between the rows
    around rate_b (m, 3) [rad/s], cov (m, 9, 9) of position, velocity and attitude. Rows that are not valid hold no meaning."""

    valid: NDArray[np.bool_]
    lla: Floats
    vel_n: Floats
    q_nb: Floats
    rate_b: Floats
    cov: Floats


def interpolate(solution: Solution, t_ns: Times, max_step_s: float = 0.6) -> Interpolated:
    """The solution at t_ns (m,): cubic Hermite in position, linear in velocity and covariance, constant rate in attitude.

    Valid where a row coincides or two rows at most max_step_s [s] apart surround the epoch. Raises LogError for a solution
    of fewer than two rows.
    """
    if len(solution) < 2:
        raise LogError(f"solution: {len(solution)} row(s) are too few to compare with a reference; the log ends too early")
    rows = solution.t_ns
    left = np.clip(np.searchsorted(rows, t_ns, side="right") - 1, 0, len(rows) - 2)
    right = left + 1
    step = (rows[right] - rows[left]) / 1e9
    x = (t_ns - rows[left]) / 1e9 / step
    valid = (x >= 0) & (x <= 1) & ((step <= max_step_s) | (x == 0) | (x == 1))
    x, dt = np.clip(x, 0, 1)[:, None], step[:, None]
    chord = ned_between(solution.lla[left], solution.lla[right])
    start_slope, end_slope = solution.vel_n[left] * dt, solution.vel_n[right] * dt
    offset = x * (1 - x) * ((1 - x) * start_slope - x * end_slope) + x**2 * (3 - 2 * x) * chord
    late = x >= 0.5
    base = np.where(late, solution.lla[right], solution.lla[left])
    turn = rotvec_from_quat(quat_multiply(quat_conjugate(solution.q_nb[left]), solution.q_nb[right]))
    cov = solution.cov[:, :9, :9]
    return Interpolated(
        valid=valid,
        lla=move_lla(base, np.where(late, offset - chord, offset)),
        vel_n=(1 - x) * solution.vel_n[left] + x * solution.vel_n[right],
        q_nb=quat_multiply(solution.q_nb[left], quat_from_rotvec(x * turn)),
        rate_b=turn / dt,
        cov=(1 - x[..., None]) * cov[left] + x[..., None] * cov[right],
    )


def normalised_squares(error: Floats, cov: Floats) -> Floats:
    """error' cov^-1 error (k,), NaN where a row is unknown or its covariance is not positive."""
    good = np.asarray(np.isfinite(error).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)))
    good[good] = np.linalg.det(cov[good]) > 0
    squared = np.full(len(error), np.nan)
    squared[good] = np.einsum("ki,ki->k", error[good], np.linalg.solve(cov[good], error[good][..., None])[..., 0])
    return squared


def _series(
    labels: tuple[str, str, str], unit: str, error: Floats, cov: Floats, reference_cov: Floats | None = None
) -> ErrorSeries:
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    if reference_cov is not None:
        cov = cov + np.where(np.isfinite(reference_cov), reference_cov, 0.0)
    return ErrorSeries(labels, unit, error, std, normalised_squares(error, cov))


def _measure_errors(at: Interpolated, reference: Trajectory, lever_b: Floats) -> dict[str, ErrorSeries]:
    """Errors of the point lever_b off the IMU; the rows of at and reference correspond."""
    matrix = matrix_from_quat(at.q_nb)
    arm = matrix @ lever_b
    swing = np.einsum("kij,kj->ki", matrix, np.cross(at.rate_b, lever_b))
    errors = {}
    position = ned_between(reference.lla, move_lla(at.lla, arm))
    errors["position"] = _series(_AXES, "m", position, _cov_at(at.cov, slice(0, 3), arm), reference.cov_pos)
    velocity = at.vel_n + swing - reference.vel_n
    if np.isfinite(velocity).any():
        errors["velocity"] = _series(_AXES, "m/s", velocity, _cov_at(at.cov, slice(3, 6), swing))
    attitude = rotvec_from_quat(quat_multiply(at.q_nb, quat_conjugate(reference.q_nb)))
    if np.isfinite(attitude).any():
        errors["attitude"] = _series(_ATTITUDE_AXES, "rad", attitude, at.cov[:, 6:9, 6:9])
    return errors


def _inertial_attitude(at: Interpolated, reference: Trajectory) -> ErrorSeries:
    """Rotation vector from the reference's attitude in Earth-fixed axes to the estimated one, in NED at the reference."""
    q_en = quat_en(reference.lla[:, 0], reference.lla[:, 1])
    estimated = quat_multiply(quat_en(at.lla[:, 0], at.lla[:, 1]), at.q_nb)
    error_e = rotvec_from_quat(quat_multiply(estimated, quat_conjugate(quat_multiply(q_en, reference.q_nb))))
    error = np.einsum("kji,kj->ki", matrix_from_quat(q_en), error_e)
    turn = np.array([frame_turn_n(lla) for lla in at.lla])
    mixed = turn @ at.cov[:, :3, 6:9]
    cov = at.cov[:, 6:9, 6:9] + mixed + np.swapaxes(mixed, 1, 2) + turn @ at.cov[:, :3, :3] @ np.swapaxes(turn, 1, 2)
    return _series(_ATTITUDE_AXES, "rad", error, cov)


def _cov_at(cov: Floats, block: slice, moved: Floats) -> Floats:
    """Covariance (k, 3, 3) of a block of states plus phi x moved, the error of a vector that turns with the attitude."""
    cross = -skew(moved)
    mixed = cov[:, block, 6:9] @ np.swapaxes(cross, 1, 2)
    return np.asarray(
        cov[:, block, block] + mixed + np.swapaxes(mixed, 1, 2) + cross @ cov[:, 6:9, 6:9] @ np.swapaxes(cross, 1, 2)
    )


def _summarise_errors(errors: Mapping[str, ErrorSeries], rows: NDArray[np.bool_]) -> dict[str, dict[str, Statistics]]:
    tables = {}
    for quantity, series in errors.items():
        error = series.error[rows]
        table = {label: summarise(error[:, i]) for i, label in enumerate(series.labels)}
        if quantity in ("position", "velocity"):
            table["horizontal"] = summarise(np.linalg.norm(error[:, :2], axis=1))
            table["3d"] = summarise(np.linalg.norm(error, axis=1))
        tables[quantity] = table
    return tables


def _share_within(series: ErrorSeries) -> dict[str, float]:
    known = np.isfinite(series.error)
    within = np.abs(series.error) <= 3 * series.std
    return {
        label: float(within[known[:, i], i].mean()) if known[:, i].any() else float("nan")
        for i, label in enumerate(series.labels)
    }


def _select_rows(at: Interpolated) -> Interpolated:
    ok = at.valid
    return Interpolated(ok[ok], at.lla[ok], at.vel_n[ok], at.q_nb[ok], at.rate_b[ok], at.cov[ok])


def _select(reference: Trajectory, rows: NDArray[np.bool_]) -> Trajectory:
    return Trajectory(
        reference.t_ns[rows], reference.lla[rows], reference.vel_n[rows], reference.q_nb[rows], reference.cov_pos[rows]
    )


def evaluate(solution: Solution, reference: Trajectory, lever_b: Floats | None = None, max_step_s: float = 0.6) -> Evaluation:
    """The solution (of the IMU) against a reference of the point lever_b (3,) [m] from the IMU, body axes.

    Judged at the reference's epochs that `interpolate` covers; outages are the solution's own or, where it names none, those
    of `find_outages`. Raises LogError when no epoch of the reference lies in the solution.
    """
    at = interpolate(solution, reference.t_ns, max_step_s)
    if not at.valid.any():
        raise LogError(
            "reference: no epoch of it lies within the solution; is it of another day, or in another time scale "
            "(UTC taken for GPS)?"
        )
    reference = _select(reference, at.valid)
    covered = _select_rows(at)
    errors = _measure_errors(covered, reference, np.zeros(3) if lever_b is None else lever_b)
    if "attitude" in errors and any(series.kind == "attitude" for series in solution.innovations):
        errors["inertial_attitude"] = _inertial_attitude(covered, reference)
    outages = solution.outages or find_outages(solution)
    in_outage = mark_unaided(reference.t_ns, solution, outages)
    stretches = {"all": np.ones(len(reference), dtype=np.bool_), "outside": ~in_outage, "inside": in_outage}
    return Evaluation(
        t_ns=reference.t_ns,
        errors=errors,
        in_outage=in_outage,
        statistics={name: _summarise_errors(errors, rows) for name, rows in stretches.items()},
        nees={quantity: judge_squares(series.nees, 3) for quantity, series in errors.items()},
        within_3_sigma={quantity: _share_within(series) for quantity, series in errors.items()},
        outages=assess_outages(solution, outages, reference, reference.t_ns, errors["position"].error),
    )
