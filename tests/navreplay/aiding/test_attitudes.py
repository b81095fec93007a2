"""Measured attitudes in the filter: Jacobians, consistency, starting without fixes, and attitudes beside fixes."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from navreplay.error_models.ned import NedErrorModel
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.earth import quat_en
from navreplay.geodesy.rotation import euler_from_quat, quat_from_euler, quat_from_rotvec, quat_multiply
from navreplay.measurements.attitudes import attitude_measurement, attitude_nb, attitude_noise, heading_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GRADES, AlignmentOptions, AttitudeOptions, FilterOptions, GateOptions
from navreplay.timeline import AttitudeSeries, LogError
from synthetic_logs import SCENARIOS, simulate, with_duration

ARCSEC = pi / 180 / 3600
LLA = np.array([0.7, 2.0, 3e5])
MODEL = NedErrorModel(GRADES["tactical"])


def series(q, frame="navigation", std=ARCSEC, heading_only=False):
    cov = np.diag([std**2, 4 * std**2, 9 * std**2])[None]
    return AttitudeSeries(np.array([5 * 10**9]), q[None], cov, frame, heading_only)


def numeric_jacobian(measure, state):
    columns = []
    for i, step in enumerate(np.repeat([10.0, 1e-3, 1e-5, 1e-6, 1e-3], 3)):
        moved = [measure(MODEL.retract(state, sign * step * np.eye(15)[i])).residual for sign in (1, -1)]
        columns.append((moved[1] - moved[0]) / (2 * step))
    return np.array(columns).T


@pytest.mark.parametrize("frame", ["navigation", "earth"])
def test_attitude_jacobian_is_the_derivative(frame):
    state = NavState.at(LLA, np.array([100.0, 50.0, -20.0]), quat_from_euler(0.3, 1.4, -2.0))
    q = state.q_nb if frame == "navigation" else quat_multiply(quat_en(*LLA[:2]), state.q_nb)
    attitude = series(q, frame)

    def measure(at):
        return attitude_measurement(at, attitude, 0, attitude.cov[0], 15)

    measurement = measure(state)
    np.testing.assert_allclose(measurement.residual, 0, atol=1e-15)
    scale = np.repeat([1e6, 1.0, 1.0, 1.0, 1.0], 3)
    np.testing.assert_allclose(measurement.jacobian * scale, numeric_jacobian(measure, state) * scale, atol=1e-4)
    assert np.trace(measurement.noise) == pytest.approx(14 * ARCSEC**2)


def test_a_large_misalignment_comes_out_whole():
    state = NavState.at(LLA, np.zeros(3), quat_from_euler(0.1, -0.2, 3.0))
    turn = np.array([0.5, -1.0, 0.8])
    attitude = series(quat_multiply(quat_from_rotvec(turn), state.q_nb))
    np.testing.assert_allclose(attitude_measurement(state, attitude, 0, np.eye(3), 15).residual, turn, atol=1e-12)


def test_heading_jacobian_is_the_derivative_and_the_residual_wraps():
    state = NavState.at(LLA, np.zeros(3), quat_from_euler(0.2, 0.3, 3.1))
    attitude = series(quat_from_euler(1.0, -0.5, -3.1), heading_only=True)

    def measure(at):
        return heading_measurement(at, attitude, 0, attitude.cov[0], 15)

    measurement = measure(state)
    assert measurement.residual[0] == pytest.approx(2 * pi - 6.2)
    assert measurement.noise[0, 0] == pytest.approx(9 * ARCSEC**2)
    np.testing.assert_allclose(measurement.jacobian, numeric_jacobian(measure, state), atol=1e-6)


def test_unknown_accuracy_takes_the_default_and_the_floor_raises_the_rest():
    attitude = AttitudeSeries(
        np.array([1, 2]), np.tile([1.0, 0, 0, 0], (2, 1)), np.stack([np.full((3, 3), np.nan), 1e-20 * np.eye(3)])
    )
    noise = attitude_noise(attitude, AttitudeOptions(default_std=0.02, std_floor=1e-6))
    np.testing.assert_allclose(noise[0], 4e-4 * np.eye(3))
    np.testing.assert_allclose(noise[1], 1e-12 * np.eye(3))


def test_an_earth_fixed_attitude_turns_into_ned_where_the_vehicle_is():
    q_nb = quat_from_euler(0.1, 0.2, 0.3)
    found, _ = attitude_nb(series(quat_multiply(quat_en(*LLA[:2]), q_nb), "earth"), 0, LLA)
    np.testing.assert_allclose(euler_from_quat(found), [0.1, 0.2, 0.3], atol=1e-12)


@pytest.fixture(scope="module")
def flight():
    return simulate(with_duration(SCENARIOS["ballistic"], 60.0), 5)


def told(log, **changed):
    truth = log.truth
    q_nb = quat_multiply(quat_from_rotvec(np.array([10.0, 6.0, 10.0]) * ARCSEC), truth.q_nb[0])
    alignment = AlignmentOptions(
        method="given",
        given=tuple(euler_from_quat(q_nb)),
        given_std=(10 * ARCSEC,) * 3,
        position=tuple(truth.lla[0]),
        position_std=(5.0,) * 3,
        velocity=tuple(truth.vel_n[0]),
    )
    options = FilterOptions(imu_noise=log.scenario.imu.noise, alignment=replace(alignment, **changed), output_rate=0.0)
    return replace(options, gate=GateOptions(1.0))


def test_stars_alone_hold_the_attitude_to_a_fraction_of_their_noise(flight):
    solution = run_filter(flight.timeline(), build_method("fixed"), told(flight))
    evaluation = evaluate(solution, flight.truth)
    settled = evaluation.t_ns > flight.truth.t_ns[0] + 20 * 10**9
    error = evaluation.errors["inertial_attitude"].error[settled] / ARCSEC
    assert (np.sqrt((error**2).mean(axis=0)) < 0.3).all()
    (innovations,) = solution.innovations
    assert innovations.kind == "attitude"
    assert innovations.unit == "rad"
    assert innovations.nis.mean() / 3 == pytest.approx(1, abs=0.1)
    # against NED the drift of the position shows as well
    assert evaluation.errors["attitude"].std[-1].min() > 1.5 * evaluation.errors["inertial_attitude"].std[-1].max()


@pytest.mark.slow
def test_attitude_and_gyro_bias_are_consistent_over_seeds():
    squares = []
    for seed in range(8):
        log = simulate(with_duration(SCENARIOS["ballistic"], 120.0), seed)
        options = told(log)
        solution = run_filter(log.timeline(), build_method("fixed"), options)
        inertial = evaluate(solution, log.truth).errors["inertial_attitude"].nees[-1]
        bias = log.gyro_errors.bias[-1] - solution.gyro_bias[-1]
        squares.append([inertial, bias @ np.linalg.solve(solution.cov[-1, 9:12, 9:12], bias)])
    # chi-square of 24 degrees of freedom, 99.9 %
    assert (np.sum(squares, axis=0) < 51.2).all()
    assert (np.sum(squares, axis=0) > 7.5).all()


def test_without_given_angles_the_first_measured_attitude_starts_the_filter(flight):
    options = told(flight, method="auto", given=None)
    solution = run_filter(flight.timeline(), build_method("fixed"), options)
    assert solution.t_ns[0] == flight.attitude.t_ns[0]
    assert "first measured attitude" in solution.events[0].text
    np.testing.assert_allclose(solution.std[0, 6:9], np.hypot(1, 5 / 6.37e6 / ARCSEC) * ARCSEC, rtol=0.35)


def test_the_reference_can_start_the_filter(flight):
    solution = run_filter(flight.timeline(), build_method("fixed"), told(flight, method="reference", given=None, position=None))
    np.testing.assert_array_equal(solution.lla[0], flight.truth.lla[0])


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"position": None}, "alignment.position_deg_m"),
        ({"method": "attitude", "given": None}, "alignment.given_deg"),
        ({"method": "reference"}, "no reference with velocity and attitude"),
    ],
)
def test_a_start_that_nothing_tells_is_one_clear_line(flight, changed, says):
    heading = AttitudeSeries(flight.attitude.t_ns, flight.attitude.q, flight.attitude.cov, heading_only=True)
    timeline = replace(flight.timeline(), reference=None, attitude=heading)
    with pytest.raises(LogError, match=says) as error:
        run_filter(timeline, build_method("fixed"), told(flight, **changed))
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def drive():
    return simulate(SCENARIOS["car-short"], 2)


def aided(drive, measured, **changed):
    options = FilterOptions(imu_noise=drive.scenario.imu.noise)
    return run_filter(replace(drive.timeline(), attitude=measured), build_method("fixed"), replace(options, **changed))


def sampled(drive, every, std=0.2 * pi / 180, heading_only=False):
    """Attitudes from the truth with noise; some of them share the times of fixes."""
    rows = np.arange(0, len(drive.truth), every)
    noise = np.random.default_rng(1).normal(0, std, (len(rows), 3))
    q = quat_multiply(quat_from_rotvec(noise), drive.truth.q_nb[rows])
    return AttitudeSeries(drive.truth.t_ns[rows], q, np.tile(std**2 * np.eye(3), (len(rows), 1, 1)), heading_only=heading_only)


@pytest.mark.parametrize("heading_only", [False, True])
def test_attitudes_beside_fixes_help_the_heading(drive, heading_only):
    alone = evaluate(aided(drive, None), drive.truth).errors["attitude"]
    solution = aided(drive, sampled(drive, 25, heading_only=heading_only))
    both = evaluate(solution, drive.truth).errors["attitude"]
    assert {series.kind for series in solution.innovations} == {
        "position",
        "velocity",
        "heading" if heading_only else "attitude",
    }
    assert np.sqrt(np.mean(both.error[:, 2] ** 2)) < 0.5 * np.sqrt(np.nanmean(alone.error[:, 2] ** 2))
    assert np.nanmean(both.nees) < 6


def test_attitudes_that_are_not_to_be_used_leave_the_filter_as_it_was(drive):
    attitude = sampled(drive, 25)
    unused = aided(drive, attitude, attitude=AttitudeOptions(use=False))
    assert {series.kind for series in unused.innovations} == {"position", "velocity"}


def test_a_fix_and_an_attitude_of_one_time_smooth_like_one_epoch(drive):
    fixes = replace(drive.fixes, t_ns=drive.fixes.t_ns // 20_000_000 * 20_000_000)
    timeline = replace(drive.timeline(), fixes=fixes, attitude=sampled(drive, 50))
    options = FilterOptions(imu_noise=drive.scenario.imu.noise, smooth=True)
    assert np.isin(fixes.t_ns, timeline.attitude.t_ns).sum() > 50
    smoothed = evaluate(run_filter(timeline, build_method("fixed"), options), drive.truth)
    forward = evaluate(run_filter(timeline, build_method("fixed"), replace(options, smooth=False)), drive.truth)
    for quantity in ("position", "attitude"):
        ends = [np.sqrt(np.nanmean(found.errors[quantity].error ** 2)) for found in (smoothed, forward)]
        assert ends[0] < ends[1]
    assert 1 < np.nanmean(smoothed.errors["attitude"].nees) < 6


def test_a_run_of_wrong_attitudes_does_not_count_against_the_fixes(drive):
    good = sampled(drive, 25)
    wrong = replace(good, q=quat_multiply(np.array([0.0, 0, 0, 1.0]), good.q))
    options = AlignmentOptions(method="course")
    solution = aided(drive, wrong, alignment=options, gate=GateOptions(reset_after=0))
    by_kind = {series.kind: series.used.mean() for series in solution.innovations}
    assert by_kind["attitude"] == 0
    assert by_kind["position"] > 0.95


def test_series_refuses_what_is_no_attitude():
    t_ns, cov = np.array([1, 2]), np.full((2, 3, 3), np.nan)
    with pytest.raises(LogError, match=r"row 1 has length 0\.5,"):
        AttitudeSeries(t_ns, np.array([[1.0, 0, 0, 0], [0.5, 0, 0, 0]]), cov)
    with pytest.raises(LogError, match="not against Earth-fixed axes"):
        AttitudeSeries(t_ns, np.tile([1.0, 0, 0, 0], (2, 1)), cov, "earth", True)
