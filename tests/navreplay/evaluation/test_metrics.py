"""Errors against a reference, statistics, outages and consistency, on solutions whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.evaluation.metrics import compute_nis, evaluate, find_outages, interpolate, summarise, summarise_outages
from navreplay.evaluation.outages import count_outages
from navreplay.evaluation.statistics import judge_squares
from navreplay.geodesy.earth import move_lla, ned_between
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_rotvec, quat_multiply, rotvec_from_quat
from navreplay.solution import Outage, RowStatus, Solution
from navreplay.timeline import LogError, Trajectory
from tests.helpers.sample_drive import START_NS, STATES, UNITS, make_solution, make_timeline, truth

SECOND = 1_000_000_000


def exact_solution(duration_s: float = 20.0, rate: float = 10.0) -> Solution:
    """The truth as a solution with a unit covariance and no innovations."""
    t_ns = START_NS + np.arange(int(duration_s * rate) + 1) * round(SECOND / rate)
    path = truth(t_ns)
    n = len(t_ns)
    return Solution(
        t_ns,
        path.lla,
        path.vel_n,
        path.q_nb,
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.tile(np.eye(15), (n, 1, 1)),
        np.zeros(n, dtype=np.int8),
        STATES,
        UNITS,
        "fixed",
    )


def test_interpolation_follows_a_smooth_path_to_millimetres() -> None:
    solution = exact_solution()
    between = solution.t_ns[:-1] + 37_000_000
    at, exact = interpolate(solution, between), truth(between)
    assert at.valid.all()
    assert np.abs(ned_between(exact.lla, at.lla)).max() < 1e-5
    assert np.abs(at.vel_n - exact.vel_n).max() < 1e-3
    assert np.abs(rotvec_from_quat(quat_multiply(at.q_nb, exact.q_nb * [1, -1, -1, -1]))).max() < 1e-4


def test_interpolation_gives_rows_back_exactly_and_spans_no_long_step() -> None:
    solution = exact_solution()
    holed = replace_rows(solution, np.r_[0:50, 70:201])
    at = interpolate(holed, solution.t_ns)
    assert np.flatnonzero(~at.valid).tolist() == list(range(50, 70))
    assert np.array_equal(at.lla[:50], solution.lla[:50])
    outside = interpolate(solution, np.array([solution.t_ns[0] - 1, solution.t_ns[-1] + 1]))
    assert not outside.valid.any()


def replace_rows(solution: Solution, rows: np.ndarray) -> Solution:
    names = ("t_ns", "lla", "vel_n", "q_nb", "gyro_bias", "accel_bias", "cov", "status")
    return replace(solution, **{name: getattr(solution, name)[rows] for name in names})


def test_known_offsets_come_back_as_errors() -> None:
    exact = exact_solution()
    tilt = np.array([0.01, -0.02, 0.03])
    solution = replace(
        exact,
        lla=move_lla(exact.lla, np.array([1.0, -2.0, 2.5])),
        vel_n=exact.vel_n + [0.1, 0.2, -0.3],
        q_nb=quat_multiply(quat_from_rotvec(tilt), exact.q_nb),
    )
    evaluation = evaluate(solution, truth(exact.t_ns[::4]))
    assert np.allclose(evaluation.errors["position"].error, [1, -2, 2.5], atol=1e-5)
    assert np.allclose(evaluation.errors["velocity"].error, [0.1, 0.2, -0.3])
    assert np.allclose(evaluation.errors["attitude"].error, tilt)
    assert np.allclose(evaluation.errors["position"].nees, 11.25, atol=1e-4)
    table = evaluation.statistics["all"]["position"]
    assert table["horizontal"].rms == pytest.approx(np.sqrt(5), abs=1e-5)
    assert table["3d"].max == pytest.approx(np.sqrt(11.25), abs=1e-5)
    assert evaluation.within_3_sigma["position"] == {"north": 1.0, "east": 1.0, "down": 1.0}


def test_reference_of_another_point_is_met_with_its_lever_arm() -> None:
    exact = exact_solution(rate=20.0)
    lever = np.array([1.5, -0.4, -0.9])
    path = truth(exact.t_ns)
    arm = matrix_from_quat(path.q_nb) @ lever
    velocity = path.vel_n + np.gradient(arm, 0.05, axis=0)
    reference = Trajectory(path.t_ns, move_lla(path.lla, arm), velocity, path.q_nb, path.cov_pos)
    evaluation = evaluate(exact, reference, lever)
    assert evaluation.statistics["all"]["position"]["3d"].max < 1e-4
    assert evaluation.statistics["all"]["velocity"]["3d"].p95 < 5e-3
    assert evaluate(exact, reference).statistics["all"]["position"]["3d"].p50 == pytest.approx(np.linalg.norm(lever), rel=1e-3)


def test_attitude_uncertainty_widens_the_position_of_a_far_point() -> None:
    exact = exact_solution()
    evaluation = evaluate(exact, truth(exact.t_ns), np.array([0.0, 0.0, 2.0]))
    assert np.allclose(evaluation.errors["position"].std[:, 0] ** 2, 1 + 4, rtol=0.02)


def test_reference_covariance_counts_in_nees() -> None:
    exact = exact_solution()
    moved = replace(exact, lla=move_lla(exact.lla, np.array([2.0, 0.0, 0.0])))
    path = truth(exact.t_ns)
    reference = replace(path, cov_pos=np.tile(3 * np.eye(3), (len(path), 1, 1)))
    assert np.allclose(evaluate(moved, reference).errors["position"].nees, 1, atol=1e-4)


def test_reference_without_velocity_and_attitude() -> None:
    exact = exact_solution()
    path = truth(exact.t_ns)
    unknown = np.full((len(path), 4), np.nan)
    evaluation = evaluate(exact, Trajectory(path.t_ns, path.lla, unknown[:, :3], unknown, path.cov_pos))
    assert list(evaluation.errors) == ["position"]


def test_reference_that_does_not_overlap_is_refused() -> None:
    exact = exact_solution()
    with pytest.raises(LogError, match=r"no epoch of it lies within the solution.*time scale"):
        evaluate(exact, truth(exact.t_ns + 3600 * SECOND))
    with pytest.raises(LogError, match="too few to compare"):
        evaluate(replace_rows(exact, np.array([0])), truth(exact.t_ns))


def test_statistics_of_known_numbers() -> None:
    figures = summarise(np.array([3.0, -4.0, np.nan, 0.0, 5.0]))
    assert (figures.count, figures.max, figures.mean) == (4, 5.0, 1.0)
    assert figures.rms == pytest.approx(np.sqrt(50 / 4))
    assert figures.p50 == 3.5
    assert summarise(np.array([np.nan])).count == 0


def test_chi_square_draws_lie_in_their_bounds() -> None:
    rng = np.random.default_rng(0)
    judged = judge_squares(np.sum(rng.standard_normal((20000, 3)) ** 2, axis=1), 3)
    assert judged.mean == pytest.approx(3, abs=0.06)
    assert judged.share_inside == pytest.approx(0.95, abs=0.006)
    assert judged.share_below_upper == pytest.approx(0.975, abs=0.005)
    assert (judged.lower, judged.upper) == pytest.approx((0.2158, 9.3484), abs=1e-4)


def test_consistency_of_drawn_errors_and_innovations() -> None:
    solution = make_solution(duration_s=600, outage_every_s=75, outage_s=15)
    evaluation = evaluate(solution, truth(solution.t_ns[::10]))
    assert evaluation.nees["position"].mean == pytest.approx(3, abs=0.5)
    nis = compute_nis(solution.innovations)
    assert nis["position"].dof == 3
    assert nis["position"].share_inside == pytest.approx(0.95, abs=0.03)
    assert compute_nis(solution.innovations, used_only=False)["position"].mean > nis["position"].mean


def test_outages_end_at_the_next_used_fix_or_with_their_window() -> None:
    solution = make_solution(duration_s=60, outage_every_s=30, outage_s=10)
    first = START_NS + 20 * SECOND
    assert find_outages(solution)[0] == Outage(first, first + 10 * SECOND, "no fixes")
    window = (first, first + 9 * SECOND)
    assert find_outages(solution, [window])[0] == Outage(first, first + 9 * SECOND, "simulated")
    assert find_outages(solution, min_length_s=30) == ()
    early = (first, first + 3 * SECOND)
    assert find_outages(solution, [early])[0].end_ns == first + 10 * SECOND


def test_error_at_the_end_of_an_outage_is_that_before_the_correction() -> None:
    solution = make_solution(duration_s=60, outage_every_s=30, outage_s=10)
    drift = np.where(solution.status == RowStatus.UPDATED, 0.0, (solution.t_ns - START_NS) / SECOND % 30 - 20)
    exact = truth(solution.t_ns)
    solution = replace(solution, lla=move_lla(exact.lla, np.maximum(drift, 0)[:, None] * [1.0, 0.0, 0.0]))
    evaluation = evaluate(solution, truth(solution.t_ns))
    outage = evaluation.outages[0]
    assert outage.length_s == 10
    assert outage.end_horizontal == pytest.approx(9.9, abs=1e-3)
    assert outage.max_horizontal == pytest.approx(9.9, abs=1e-3)
    assert evaluation.statistics["outside"]["position"]["horizontal"].max < 1e-6
    assert evaluation.statistics["inside"]["position"]["horizontal"].count == evaluation.in_outage.sum() > 150
    speed = np.linalg.norm(exact.vel_n[200:300], axis=1).mean()
    assert outage.distance_m == pytest.approx(10 * speed, rel=0.01)


def test_outage_summary_takes_median_and_percentile_over_outages() -> None:
    solution = make_solution(duration_s=300, outage_every_s=30, outage_s=10)
    evaluation = evaluate(solution, make_timeline(solution).reference)  # type: ignore[arg-type]
    ends = [outage.end_horizontal for outage in evaluation.outages]
    summary = summarise_outages(evaluation.outages)["end_horizontal"]
    assert summary.count == len(ends) == 10
    assert summary.p50 == pytest.approx(np.median(ends))


def test_only_simulated_outages_are_counted_where_there_are_any() -> None:
    solution = make_solution(duration_s=60, outage_every_s=30, outage_s=10)
    first = START_NS + 20 * SECOND
    reference = truth(solution.t_ns)
    both = evaluate(replace(solution, outages=find_outages(solution)), reference)
    assert [errors.outage.cause for errors in both.outages] == ["no fixes", "no fixes"]
    assert count_outages(both.outages) == both.outages
    mixed = evaluate(replace(solution, outages=find_outages(solution, [(first, first + 9 * SECOND)])), reference)
    assert [errors.outage.cause for errors in mixed.outages] == ["simulated", "no fixes"]
    assert count_outages(mixed.outages) == mixed.outages[:1]
    assert summarise_outages(mixed.outages)["end_horizontal"].count == 1


def test_stretches_of_refused_fixes_are_told_but_not_counted() -> None:
    solution = make_solution(duration_s=60, outage_every_s=100)
    position, velocity = solution.innovations
    seconds = (position.t_ns - START_NS) // SECOND
    refused = replace(position, used=position.used & ~((seconds > 30) & (seconds < 40)))
    solution = replace(solution, innovations=(refused, velocity), outages=())
    evaluation = evaluate(solution, truth(solution.t_ns))
    assert evaluation.outages[0].outage == Outage(START_NS + 30 * SECOND, START_NS + 40 * SECOND, "fixes rejected")
    assert count_outages(evaluation.outages) == ()
    assert not evaluation.in_outage.any()
    assert summarise_outages(evaluation.outages)["end_horizontal"].count == 0


def test_covariance_that_is_not_positive_gives_no_nees() -> None:
    exact = exact_solution()
    flat = replace(exact, cov=np.zeros_like(exact.cov))
    assert evaluate(flat, truth(exact.t_ns)).nees["position"].count == 0
