"""Raw ranges: how they add up, clock, noise against its recorded sigma, surroundings, seeds."""

from dataclasses import fields, replace
from math import pi, sqrt

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.stats import chi2, kstest

from navreplay.geodesy.earth import ecef_from_lla, move_lla
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.geodesy.time_scales import week_tow_from_gps
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT, klobuchar_delay, saastamoinen_delay
from navreplay.timeline import LogError
from synthetic_logs import SCENARIOS, Receiver, ReceiverClock, Surroundings, simulate, truth_at, with_duration
from synthetic_logs.ranges.draws import exponential
from synthetic_logs.ranges.errors import RangeErrors
from synthetic_logs.ranges.receiver_clock import draw_clock
from synthetic_logs.ranges.signals import carrier_of
from synthetic_logs.ranges.surroundings import figure_at, is_blocked

OPEN = with_duration(SCENARIOS["ranges-open"], 60.0)
STILL = replace(OPEN, journey=replace(SCENARIOS["static"].journey, duration=600.0, imu_rate=10.0))


def with_receiver(scenario, **changes):
    return replace(scenario, receiver=replace(scenario.receiver, **changes))


def seconds(log):
    return (log.ranges.t_ns - log.scenario.journey.start_ns) / 1e9


def assert_variance(samples, std, alpha=1e-6):
    """Two-sided chi-square test of independent zero-mean samples against a standard deviation."""
    low, high = chi2.ppf([alpha / 2, 1 - alpha / 2], np.size(samples))
    assert low < np.sum((samples / std) ** 2) < high


def correlation_by_lag(log, errors, lag):
    """Mean product of a satellite's standardised errors lag epochs apart."""
    epochs = np.cumsum(np.diff(log.ranges.t_ns, prepend=log.ranges.t_ns[0]) > 0)
    table = np.full((epochs[-1] + 1, 200), np.nan)
    satellites = np.unique(log.ranges.sat, return_inverse=True)[1]
    table[epochs, satellites] = errors
    return np.nanmean(table[lag:] * table[:-lag])


def test_ranges_add_up_from_their_parts():
    log = simulate(SCENARIOS["ermakf-city"], 1)
    ranges, truth = log.ranges, log.range_truth
    np.testing.assert_allclose(
        ranges.pseudorange, truth.distance + truth.clock_offset + truth.delays.total + truth.errors.pseudorange, rtol=1e-15
    )
    np.testing.assert_allclose(ranges.range_rate, truth.rate + truth.clock_drift + truth.errors.range_rate, atol=1e-12)
    assert ranges.signal[ranges.sat == "G05"].tolist() == ["1C"] * int((ranges.sat == "G05").sum())


def test_distance_is_measured_from_the_antenna_before_the_clock_s_stamp():
    clock = ReceiverClock(offset=200_000.0, drift=100.0)
    log = simulate(with_receiver(OPEN, clock=clock), 3)
    ranges, truth = log.ranges, log.range_truth
    before_ns = np.rint(truth.clock_offset / SPEED_OF_LIGHT * 1e9).astype(np.int64)
    times, inverse = np.unique(ranges.t_ns - before_ns, return_inverse=True)
    imu = truth_at(OPEN.journey, times)
    lever_n = np.einsum("kij,j->ki", matrix_from_quat(imu.q_nb), OPEN.journey.lever_b)
    antenna_e = ecef_from_lla(move_lla(imu.lla, lever_n))[inverse]
    np.testing.assert_allclose(np.linalg.norm(ranges.sat_pos_e - antenna_e, axis=1), truth.distance, atol=1e-5)
    at_the_stamp = truth_at(OPEN.journey, ranges.t_ns[-1:])
    assert np.linalg.norm(ecef_from_lla(at_the_stamp.lla) - ecef_from_lla(imu.lla[-1:])) > 5e-3


def broadcast_ionosphere(log):
    """The delays that a user computes at the start of the journey."""
    ranges, truth = log.ranges, log.range_truth
    lat, lon, _ = log.scenario.journey.motion.lla
    tow_s = week_tow_from_gps(ranges.t_ns)[1]
    at_l1 = klobuchar_delay(ranges.klobuchar, lat, lon, truth.elevation, truth.azimuth, tow_s)
    return at_l1 * (1575.42e6 / carrier_of(ranges.sat)) ** 2


