"""The verdict: good on what is consistent, poor on each thing that must not pass."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.evaluation.credit import use_of
from navreplay.evaluation.metrics import evaluate
from navreplay.evaluation.verdict import Verdict, judge
from navreplay.geodesy.earth import move_lla
from navreplay.solution import Event, InnovationSeries, Solution
from navreplay.timeline import Timeline
from tests.helpers.sample_drive import START_NS, make_solution, make_timeline

COUNT = 400


def series(scale: float = 1.0, rejected: slice | np.ndarray | None = None, seed: int = 3) -> InnovationSeries:
    """Positions whose innovations are scale times as large as their covariance says."""
    residual = np.random.default_rng(seed).standard_normal((COUNT, 3)) * scale
    used = np.ones(COUNT, dtype=bool)
    used[[] if rejected is None else rejected] = False
    one = np.ones((COUNT, 3))
    t_ns = START_NS + np.arange(COUNT) * 1_000_000_000
    reason = tuple("" if good else f"innovation {k}.5 beyond the gate of 21.1" for k, good in enumerate(used))
    return InnovationSeries(
        "position", ("north", "east", "down"), "m", t_ns, residual, one, one, one, np.sum(residual**2, axis=1), used, reason
    )


@pytest.fixture(scope="module")
def solution() -> Solution:
    return make_solution(duration_s=120.0, outage_s=0.0)


@pytest.fixture(scope="module")
def timeline(solution: Solution) -> Timeline:
    return make_timeline(solution)


def codes(verdict: Verdict, grade: str) -> set[str]:
    return {fault.code for fault in verdict.faults if fault.grade == grade}


def with_innovations(solution: Solution, innovations: InnovationSeries) -> Solution:
    return replace(solution, innovations=(innovations,))


def test_a_consistent_run_is_good(solution: Solution, timeline: Timeline) -> None:
    verdict = judge(solution, timeline)
    assert verdict.grade == "good", verdict.faults
    assert verdict.closeness is not None
    assert verdict.fix_errors is not None
    assert 0.04 < verdict.fix_errors.fixes < 0.1
    assert verdict.accuracy[0] <= verdict.accuracy[1]


def test_read_is_used_and_rejected_and_the_main_reason_is_told_without_its_figures() -> None:
    use = use_of(series(rejected=slice(10, 30)))
    assert (use.read, use.used, use.rejected, use.unexplained) == (COUNT, COUNT - 20, 20, 20)
    assert use.reason == "innovation … beyond the gate of …"
    assert use.nis == pytest.approx(1.0, abs=0.15)
    assert (use.windows, use.windows_off) == (14, 0)


def test_rejections_in_a_row_are_poor_and_as_many_single_ones_are_outliers(solution: Solution, timeline: Timeline) -> None:
    in_a_row = judge(with_innovations(solution, series(rejected=slice(100, 132))), timeline)
    single = judge(with_innovations(solution, series(rejected=np.arange(5, 385, 12))), timeline)
    assert in_a_row.kinds[0].rejected == single.kinds[0].rejected == 32
    assert codes(in_a_row, "poor") == {"rejected"}
    assert not single.faults


def test_single_rejections_that_the_told_noise_brings_about_are_not_outliers() -> None:
    large = series(scale=2.0)
    rejected = large.nis > 21.1
    assert 0.05 < rejected.mean() < 0.25
    assert use_of(series(scale=2.0, rejected=rejected)).unexplained == rejected.sum()


def test_a_satellite_rejected_for_long_is_an_outlier_and_half_of_them_are_not() -> None:
    def ranges(bad: int) -> InnovationSeries:
        """Ten satellites, of which the first bad ones are rejected all the time."""
        plain = series()
        t_ns = np.repeat(plain.t_ns[:40], 10)
        used = np.arange(COUNT) % 10 >= bad
        one = np.ones((COUNT, 1))
        return replace(
            plain,
            kind="range",
            labels=("range",),
            t_ns=t_ns,
            residual=plain.residual[:, :1],
            std=one,
            noise_std=one,
            nominal_std=one,
            nis=plain.residual[:, 0] ** 2,
            used=used,
            reason=tuple("" if good else "gate" for good in used),
            sources=tuple(f"G{k % 10:02d}" for k in range(COUNT)),
        )

    assert use_of(ranges(3)).unexplained == 0
    assert use_of(ranges(6)).unexplained == 240


@pytest.mark.parametrize(("scale", "grade"), [(1.0, "good"), (1.75, "fair"), (2.4, "poor"), (0.3, "good")])
def test_innovations_are_graded_by_their_size(solution: Solution, timeline: Timeline, scale: float, grade: str) -> None:
    assert judge(with_innovations(solution, series(scale)), timeline).grade == grade


def test_expected_accuracy_is_calibrated_upwards_only(solution: Solution, timeline: Timeline) -> None:
    plain, larger, smaller = (judge(with_innovations(solution, series(scale)), timeline) for scale in (1.0, 3.0, 0.3))
    assert larger.accuracy[0] == pytest.approx(3 / max(plain.calibration, 1) * plain.accuracy[0], rel=0.1)
    assert smaller.calibration == 1.0


def test_a_solution_far_from_its_fixes_is_poor_although_its_innovations_are_fine(
    solution: Solution, timeline: Timeline
) -> None:
    away = replace(solution, lla=move_lla(solution.lla, np.full((len(solution), 3), 3.0)))
    verdict = judge(away, replace(timeline, reference=None))
    assert "distance" in codes(verdict, "poor")
    assert verdict.closeness is not None
    assert verdict.closeness.median == pytest.approx(3 * np.sqrt(2), rel=0.1)


def test_a_reference_shows_what_the_fixes_do_not(solution: Solution, timeline: Timeline) -> None:
    fixes, reference = timeline.fixes, timeline.reference
    assert fixes is not None
    assert reference is not None
    wide = replace(solution, cov=solution.cov * 400)
    apart = replace(wide, lla=move_lla(solution.lla, np.full((len(solution), 3), 0.4)))
    assert codes(judge(apart, timeline), "poor") == {"reference"}
    assert not judge(apart, replace(timeline, reference=None)).faults


def test_a_reference_made_of_the_fixes_judges_nothing(solution: Solution, timeline: Timeline) -> None:
    fixes, reference = timeline.fixes, timeline.reference
    assert fixes is not None
    assert reference is not None
    nan = np.full((len(fixes), 3), np.nan)
    same = replace(
        reference, t_ns=fixes.t_ns, lla=fixes.lla, vel_n=nan, q_nb=np.full((len(fixes), 4), np.nan), cov_pos=fixes.cov_pos
    )
    verdict = judge(solution, replace(timeline, reference=same))
    assert verdict.fix_errors is None or verdict.fix_errors.own
    assert "reference" not in codes(verdict, "poor") | codes(verdict, "fair")


def test_rows_that_are_not_finite_are_poor(solution: Solution, timeline: Timeline) -> None:
    lla = solution.lla.copy()
    lla[500:510] = np.nan
    verdict = judge(replace(solution, lla=lla), timeline)
    assert "finite" in codes(verdict, "poor")


@pytest.mark.parametrize(("restarts", "grade"), [(0, "good"), (1, "fair"), (3, "poor")])
def test_restarts_are_counted(solution: Solution, timeline: Timeline, restarts: int, grade: str) -> None:
    events = tuple(Event(START_NS, "warning", "started anew", "restart") for _ in range(restarts))
    verdict = judge(replace(solution, events=events), timeline)
    assert (verdict.grade, verdict.events["restart"]) == (grade, restarts)


def test_refuted_noise_is_told_and_bounds_the_accuracy(solution: Solution, timeline: Timeline) -> None:
    verdict = judge(replace(solution, estimated={"position_noise_scale": 8.0}), timeline)
    noise = np.median(np.linalg.norm(solution.innovations[0].noise_std[:, :2], axis=1))
    assert codes(verdict, "fair") == {"told"}
    assert verdict.accuracy[0] >= noise


@pytest.mark.parametrize(("off", "grade"), [(1.0, "good"), (3.5, "fair"), (8.0, "poor")])
def test_a_reference_contradicts_what_a_run_expects_of_itself(
    solution: Solution, timeline: Timeline, off: float, grade: str
) -> None:
    """Fixes and solution share an error that no innovation shows."""
    expected = judge(solution, timeline).accuracy[0]
    reference = timeline.reference
    assert reference is not None
    away = replace(reference, lla=move_lla(reference.lla, np.tile([off * expected, 0.0, 0.0], (len(reference), 1))))
    seen = replace(timeline, reference=away)
    verdict = judge(solution, seen, evaluation=evaluate(solution, away))
    assert {fault.grade for fault in verdict.faults if fault.code == "expected"} == ({grade} - {"good"})


def test_outliers_of_single_epochs_do_not_speak_against_a_solution_by_ranges(solution: Solution, timeline: Timeline) -> None:
    fixes = timeline.fixes
    assert fixes is not None
    wild = np.arange(len(fixes)) % 40 < 22
    points = replace(fixes, lla=move_lla(fixes.lla, np.where(wild[:, None], 200.0, 0.0) * [1.0, 0.0, 0.0]))
    with_fixes = judge(with_innovations(solution, series()), replace(timeline, fixes=points))
    by_points = judge(with_innovations(solution, series()), timeline, points)
    assert {fault.code for fault in with_fixes.faults} & {"far-windows", "distance"}
    assert "far-windows" not in {fault.code for fault in by_points.faults}
    assert by_points.by_points
