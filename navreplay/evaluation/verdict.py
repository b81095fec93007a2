"""The verdict on a run: good, fair or poor, and why.

A run is poor where what it says cannot be believed: the solution is not finite; more than 5 % of a kind were rejected and
outliers do not explain it (they stand five or more in a row, or the bulk of the kind lies too far off for the noise that was
taken); a kind's innovations, or the fixes' distances to the solution, have a median square of more than 4 times the expected
one, or have so in more than a tenth of the windows of 30 s; the filter was started anew three times; or a reference shows the
solution at more than twice the error of its fixes, or at more than five times the error that it expects of itself. It is fair
where there is something of that to a lesser degree.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from navreplay.evaluation.credit import (
    Closeness,
    FixErrors,
    KindUse,
    compare_with_fixes,
    compare_with_reference,
    expected_accuracy,
    position_noise,
    use_of,
)
from navreplay.evaluation.metrics import Evaluation
from navreplay.evaluation.outages import find_outages, mark_unaided
from navreplay.solution import Outage, Solution
from navreplay.timeline import GnssFixSeries, Timeline

__all__ = ["Fault", "Grade", "Verdict", "judge"]

Grade = Literal["good", "fair", "poor"]

_POOR_SHARE, _FAIR_SHARE = 0.05, 0.02
_POOR_SQUARE, _FAIR_SQUARE = 4.0, 2.5
_POOR_WINDOWS = 0.1
_POOR_RESTARTS = 3
_POOR_BESIDE_FIXES, _FAIR_BESIDE_FIXES = 2.0, 1.2
_POOR_BESIDE_EXPECTED, _FAIR_BESIDE_EXPECTED = 5.0, 2.5
_TOLD_WRONG = 2.0
_LONG_OUTAGE_S = 60.0
_LEAST = 20
"""Measurements of a kind below which shares of them mean nothing."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What speaks against a run. code: ``finite``, ``rejected``, ``innovations``, ``windows``, ``distance``, ``far-windows``,
    ``restarts``, ``reference``, ``expected``, ``told``, ``backward`` or ``outage``. kind: of the measurements,
    where it is theirs. value: the share, ratio, number or seconds that is too large."""

    grade: Grade
    code: str
    kind: str
    value: float


@dataclass(frozen=True, eq=False, slots=True)
class Verdict:
    """grade: the worst of the faults', good without any. faults: the worst first. kinds: of measurements. closeness: to the
    fixes, or to the least-squares positions of ranges. fix_errors: beside those, where there is a reference. backward: see
    `Solution`. accuracy: expected horizontal,
    median and 95 % [m]: the covariance's times calibration, the larger of 1 and the root of the positions' NIS; where the log's
    accuracy of positions is refuted, that which was taken for a fix at least, since such errors stay.
    events: counts by kind. outages: number of stretches without positions, and the longest [s]. by_points: closeness and
    fix_errors are of least-squares positions of single epochs, whose own outliers do not speak against the solution."""

    grade: Grade
    faults: tuple[Fault, ...]
    kinds: tuple[KindUse, ...]
    closeness: Closeness | None
    fix_errors: FixErrors | None
    backward: float | None
    accuracy: tuple[float, float]
    calibration: float
    events: Mapping[str, int]
    outages: tuple[int, float]
    by_points: bool = False


def judge(
    solution: Solution, timeline: Timeline, points: GnssFixSeries | None = None, evaluation: Evaluation | None = None
) -> Verdict:
    """The verdict on a solution of the IMU (or, without one, of the antenna); timeline: what it was made of, with the reference
    where there is one; points: least-squares positions of the ranges it was made of; evaluation: by the reference."""
    kinds = tuple(use_of(series) for series in solution.innovations)
    outages = solution.outages or find_outages(solution)
    closeness, fix_errors = _beside_fixes(solution, timeline, points, outages)
    calibration = max([1.0, *(use.nis for use in kinds if use.kind in ("position", "range") and use.nis > 1)]) ** 0.5
    lengths = [(outage.end_ns - outage.start_ns) / 1e9 for outage in outages]
    events = {kind: sum(event.kind == kind for event in solution.events) for kind in ("restart", "lock-out")}
    faults = [fault for use in kinds for fault in _faults_of(use)]
    faults += _faults_of_distance(closeness, fix_errors, points is not None)
    faults += _faults_of_run(solution, events["restart"], max(lengths, default=0.0))
    refuted = _refuted_noise(solution)
    faults += [Fault("fair", "told", kind, scale) for kind, scale in refuted.items()]
    floor = position_noise(solution) if "position" in refuted else 0.0
    accuracy = expected_accuracy(solution, calibration, floor)
    if evaluation is not None and not (fix_errors is not None and fix_errors.own):
        faults += _faults_of_claim(evaluation, accuracy[0])
    faults.sort(key=lambda fault: fault.grade, reverse=True)  # poor, then fair
    return Verdict(
        grade=faults[0].grade if faults else "good",
        faults=tuple(faults),
        kinds=kinds,
        closeness=closeness,
        fix_errors=fix_errors,
        backward=solution.backward,
        accuracy=accuracy,
        calibration=calibration,
        events=events,
        outages=(len(outages), max(lengths, default=0.0)),
        by_points=points is not None,
    )


def _beside_fixes(
    solution: Solution, timeline: Timeline, points: GnssFixSeries | None, outages: tuple[Outage, ...]
) -> tuple[Closeness | None, FixErrors | None]:
    fixes = timeline.fixes if points is None else points
    if fixes is None or len(solution) < 2 or not np.isfinite(solution.lla).all():
        return None, None
    unaided = mark_unaided(fixes.t_ns, solution, outages)
    arm = timeline.fix_lever_b if timeline.imu is not None else np.zeros(3)
    if points is None and not any(series.kind == "position" and not series.sources for series in solution.innovations):
        return None, None  # fixes that the filter was not given are no measure of it
    closeness = compare_with_fixes(solution, fixes, arm, unaided)
    if timeline.reference is None:
        return closeness, None
    to_point = timeline.reference_lever_b + arm - timeline.fix_lever_b
    return closeness, compare_with_reference(solution, fixes, timeline.reference, (arm, to_point), unaided)


def _refuted_noise(solution: Solution) -> dict[str, float]:
    """By kind the factors on told standard deviations that a method found necessary, those that are large."""
    scales = {name.removesuffix("_noise_scale"): value for name, value in solution.estimated.items() if name.endswith("_scale")}
    return {kind: value for kind, value in scales.items() if isinstance(value, float) and value > _TOLD_WRONG}


def _graded(code: str, kind: str, value: float, poor: float, fair: float) -> list[Fault]:
    if value > poor:
        return [Fault("poor", code, kind, value)]
    return [Fault("fair", code, kind, value)] if value > fair else []


def _faults_of(use: KindUse) -> list[Fault]:
    if use.read < _LEAST:
        return []
    off = use.windows_off / use.windows if use.windows else 0.0
    return [
        *_graded("rejected", use.kind, use.unexplained / use.read, _POOR_SHARE, _FAIR_SHARE),
        *_graded("innovations", use.kind, use.nis, _POOR_SQUARE, _FAIR_SQUARE),
        *_graded("windows", use.kind, off, _POOR_WINDOWS, 0.0),
    ]


def _faults_of_distance(closeness: Closeness | None, fix_errors: FixErrors | None, by_points: bool) -> list[Fault]:
    faults = []
    if closeness is not None and closeness.count >= _LEAST:
        off = closeness.windows_off / closeness.windows if closeness.windows else 0.0
        faults += _graded("distance", "", closeness.square, _POOR_SQUARE, _FAIR_SQUARE)
        faults += [] if faults or by_points else _graded("far-windows", "", off, _POOR_WINDOWS, 0.0)
    if fix_errors is not None and fix_errors.count >= _LEAST and not fix_errors.own:
        ratio = fix_errors.solution / fix_errors.fixes
        faults += _graded("reference", "", ratio, _POOR_BESIDE_FIXES, _FAIR_BESIDE_FIXES)
    return faults


def _faults_of_claim(evaluation: Evaluation, expected: float) -> list[Fault]:
    """Of what the solution says of itself, where a reference knows better."""
    outside = evaluation.statistics["outside"]["position"]["horizontal"]
    if outside.count < _LEAST or not expected > 0:
        return []
    return _graded("expected", "", outside.p50 / expected, _POOR_BESIDE_EXPECTED, _FAIR_BESIDE_EXPECTED)


def _faults_of_run(solution: Solution, restarts: int, longest_s: float) -> list[Fault]:
    faults = []
    bad = len(solution) - int(
        np.isfinite(np.concatenate([solution.lla, solution.vel_n, solution.q_nb], axis=1)).all(axis=1).sum()
    )
    if bad:
        faults.append(Fault("poor", "finite", "", bad / len(solution)))
    faults += _graded("restarts", "", restarts, _POOR_RESTARTS - 1, 0)
    if solution.backward is not None and solution.backward > _POOR_SQUARE:
        faults.append(Fault("fair", "backward", "", solution.backward))
    if longest_s > _LONG_OUTAGE_S:
        faults.append(Fault("fair", "outage", "", longest_s))
    return faults
