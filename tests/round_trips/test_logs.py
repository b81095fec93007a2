"""Synthetic log, every writer, importer: equal to the last bit the format can hold (degrees cost a unit in the last place)."""

from dataclasses import fields, replace

import numpy as np
import pytest

from importers.load import load_timeline
from navreplay.geodesy.time_scales import WEEK_S
from synthetic_logs import SCENARIOS, simulate, with_duration, write

RANGES = simulate(with_duration(SCENARIOS["ermakf-city"], 60.0), 11)
CAR = simulate(SCENARIOS["car-short"], 11)


def assert_same_log(timeline, log):
    assert timeline.imu.increments == log.imu.increments
    for name in ("t_ns", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(timeline.imu, name), getattr(log.imu, name))
    for name in ("t_ns", "vel_n", "cov_pos", "status"):
        np.testing.assert_array_equal(getattr(timeline.fixes, name), getattr(log.fixes, name))
    np.testing.assert_allclose(timeline.fixes.lla, log.fixes.lla, rtol=3e-16)
    np.testing.assert_array_equal(timeline.reference.t_ns, log.truth.t_ns)
    np.testing.assert_allclose(timeline.reference.lla, log.truth.lla, rtol=3e-16)
    np.testing.assert_array_equal(timeline.reference.vel_n, log.truth.vel_n)
    np.testing.assert_allclose(timeline.reference.q_nb, log.truth.q_nb, atol=3e-16)


@pytest.mark.parametrize("name", ["log.mcap", "log.bag", "log.db3", "log", "log.csv"])
def test_car_comes_back(tmp_path, name):
    *paths, truth = write(CAR, tmp_path / name)
    timeline = load_timeline(paths, reference=truth)
    assert_same_log(timeline, CAR)
    told_velocity = CAR.fixes.cov_vel if name == "log.csv" else np.full_like(CAR.fixes.cov_vel, np.nan)
    np.testing.assert_allclose(timeline.fixes.cov_vel, told_velocity, rtol=3e-16)


def test_increments_come_back_as_increments_from_csv(tmp_path):
    log = simulate(SCENARIOS["aircraft-spiral"], 11)
    *paths, truth = write(log, tmp_path / "log.csv")
    assert_same_log(load_timeline(paths, reference=truth), log)


@pytest.mark.parametrize("name", ["log.mcap", "log.csv"])
def test_ranges_come_back_exactly(tmp_path, name):
    *paths, truth = write(RANGES, tmp_path / name)
    ranges = load_timeline(paths, reference=truth).ranges
    expected = RANGES.ranges if name == "log.mcap" else replace(RANGES.ranges, klobuchar=None)
    for field in fields(ranges):
        np.testing.assert_array_equal(getattr(ranges, field.name), getattr(expected, field.name))


def assert_ranges_from_ephemerides(ranges, expected, pseudorange, range_rate, cn0):
    """Equal to these tolerances; satellites to a millimetre, for the delay of the atmosphere sets back their time."""
    for name in ("t_ns", "sat", "signal", "klobuchar", "ionosphere_removed", "troposphere_removed"):
        np.testing.assert_array_equal(getattr(ranges, name), getattr(expected, name))
    np.testing.assert_allclose(ranges.pseudorange, expected.pseudorange, rtol=0, atol=pseudorange)
    np.testing.assert_allclose(ranges.range_rate, expected.range_rate, rtol=0, atol=range_rate)
    np.testing.assert_allclose(ranges.cn0, expected.cn0, rtol=0, atol=cn0)
    np.testing.assert_allclose(ranges.sat_pos_e, expected.sat_pos_e, rtol=0, atol=1e-3)
    np.testing.assert_allclose(ranges.sat_vel_e, expected.sat_vel_e, rtol=0, atol=1e-6)


def test_ranges_come_back_from_rinex_to_its_last_digit(tmp_path):
    *paths, truth = write(RANGES, tmp_path / "log.obs")
    timeline = load_timeline(paths, reference=truth)
    np.testing.assert_array_equal(timeline.imu.gyro, RANGES.imu.gyro)
    assert_ranges_from_ephemerides(timeline.ranges, RANGES.ranges, 6e-4, 1e-4, 6e-4)


@pytest.mark.parametrize("name", ["log.bag", "log.db3", "log"])
def test_ranges_come_back_from_bags(tmp_path, name):
    *paths, truth = write(RANGES, tmp_path / name)
    ranges = load_timeline(paths, reference=truth).ranges
    assert_ranges_from_ephemerides(ranges, RANGES.ranges, 1e-7, 1e-7, 0)
    np.testing.assert_array_equal(ranges.pseudorange_std, RANGES.ranges.pseudorange_std)
    np.testing.assert_allclose(ranges.range_rate_std, RANGES.ranges.range_rate_std, rtol=1e-14)


@pytest.mark.parametrize("into_week_s", [-20, 3, 10])
def test_ranges_come_back_across_the_end_of_a_gps_week(tmp_path, into_week_s):
    scenario = with_duration(SCENARIOS["ranges-resets"], 40.0)
    start_ns = (2305 * WEEK_S + into_week_s) * 1_000_000_000
    log = simulate(replace(scenario, journey=replace(scenario.journey, start_ns=start_ns, gnss_offset=0.25)), 3)
    *paths, truth = write(log, tmp_path / "log.obs")
    assert_ranges_from_ephemerides(load_timeline(paths, reference=truth).ranges, log.ranges, 6e-4, 1e-4, 6e-4)