def test_delays_are_the_models_where_nothing_mismatches():
    log = simulate(OPEN, 1)
    truth, ranges = log.range_truth, log.ranges
    lat, _, height = OPEN.journey.motion.lla
    modelled = broadcast_ionosphere(log) + saastamoinen_delay(lat, height, truth.elevation)
    np.testing.assert_allclose(truth.delays.total, modelled, atol=5e-3)
    assert (truth.delays.unmodelled == 0).all()
    assert not ranges.ionosphere_removed
    assert not ranges.troposphere_removed


def test_mismatch_of_the_atmosphere_has_its_spread_over_seeds():
    short = with_duration(OPEN, 1.0)
    ionosphere = with_receiver(short, ionosphere_mismatch=0.3)
    troposphere = with_receiver(short, troposphere_mismatch=0.05)
    shares, zeniths = [], []
    for seed in range(60):
        log = simulate(ionosphere, seed)
        share = log.range_truth.delays.unmodelled / broadcast_ionosphere(log)
        np.testing.assert_allclose(share, share[0], rtol=1e-4)
        shares.append(share[0])
        truth = simulate(troposphere, seed).range_truth
        zenith = truth.delays.unmodelled * np.sin(truth.elevation)
        np.testing.assert_allclose(zenith, zenith[0], rtol=1e-9)
        zeniths.append(zenith[0])
    assert_variance(np.array(shares), 0.3)
    assert_variance(np.array(zeniths), 0.05)


def test_clock_walks_as_its_model_says():
    clock = ReceiverClock(offset=100.0, drift=7.0, frequency_noise=0.4, frequency_walk=0.2)
    interval = 0.5
    course = draw_clock(clock, 20001, interval, 4)
    assert (course.offset[0], course.drift[0]) == (100.0, 7.0)
    steps = np.diff(course.drift)
    assert_variance(steps, 0.2 * sqrt(interval))
    moves = np.diff(course.offset) - course.drift[:-1] * interval
    assert_variance(moves, sqrt(0.4**2 * interval + 0.2**2 * interval**3 / 3))
    covariance = np.mean(moves * steps)
    assert covariance == pytest.approx(0.2**2 * interval**2 / 2, abs=5 * np.std(moves) * np.std(steps) / sqrt(20000))


def test_resets_are_whole_milliseconds_and_keep_the_clock_within_half_of_one():
    millisecond = SPEED_OF_LIGHT / 1000
    clock = ReceiverClock(offset=140_000.0, drift=2000.0)
    free, reset = (draw_clock(replace(clock, resets=resets), 1000, 1.0, 4) for resets in (False, True))
    jumps = (free.offset - reset.offset) / millisecond
    np.testing.assert_allclose(jumps, np.rint(jumps), atol=1e-9)
    assert np.abs(reset.offset).max() <= millisecond / 2
    assert len(np.unique(np.rint(jumps))) > 5
    np.testing.assert_array_equal(free.drift, reset.drift)


def test_ranges_of_a_clock_with_resets_jump_together():
    log = simulate(SCENARIOS["ranges-resets"], 2)
    offset = log.range_truth.clock_offset[log.ranges.epoch_starts[:-1]]
    assert (np.diff(offset) < -0.9 * SPEED_OF_LIGHT / 1000).sum() >= 1
    one = log.ranges.sat == log.ranges.sat[0]
    jump = np.diff(log.ranges.pseudorange[one])
    assert (jump < -0.9 * SPEED_OF_LIGHT / 1000).sum() >= 1


def test_systems_have_clock_offsets_of_their_own():
    log = simulate(with_receiver(OPEN, system_offset_std=10.0), 1)
    system = log.ranges.sat.astype("U1")
    first = log.ranges.t_ns == log.ranges.t_ns[0]
    offsets = {letter: np.unique(log.range_truth.clock_offset[first & (system == letter)]) for letter in "GEC"}
    assert all(len(values) == 1 for values in offsets.values())
    assert offsets["G"][0] == log.scenario.receiver.clock.offset
    assert len({float(values[0]) for values in offsets.values()}) == 3


