"""Standstill: told by the IMU where fixes calibrate it, and as a measurement of velocity zero."""

from dataclasses import fields, replace

import numpy as np
import pytest

from navreplay.aiding.standstill import StandstillAiding, standstill_candidates
from navreplay.error_models.ned import NedErrorModel
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import PRESETS, build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth
from navreplay.geodesy.rotation import quat_from_rotvec, quat_multiply
from navreplay.measurements.standstill import find_standstills
from navreplay.mechanisation.strapdown import NavState
from navreplay.moments.linearised import Linearised
from navreplay.options import GRADES, FilterOptions, GateOptions, VehicleOptions
from navreplay.timeline import AttitudeSeries, GnssFixSeries, ImuSeries, Timeline
from navreplay.update.gaussian import Gaussian
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration

SECOND = 1_000_000_000
VIBRATION = {"gyro": 0.01, "accel": 0.3}
"""Noise of a road and an engine, beside that of the sensor: per sample [rad/s], [m/s^2]."""


@pytest.fixture(scope="module")
def log():
    """Town driving with stops."""
    return simulate(with_duration(SCENARIOS["car-city"], 240.0), 5)


def speed_at(log, t_ns):
    return np.linalg.norm(truth_at(log.scenario.journey, t_ns).vel_n, axis=1)


def shaken(log, share=1.0):
    """The IMU of a car that vibrates while it moves."""
    imu, rng = log.imu, np.random.default_rng(7)
    moving = (speed_at(log, imu.t_ns) > 0.05)[:, None] * share
    gyro = imu.gyro + VIBRATION["gyro"] * moving * rng.standard_normal(imu.gyro.shape)
    accel = imu.accel + VIBRATION["accel"] * moving * rng.standard_normal(imu.accel.shape)
    return ImuSeries(imu.t_ns, gyro, accel, imu.increments)


def told_options(**changes):
    """With the vibration in the told noise of the IMU, at 100 Hz."""
    noise = replace(SCENARIOS["car-city"].imu.noise, gyro_noise=VIBRATION["gyro"] / 10, accel_noise=VIBRATION["accel"] / 10)
    return replace(FilterOptions(imu_noise=noise), **changes)


def select(fixes, rows):
    return GnssFixSeries(*(getattr(fixes, field.name)[rows] for field in fields(fixes)))


STANDING = VehicleOptions(zero_velocity=True)


