"""Drawn errors against their settings, and repeatability by seed."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.stats import binom, chi2, norm

from navreplay.geodesy.earth import ned_between
from navreplay.options import ImuNoise
from navreplay.timeline import FixStatus, LogError
from synthetic_logs import SCENARIOS, GnssErrors, ImuErrors, ideal_imu, simulate, truth_at, with_duration
from synthetic_logs.sensors.imu_errors import draw_gauss_markov

SILENT = ImuNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CAR = with_duration(SCENARIOS["car-short"], 60.0)
STATIC = with_duration(SCENARIOS["static"], 200.0)
CLEAN_FIXES = GnssErrors((1e-9, 1e-9, 1e-9), (1e-9, 1e-9, 1e-9))


def assert_variance(samples, std, alpha=1e-6):
    """Two-sided chi-square test of independent zero-mean samples against a standard deviation."""
    total = np.sum((samples / std) ** 2)
    low, high = chi2.ppf([alpha / 2, 1 - alpha / 2], np.size(samples))
    assert low < total < high


def with_fixes(scenario, **changes):
    return replace(scenario, gnss=replace(scenario.gnss, **changes))


def test_white_noise_has_its_density_and_averages_down():
    noise = replace(SILENT, gyro_noise=3e-4, accel_noise=2e-3)
    scenario = replace(STATIC, imu=ImuErrors(noise))
    log, ideal = simulate(scenario, 1), ideal_imu(STATIC.journey)
    for measured, true, density in ((log.imu.gyro, ideal.gyro, 3e-4), (log.imu.accel, ideal.accel, 2e-3)):
        error = (measured - true)[:20000]
        for count in (1, 10, 100):
            means = error.reshape(-1, count, 3).mean(axis=1)
            assert_variance(means, density / sqrt(count * 0.01))


def test_random_walk_bias_has_its_drive_and_is_reported():
    noise = replace(SILENT, gyro_bias_std=1e-3, gyro_bias_walk=2e-5, accel_bias_walk=3e-4)
    log, ideal = simulate(replace(STATIC, imu=ImuErrors(noise)), 2), ideal_imu(STATIC.journey)
    np.testing.assert_allclose(log.imu.gyro - ideal.gyro, log.gyro_errors.bias, atol=1e-15)
    np.testing.assert_allclose(log.imu.accel - ideal.accel, log.accel_errors.bias, atol=1e-14)
    assert_variance(np.diff(log.gyro_errors.bias, axis=0), 2e-5 * sqrt(0.01))
    assert_variance(np.diff(log.accel_errors.bias[::100], axis=0), 3e-4)


def test_gauss_markov_error_of_the_gyros_comes_on_top_of_the_bias():
    noise = replace(SILENT, gyro_bias_std=1e-3, gyro_markov_std=2e-4, gyro_markov_tau=0.5)
    with_error, without = (replace(STATIC, imu=ImuErrors(n)) for n in (noise, replace(noise, gyro_markov_std=0.0)))
    error = simulate(with_error, 2).gyro_errors.bias - simulate(without, 2).gyro_errors.bias
    assert np.mean(error**2) == pytest.approx(4e-8, rel=0.2)
    steps = (error[1:] - np.exp(-0.02) * error[:-1]) / sqrt(1 - np.exp(-0.04))
    assert_variance(steps, 2e-4)


def test_turn_on_bias_has_its_spread_over_seeds():
    noise = replace(SILENT, gyro_bias_std=2e-3, accel_bias_std=0.05)
    short = replace(with_duration(STATIC, 1.0), imu=ImuErrors(noise))
    logs = [simulate(short, seed) for seed in range(100)]
    assert_variance(np.array([log.gyro_errors.bias[0] for log in logs]), 2e-3)
    assert_variance(np.array([log.accel_errors.bias[0] for log in logs]), 0.05)


def test_gauss_markov_is_steady_and_forgets_at_its_time_constant():
    tau, dt = 5.0, 0.5
    start = default_rng(1).standard_normal(2000)
    series = draw_gauss_markov(default_rng(2), start, sqrt(2 / tau), tau, dt, 21)
    assert_variance(series[0], 1.0)
    assert_variance(series[20], 1.0)
    correlation = np.mean(series[0] * series[10])
    assert correlation == pytest.approx(np.exp(-1), abs=5 / sqrt(2000))


def test_scale_and_misalignment_are_the_reported_matrix():
    noise = replace(SILENT, gyro_scale_std=1e-2, accel_scale_std=2e-2)
    errors = ImuErrors(noise, gyro_misalignment_std=3e-3, accel_misalignment_std=4e-3)
    log, ideal = simulate(replace(CAR, imu=errors), 3), ideal_imu(CAR.journey)
    for measured, true, drawn in ((log.imu.gyro, ideal.gyro, log.gyro_errors), (log.imu.accel, ideal.accel, log.accel_errors)):
        np.testing.assert_allclose(measured, true @ (np.eye(3) + drawn.matrix).T, atol=1e-14)
        assert (drawn.matrix != 0).all()


def test_quantised_samples_are_whole_quanta_next_to_the_exact_ones():
    errors = ImuErrors(replace(SILENT, accel_noise=1e-3), accel_quantum=0.01, gyro_quantum=1e-4)
    coarse = simulate(replace(CAR, imu=errors), 4)
    fine = simulate(replace(CAR, imu=ImuErrors(errors.noise)), 4)
    np.testing.assert_allclose(coarse.imu.accel / 0.01, np.rint(coarse.imu.accel / 0.01), atol=1e-9)
    assert np.abs(coarse.imu.accel - fine.imu.accel).max() <= 0.005 + 1e-12
    assert np.abs(coarse.imu.gyro - fine.imu.gyro).max() <= 5e-5 + 1e-15


def test_same_seed_same_bits_other_seed_independent():
    first, again, other = simulate(CAR, 7), simulate(CAR, 7), simulate(CAR, 8)
    for name in ("t_ns", "gyro", "accel"):
        assert getattr(first.imu, name).tobytes() == getattr(again.imu, name).tobytes()
    for name in ("t_ns", "lla", "vel_n", "cov_pos", "cov_vel", "status"):
        assert getattr(first.fixes, name).tobytes() == getattr(again.fixes, name).tobytes()
    ideal = ideal_imu(CAR.journey)
    a, b = [(log.imu.gyro - ideal.gyro - log.gyro_errors.bias).ravel() for log in (first, other)]
    assert abs(np.corrcoef(a, b)[0, 1]) < 5 / sqrt(len(a))


def test_adding_one_error_leaves_the_others_as_they_are():
    plain = simulate(CAR, 9)
    more = replace(
        with_fixes(CAR, outlier_probability=0.3, outlier_size=50.0, correlated_std=(2.0, 2.0, 2.0), outages=((20.0, 30.0),)),
        imu=replace(CAR.imu, noise=replace(CAR.imu.noise, gyro_scale_std=0.01)),
    )
    changed = simulate(more, 9)
    assert plain.imu.accel.tobytes() == changed.imu.accel.tobytes()
    assert plain.gyro_errors.bias.tobytes() == changed.gyro_errors.bias.tobytes()
    kept = np.isin(plain.fixes.t_ns, changed.fixes.t_ns)
    assert plain.fixes.vel_n[kept].tobytes() == changed.fixes.vel_n.tobytes()
    ordinary = ~changed.fix_errors.outlier
    white = changed.fix_errors.position - changed.fix_errors.correlated
    np.testing.assert_allclose(white[ordinary], plain.fix_errors.position[kept][ordinary], atol=1e-14)


def test_white_fixes_have_their_deviations_and_tell_them():
    scenario = with_fixes(
        with_duration(SCENARIOS["static"], 2000.0), position_std=(1.0, 2.0, 3.0), velocity_std=(0.1, 0.2, 0.3)
    )
    log = simulate(scenario, 1)
    errors = ned_between(np.tile(log.truth.lla[0], (len(log.fixes), 1)), log.fixes.lla)
    for axis in range(3):
        assert_variance(errors[:, axis], 1.0 + axis)
        assert_variance(log.fixes.vel_n[:, axis], 0.1 * (1 + axis))
    np.testing.assert_allclose(log.fixes.cov_pos, np.tile(np.diag([1.0, 4.0, 9.0]), (len(log.fixes), 1, 1)))
    np.testing.assert_allclose(log.fix_errors.cov_pos, log.fixes.cov_pos)
    np.testing.assert_allclose(log.fix_errors.position, errors, atol=1e-4)


def test_fixes_are_at_the_antenna():
    scenario = replace(CAR, journey=replace(CAR.journey, lever_b=(1.0, 0.5, -1.5)), gnss=CLEAN_FIXES)
    log = simulate(scenario, 1)
    truth = truth_at(scenario.journey, log.fixes.t_ns)
    standing = np.linalg.norm(truth.vel_n, axis=1) == 0
    yaw = 35 * pi / 180
    expected = [np.cos(yaw) - 0.5 * np.sin(yaw), np.sin(yaw) + 0.5 * np.cos(yaw), -1.5]
    offset = ned_between(truth.lla, log.fixes.lla)
    np.testing.assert_allclose(offset[:20], np.tile(expected, (20, 1)), atol=1e-6)
    assert standing[:20].all()
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), sqrt(1 + 0.25 + 2.25), atol=1e-6)


def test_antenna_velocity_is_the_derivative_of_its_position():
    journey = replace(SCENARIOS["uav-flight"].journey, gnss_rate=50.0, duration=160.0, lever_b=(2.0, 1.0, -1.0))
    log = simulate(replace(SCENARIOS["uav-flight"], journey=journey, gnss=CLEAN_FIXES), 1)
    lla, vel_n = log.fix_errors.antenna.lla, log.fix_errors.antenna.vel_n
    derivative = ned_between(lla[:-2], lla[2:]) / 0.04
    np.testing.assert_allclose(derivative, vel_n[1:-1], atol=2e-3)
    at_imu = truth_at(journey, log.fixes.t_ns).vel_n
    assert np.abs(vel_n - at_imu).max() > 0.1


def test_outages_take_out_their_epochs_only():
    whole = simulate(with_fixes(CAR, outages=()), 3)
    cut = simulate(with_fixes(CAR, outages=((10.0, 20.0), (40.0, 45.0))), 3)
    t_s = (whole.fixes.t_ns - CAR.journey.start_ns) / 1e9
    out = ((t_s >= 10) & (t_s < 20)) | ((t_s >= 40) & (t_s < 45))
    assert out.sum() == 15
    np.testing.assert_array_equal(cut.fixes.t_ns, whole.fixes.t_ns[~out])
    assert cut.fixes.lla.tobytes() == whole.fixes.lla[~out].tobytes()
    assert len(cut.fix_errors.position) == len(cut.fixes)


def test_noise_windows_change_the_data_and_told_windows_the_covariance():
    base = with_fixes(with_duration(STATIC, 1000.0), position_std=(1.0, 1.0, 1.0))
    noisy = simulate(with_fixes(base, noise_windows=((200.0, 600.0, 4.0),)), 5)
    inside = slice(200, 600)
    assert_variance(noisy.fix_errors.position[inside], 4.0)
    assert_variance(noisy.fix_errors.position[600:], 1.0)
    np.testing.assert_allclose(noisy.fixes.cov_pos[300], np.eye(3))
    np.testing.assert_allclose(noisy.fix_errors.cov_pos[[199, 200, 599, 600], 0, 0], [1, 16, 16, 1])
    told = simulate(with_fixes(base, told_windows=((500.0, 700.0, 4.0),)), 5)
    assert_variance(told.fix_errors.position, 1.0)
    np.testing.assert_allclose(told.fixes.cov_pos[[499, 500, 699, 700], 1, 1], [1, 16, 16, 1])
    np.testing.assert_allclose(told.fixes.cov_vel[500, 0, 0], 16 * told.fixes.cov_vel[499, 0, 0])


def test_mixture_has_its_share_its_scale_and_its_second_moment():
    scenario = with_fixes(
        with_duration(STATIC, 3000.0), position_std=(1.0, 1.0, 1.0), mixture_probability=0.2, mixture_scale=8.0
    )
    log = simulate(scenario, 6)
    wide = log.fix_errors.wide
    low, high = binom.ppf([1e-6, 1 - 1e-6], len(wide), 0.2)
    assert low < wide.sum() < high
    assert_variance(log.fix_errors.position[wide], 8.0)
    assert_variance(log.fix_errors.position[~wide], 1.0)
    assert_variance(log.fix_errors.velocity[wide] / log.scenario.gnss.velocity_std, 8.0)
    np.testing.assert_allclose(log.fix_errors.cov_pos[0], np.eye(3) * (0.8 + 0.2 * 64))


def test_outliers_have_their_share_and_size():
    scenario = with_fixes(with_duration(STATIC, 2000.0), position_std=(1e-6,) * 3, outlier_probability=0.1, outlier_size=40.0)
    log = simulate(scenario, 7)
    outlier = log.fix_errors.outlier
    low, high = binom.ppf([1e-6, 1 - 1e-6], len(outlier), 0.1)
    assert low < outlier.sum() < high
    size = np.linalg.norm(log.fix_errors.position, axis=1)
    np.testing.assert_allclose(size, np.where(outlier, 40.0, 0.0), atol=1e-4)
    direction = log.fix_errors.position[outlier].mean(axis=0) / 40
    assert np.abs(direction).max() < norm.ppf(1 - 1e-6) / sqrt(3 * outlier.sum())


def test_correlated_errors_have_their_spread_and_correlation():
    scenario = with_fixes(
        with_duration(STATIC, 3000.0), position_std=(1e-6,) * 3, correlated_std=(3.0, 3.0, 3.0), correlation_time=10.0
    )
    log = simulate(scenario, 8)
    series = log.fix_errors.position / 3.0
    innovations = (series[1:] - np.exp(-0.1) * series[:-1]) / sqrt(1 - np.exp(-0.2))
    assert_variance(innovations, 1.0)
    assert np.abs(np.mean(innovations[1:] * innovations[:-1])) < 5 / sqrt(innovations.size)
    np.testing.assert_allclose(log.fixes.cov_pos[0], 9 * np.eye(3), atol=1e-9)


def test_every_scenario_simulates_and_names_itself():
    for name, scenario in SCENARIOS.items():
        log = simulate(with_duration(scenario, 40.0), 1)
        assert scenario.name == name
        assert scenario.description.endswith(".")
        assert "\n" not in scenario.description
        timeline = log.timeline()
        assert timeline.imu.increments == scenario.journey.increments
        assert timeline.reference.t_ns[0] == timeline.imu.t_ns[0] == scenario.journey.start_ns
        np.testing.assert_array_equal(np.isin(log.truth.t_ns, log.imu.t_ns), True)
        assert (timeline.fixes is None) == (scenario.gnss is None)
        assert (timeline.ranges is None) == (scenario.receiver is None)
        if scenario.gnss is not None:
            assert log.fixes.has_velocity.all() == (scenario.gnss.velocity_std is not None)


def test_epochs_of_gnss_lie_between_imu_samples_where_asked():
    log = simulate(CAR, 1)
    assert CAR.journey.gnss_offset == 0.0037
    assert not np.isin(log.fixes.t_ns, log.imu.t_ns).any()
    assert log.fixes.status.tolist() == [FixStatus.SINGLE] * len(log.fixes)


def test_shared_arrays_cannot_be_changed_by_accident():
    with pytest.raises(ValueError, match="read-only"):
        ideal_imu(CAR.journey).gyro[0, 0] = 1.0


def test_negative_seed_and_empty_journey_are_refused():
    with pytest.raises(LogError, match="a seed is a whole number from 0 on, got -1"):
        simulate(CAR, -1)
    with pytest.raises(LogError, match="no samples"):
        simulate(replace(CAR, journey=replace(CAR.journey, duration=0.001)), 1)