def test_white_noise_has_the_recorded_sigma_which_is_the_told_one():
    log = simulate(STILL, 5)
    ranges, errors = log.ranges, log.range_truth.errors
    np.testing.assert_allclose(errors.pseudorange_std, ranges.pseudorange_std)
    np.testing.assert_allclose(errors.range_rate_std, ranges.range_rate_std)
    low = log.range_truth.elevation < np.radians(25)
    assert np.median(errors.pseudorange_std[low]) > 1.4 * np.median(errors.pseudorange_std[~low])
    for chosen in (low, ~low):
        assert_variance(errors.pseudorange[chosen], errors.pseudorange_std[chosen])
        assert_variance(errors.range_rate[chosen], errors.range_rate_std[chosen])
    assert kstest(errors.pseudorange / errors.pseudorange_std, "norm").pvalue > 1e-4
    assert abs(correlation_by_lag(log, errors.pseudorange / errors.pseudorange_std, 1)) < 5 / sqrt(len(ranges))
    assert abs(np.mean(errors.pseudorange * errors.range_rate)) < 5 * 0.8 * 0.05 / sqrt(len(ranges))
    assert (errors.correlated == 0).all()
    assert not errors.outlier.any()


def test_strength_falls_with_elevation_and_noise_grows_as_its_amplitude_falls():
    log = simulate(STILL, 5)
    scatter = log.ranges.cn0 - (40 + 9 * np.sin(log.range_truth.elevation))
    assert_variance(scatter, 0.5)
    expected = 0.8 * 10 ** ((45 - (40 + 9 * np.sin(log.range_truth.elevation))) / 20)
    np.testing.assert_allclose(log.ranges.pseudorange_std, expected, rtol=1e-12)


def test_a_step_of_the_noise_is_recorded_but_not_told():
    log = simulate(SCENARIOS["ranges-step"], 2)
    errors, t_s = log.range_truth.errors, seconds(log)
    inside = (t_s >= 120) & (t_s < 180)
    ratio = errors.pseudorange_std / log.ranges.pseudorange_std
    np.testing.assert_allclose(ratio, np.where(inside, 4.0, 1.0))
    np.testing.assert_allclose(errors.range_rate_std / log.ranges.range_rate_std, ratio)
    for chosen in (inside, ~inside):
        assert_variance(errors.pseudorange[chosen], errors.pseudorange_std[chosen])
        assert_variance(errors.range_rate[chosen], errors.range_rate_std[chosen])


def test_multipath_is_correlated_as_told_to_it():
    scenario = with_receiver(
        STILL,
        pseudorange_std=1e-9,
        range_rate_std=1e-9,
        multipath_std=3.0,
        rate_multipath_std=0.2,
        multipath_time=8.0,
    )
    log = simulate(scenario, 7)
    errors = log.range_truth.errors
    n_independent = len(log.ranges) / 16
    for series, std in ((errors.pseudorange, 3.0), (errors.range_rate, 0.2)):
        assert np.mean((series / std) ** 2) == pytest.approx(1.0, abs=5 * sqrt(2 / n_independent))
        for lag in (4, 8):
            assert correlation_by_lag(log, series / std, lag) == pytest.approx(np.exp(-lag / 8), abs=5 / sqrt(n_independent))
    np.testing.assert_allclose(errors.pseudorange_std, 3.0)
    np.testing.assert_allclose(log.ranges.pseudorange_std, 3.0)
    np.testing.assert_allclose(errors.correlated, errors.pseudorange, atol=1e-6)