def test_standstill_is_found_where_the_car_stands_and_nowhere_else(log):
    t_ns = log.imu.t_ns[::20]
    found = find_standstills(shaken(log), log.timeline().fixes, t_ns).t_ns
    assert speed_at(log, found).max() < 0.05
    rested = np.array([speed_at(log, np.arange(t - SECOND, t + SECOND, SECOND // 10)).max() < 1e-3 for t in t_ns])
    assert np.isin(t_ns[rested], found).mean() > 0.7
    assert rested.sum() > 100


def test_the_first_and_last_moments_of_a_stop_are_left_out(log):
    """A car that rolls off softly is as quiet as one at rest; it has moved within a second of it."""
    found = find_standstills(shaken(log, share=0.3), log.timeline().fixes, log.imu.t_ns[::20]).t_ns
    around = [speed_at(log, found + round(shift * SECOND)).max() for shift in (-0.9, -0.5, 0.5, 0.9)]
    assert len(found) > 50
    assert max(around) < 0.05


def test_fixes_that_know_motion_refuse_a_standstill(log):
    """In the middle of a stop that the IMU shows, they tell 5 m/s."""
    imu, fixes = shaken(log), log.timeline().fixes
    claimed = find_standstills(imu, fixes, log.imu.t_ns[::20]).t_ns
    driven = fixes.vel_n + np.where(np.abs(fixes.t_ns - claimed[len(claimed) // 2])[:, None] < 5 * SECOND, 5.0, 0.0)
    left = find_standstills(imu, replace(fixes, vel_n=driven), log.imu.t_ns[::20]).t_ns
    assert not (np.abs(left - claimed[len(claimed) // 2]) < 2 * SECOND).any()


def test_an_imu_as_quiet_in_motion_as_at_rest_claims_nothing(log):
    found = find_standstills(shaken(log, share=0.0), log.timeline().fixes, log.imu.t_ns[::20])
    assert len(found.t_ns) == 0
    assert "cannot be told" in found.text


def test_too_few_fixes_claim_nothing(log):
    fixes = log.timeline().fixes
    few = select(fixes, np.arange(len(fixes)) < 15)
    found = find_standstills(shaken(log), few, log.imu.t_ns[::20])
    assert len(found.t_ns) == 0
    assert "too few" in found.text


def test_candidates_are_the_other_measurements_and_each_second_without():
    main = np.array([3.0, 3.5, 4.0, 9.2]) * SECOND
    candidates = standstill_candidates(main.astype(np.int64), 0, 12 * SECOND) / SECOND
    assert candidates.tolist() == [1.0, 2.0, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.2, 11.0]


def test_jacobian_is_the_derivative():
    model = NedErrorModel(GRADES["tactical"])
    aiding = StandstillAiding(np.array([0]), 0.02, model)
    state = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([0.3, -0.2, 0.1]), np.array([1.0, 0, 0, 0]))
    measured = aiding.observe(0, state, np.eye(15), np.zeros(3), 0.01).measurement
    np.testing.assert_allclose(measured.residual, -state.vel_n)
    np.testing.assert_allclose(np.diag(measured.noise), 0.02**2)
    for i, step in enumerate(np.repeat([1.0, 1e-3, 1e-5, 1e-6, 1e-3], 3)):
        moved = model.retract(state, step * np.eye(15)[i])
        slope = (measured.residual - aiding.observe(0, moved, np.eye(15), np.zeros(3), 0.01).measurement.residual) / step
        np.testing.assert_allclose(measured.jacobian[:, i], slope, atol=1e-9)


@pytest.mark.parametrize("smooth", [False, True])
def test_an_outage_over_a_stop_does_less_harm(log, smooth):
    """Fixes are missing from ten seconds before a stop to its end; errors there over five draws of everything."""
    gains = []
    for seed in range(1, 6):
        drawn = simulate(log.scenario, seed)
        timeline = replace(drawn.timeline(), imu=shaken(drawn))
        resting = speed_at(log, timeline.fixes.t_ns) < 1e-3
        stop = np.flatnonzero(resting[1:] & ~resting[:-1])[0] + 1
        end = stop + int(np.argmin(resting[stop:]))
        assert end - stop > 5
        begin, until = timeline.fixes.t_ns[stop] - 10 * SECOND, timeline.fixes.t_ns[end]
        kept = (timeline.fixes.t_ns < begin) | (timeline.fixes.t_ns > until)
        cut = replace(timeline, fixes=select(timeline.fixes, kept))
        inside = truth_at(log.scenario.journey, np.arange(begin + 12 * SECOND, until, SECOND // 2))
        errors = []
        for vehicle in (VehicleOptions(), STANDING):
            solution = run_filter(cut, build_method("fixed"), told_options(vehicle=vehicle, smooth=smooth))
            velocity = evaluate(solution, inside).errors["velocity"]
            errors.append(np.sqrt((velocity.error**2).mean()))
            # 3 expected; at rest the velocity is known far better than its told standard deviation
            assert velocity.nees.mean() < 6
        gains.append(errors[1] / errors[0])
    assert np.mean(gains) < 0.6


def test_without_an_imu_it_is_told_that_nothing_comes_of_it():
    drive = simulate(with_duration(SCENARIOS["ranges-open"], 30.0), 1)
    alone = Timeline(ranges=drive.ranges, fix_lever_b=drive.timeline().fix_lever_b)
    solution = run_filter(alone, build_method("fixed"), FilterOptions(vehicle=STANDING))
    assert any("are not used: without IMU" in event.text for event in solution.events)


@pytest.mark.parametrize("name", [name for name in PRESETS if not name.endswith("-ga")])
def test_every_method_takes_what_is_known_of_the_vehicle_beside_fixes(log, name):
    """Standstill as it is told. Those with a genetic algorithm take minutes, with the update of ml and mlckf."""
    timeline = replace(log.timeline(), imu=shaken(log))
    car = replace(STANDING, zero_rate=True, no_slip=True, mounting=(0.0, 0.0))
    solution = run_filter(timeline, build_method(name), told_options(vehicle=car, output_rate=1.0))
    used = {series.kind: series.used.mean() for series in solution.innovations}
    assert used["zero_rate"] > 0.9
    assert used["no_slip"] > 0.9
    standing = next(series for series in solution.innovations if series.kind == "standstill")
    assert standing.used.mean() > 0.9
    np.testing.assert_allclose(standing.noise_std, STANDING.zero_velocity_std, rtol=1e-12)
    assert np.linalg.norm(solution.vel_n[np.searchsorted(solution.t_ns, standing.t_ns[standing.used])], axis=1).max() < 0.3


def test_a_bank_is_not_weighed_by_standstill(log):
    """Hypotheses of Q: the weights change where fixes are, not where zero velocity stands alone."""
    timeline = replace(log.timeline(), imu=shaken(log))
    resting = speed_at(log, timeline.fixes.t_ns) < 1e-3
    stop = np.flatnonzero(resting[1:] & ~resting[:-1])[0] + 2
    cut = replace(timeline, fixes=select(timeline.fixes, ~np.isin(np.arange(len(resting)), np.arange(stop, stop + 6))))
    solution = run_filter(cut, build_method("mmae", {"q_scales": (0.1, 1.0, 10.0)}), told_options(vehicle=STANDING))
    standing = next(series for series in solution.innovations if series.kind == "standstill")
    assert len(np.setdiff1d(standing.t_ns, cut.fixes.t_ns)) >= 3
    np.testing.assert_array_equal(np.setdiff1d(solution.weights.t_ns, cut.fixes.t_ns), [])


def test_attitudes_and_standstill_stand_beside_fixes(log):
    timeline = replace(log.timeline(), imu=shaken(log))
    rng, t_ns = np.random.default_rng(1), timeline.fixes.t_ns[:-1] + SECOND // 4
    truth = truth_at(log.scenario.journey, t_ns)
    std = np.radians(0.5)
    q = quat_multiply(quat_from_rotvec(std * rng.standard_normal((len(t_ns), 3))), truth.q_nb)
    attitude = AttitudeSeries(t_ns, q, np.tile(np.eye(3) * std**2, (len(t_ns), 1, 1)), "navigation", False)
    solution = run_filter(replace(timeline, attitude=attitude), build_method("fixed"), told_options(vehicle=STANDING))
    used = {series.kind: series.used.mean() for series in solution.innovations}
    assert set(used) == {"position", "velocity", "attitude", "standstill"}
    assert min(used.values()) > 0.95
    assert evaluate(solution, log.truth).errors["attitude"].nees.mean() < 6


@pytest.mark.parametrize("name", ["auto", "em-offline"])
def test_standstill_teaches_no_noise(log, name):
    """The IMU is quietest at rest, and zero has no noise: what a calibration finds is that of the drive without it."""
    timeline = replace(log.timeline(), imu=shaken(log))
    without, standing = (
        run_filter(timeline, build_method(name), told_options(vehicle=vehicle)) for vehicle in (VehicleOptions(), STANDING)
    )
    assert standing.estimated == without.estimated
    errors = [evaluate(solution, log.truth).errors for solution in (without, standing)]
    rms = [np.sqrt((error["velocity"].error ** 2).mean()) for error in errors]
    assert rms[1] < rms[0]
    assert errors[1]["velocity"].nees.mean() < 5


def test_an_imu_with_a_gap_shows_no_standstill_in_it(log):
    """From just before the car sets off the IMU is silent for a second."""
    imu = shaken(log)
    speed = speed_at(log, imu.t_ns)
    sets_off = imu.t_ns[np.flatnonzero((speed[1:] > 0.01) & (speed[:-1] <= 0.01))[0]]
    kept = (imu.t_ns < sets_off - SECOND // 10) | (imu.t_ns > sets_off + SECOND)
    silent = ImuSeries(imu.t_ns[kept], imu.gyro[kept], imu.accel[kept], imu.increments)
    found = find_standstills(silent, log.timeline().fixes, imu.t_ns).t_ns
    assert speed_at(log, found).max() < 0.05
    assert not ((found > sets_off + SECOND // 10) & (found <= sets_off + SECOND)).any()


def without_velocity(fixes):
    return replace(fixes, vel_n=np.full_like(fixes.vel_n, np.nan), cov_vel=np.full_like(fixes.cov_vel, np.nan))


def test_coarse_fixes_without_velocity_claim_nothing_and_say_why(log):
    found = find_standstills(shaken(log), without_velocity(log.timeline().fixes), log.imu.t_ns[::20])
    assert len(found.t_ns) == 0
    assert "neither velocities nor positions precise enough" in found.text


def test_precise_positions_serve_where_there_is_no_velocity(log):
    """As of an RTK receiver whose messages hold positions alone."""
    fixes = without_velocity(log.timeline().fixes)
    truth = truth_at(log.scenario.journey, fixes.t_ns)
    noise = 0.02 * np.random.default_rng(3).standard_normal((len(fixes), 3))
    precise = replace(fixes, lla=earth.move_lla(truth.lla, noise), cov_pos=np.tile(np.eye(3) * 4e-4, (len(fixes), 1, 1)))
    t_ns = log.imu.t_ns[::20]
    found = find_standstills(shaken(log), precise, t_ns).t_ns
    assert speed_at(log, found).max() < 0.05
    assert len(found) > 0.8 * len(find_standstills(shaken(log), log.timeline().fixes, t_ns).t_ns)


def test_a_wrong_standstill_is_refused_and_never_opens_the_filter():
    claimed = StandstillAiding(np.array([0]), 0.01, NedErrorModel(GRADES["tactical"]))
    state = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([10.0, 0.0, 0.0]), np.array([1.0, 0, 0, 0]))
    prior = Gaussian(np.zeros(15), np.eye(15) * 1e-4)
    measured = claimed.observe(0, state, prior.cov, np.zeros(3), 0.01).measurement
    innovation, gate = Linearised().innovate(prior, measured), claimed.gate(GateOptions(probability=1.0, reset_after=10))
    for _ in range(50):
        verdict = gate.judge(measured.kinds, innovation, innovation.noise)
        assert not verdict.widenings
        assert len(verdict.passed) == 0