def test_outliers_have_their_share_and_enter_the_moments():
    place = Surroundings(0.0, 700.0, outlier_probability=0.1, outlier_std=40.0, outlier_rate_std=3.0)
    errors = simulate(with_receiver(STILL, surroundings=(place,)), 3).range_truth.errors
    n = len(errors.outlier)
    assert errors.outlier.sum() == pytest.approx(0.1 * n, abs=5 * sqrt(0.09 * n))
    assert_variance(errors.pseudorange[errors.outlier], np.sqrt(errors.pseudorange_std**2 + 0.9 * 1600)[errors.outlier])
    normal = ~errors.outlier
    assert_variance(errors.pseudorange[normal], np.sqrt(errors.pseudorange_std**2 - 160)[normal])
    assert_variance(errors.range_rate[normal], np.sqrt(errors.range_rate_std**2 - 0.9)[normal])
    spread = np.mean((errors.pseudorange / errors.pseudorange_std) ** 2)
    assert spread == pytest.approx(1.0, abs=5 * 5 / sqrt(n))


def test_foliage_weakens_signals_and_is_not_told():
    place = Surroundings(100.0, 500.0, attenuation=6.0)
    log, open_sky = (simulate(with_receiver(STILL, surroundings=places), 3) for places in ((place,), ()))
    t_s, errors = seconds(log), log.range_truth.errors
    under = (t_s >= 100) & (t_s < 500)
    loss = 20 * np.log10(errors.pseudorange_std / log.ranges.pseudorange_std)
    np.testing.assert_allclose(loss[~under], 0.0, atol=1e-12)
    assert loss.min() > -1e-12
    assert loss[under].mean() == pytest.approx(6.0, rel=0.25)
    assert_variance(errors.pseudorange[under], errors.pseudorange_std[under])
    assert len(log.ranges) < len(open_sky.ranges)
    assert log.ranges.cn0.min() > 19.0


def test_reflected_signals_are_too_long_by_their_mean():
    place = Surroundings(
        0.0,
        700.0,
        roof_elevation=70 * pi / 180,
        reflected_share=1.0,
        reflected_attenuation=5.0,
        reflected_bias=15.0,
        reflected_rate_std=0.5,
    )
    pooled = [simulate(with_receiver(STILL, surroundings=(place,), multipath_time=3.0), seed) for seed in range(3)]
    detours, spreads = [], []
    for log in pooled:
        errors, truth = log.range_truth.errors, log.range_truth
        blocked = is_blocked(truth.azimuth, truth.elevation, 50 * pi / 180, np.radians(70.0))
        np.testing.assert_array_equal(errors.reflected, blocked)
        np.testing.assert_array_equal(errors.pseudorange_mean, np.where(blocked, 15.0, 0.0))
        assert (errors.correlated[blocked] > 0).all()
        assert (errors.correlated[~blocked] == 0).all()
        detours.append(errors.correlated[blocked])
        spreads.append(((errors.pseudorange - errors.pseudorange_mean) / errors.pseudorange_std)[blocked])
    detour, spread = np.concatenate(detours), np.concatenate(spreads)
    n_independent = len(detour) / 6
    assert detour.mean() == pytest.approx(15.0, abs=5 * 15 / sqrt(n_independent))
    assert spread.mean() == pytest.approx(0.0, abs=5 / sqrt(n_independent))
    assert np.mean(spread**2) == pytest.approx(1.0, abs=5 * sqrt(8 / n_independent))


def test_without_reflections_blocked_satellites_vanish():
    place = Surroundings(200.0, 400.0, roof_elevation=70 * pi / 180)
    log = simulate(with_receiver(STILL, surroundings=(place,)), 3)
    t_s, truth = seconds(log), log.range_truth
    inside = (t_s >= 200) & (t_s < 400)
    blocked = is_blocked(truth.azimuth, truth.elevation, 50 * pi / 180, np.radians(70.0))
    assert not blocked[inside].any()
    assert blocked[~inside].any()


def test_a_share_of_the_blocked_is_reflected_and_keeps_so_for_the_visit():
    place = Surroundings(0.0, 300.0, roof_elevation=80 * pi / 180, reflected_share=0.5)
    visits = (place, replace(place, start=300.0, end=601.0))
    log = simulate(with_receiver(STILL, surroundings=visits), 3)
    t_s, reflected = seconds(log), log.range_truth.errors.reflected
    first, second = (set(log.ranges.sat[reflected & ((t_s < 300) == early)].tolist()) for early in (True, False))
    assert first
    assert second
    assert first != second
    for name in first:
        assert (reflected & (t_s < 300) & (log.ranges.sat == name)).sum() > 30


def test_walls_stand_along_the_street():
    north, east, low, roof = 0.0, pi / 2, 20 * pi / 180, 60 * pi / 180
    assert is_blocked(np.array([east, north]), np.array([low, low]), np.zeros(2), np.full(2, roof)).tolist() == [True, False]
    assert is_blocked(np.array([east, north]), np.array([low, low]), np.full(2, east), np.full(2, roof)).tolist() == [
        False,
        True,
    ]
    assert not is_blocked(np.array([east]), np.array([1.05 * roof]), np.zeros(1), np.array([roof]))[0]
    assert not is_blocked(np.array([east]), np.array([low]), np.zeros(1), np.zeros(1))[0]


def test_later_surroundings_replace_earlier_ones():
    places = (Surroundings(0.0, 10.0, multipath_std=1.0), Surroundings(5.0, 8.0, multipath_std=2.0))
    t_s = np.array([-1.0, 0.0, 5.0, 7.9, 8.0, 10.0])
    np.testing.assert_array_equal(figure_at(places, "multipath_std", t_s), [0, 1, 2, 2, 1, 0])


def test_exponential_numbers():
    numbers = exponential(default_rng(1).standard_normal(2000))
    assert kstest(numbers, "expon").pvalue > 1e-3
    assert np.isfinite(exponential(np.array([-12.0, 12.0]))).all()


def test_same_seed_same_ranges():
    first, again, other = simulate(OPEN, 4), simulate(OPEN, 4), simulate(OPEN, 5)
    for field in fields(first.ranges):
        np.testing.assert_array_equal(getattr(first.ranges, field.name), getattr(again.ranges, field.name))
    assert (first.ranges.pseudorange != other.ranges.pseudorange).all()
    np.testing.assert_array_equal(first.imu.gyro, simulate(with_receiver(OPEN, systems="G"), 4).imu.gyro)


def test_one_disturbance_leaves_the_other_draws_as_they_are():
    place = Surroundings(20.0, 40.0, roof_elevation=1.0, multipath_std=4.0, outlier_probability=0.3, outlier_std=50.0)
    calm, disturbed = simulate(OPEN, 4), simulate(with_receiver(OPEN, surroundings=(place,)), 4)
    calm_rows, rows = ((t < 20) | (t >= 40) for t in (seconds(calm), seconds(disturbed)))
    for field in fields(RangeErrors):
        expected = getattr(calm.range_truth.errors, field.name)[calm_rows]
        np.testing.assert_array_equal(getattr(disturbed.range_truth.errors, field.name)[rows], expected)
    np.testing.assert_array_equal(disturbed.ranges.pseudorange[rows], calm.ranges.pseudorange[calm_rows])


def test_city_has_the_stretches_of_the_paper():
    log = simulate(SCENARIOS["ermakf-city"], 6)
    t_s, errors = seconds(log), log.range_truth.errors
    starts = log.ranges.epoch_starts
    counts, epochs_s = np.diff(starts), t_s[starts[:-1]]
    assert len(counts) == 1801
    for shift in (0.0, 600.0, 1200.0):
        open_sky, foliage, street = (
            (t_s >= a + shift) & (t_s < b + shift) for a, b in ((120.0, 260.0), (40.0, 120.0), (260.0, 320.0))
        )
        assert np.sqrt(np.mean(errors.pseudorange[open_sky] ** 2)) < 1.5
        assert np.sqrt(np.mean(errors.pseudorange[foliage] ** 2)) > 3.0
        assert np.sqrt(np.mean(errors.pseudorange[street] ** 2)) > 6.0
        assert 4 <= counts[(epochs_s >= 260 + shift) & (epochs_s < 320 + shift)].mean() <= 11
        assert counts[(epochs_s >= 120 + shift) & (epochs_s < 260 + shift)].min() >= 13


def test_a_receiver_without_any_signal_is_refused():
    with pytest.raises(LogError, match="ranges: no samples"):
        simulate(replace(OPEN, receiver=Receiver(elevation_mask=1.57)), 1)
