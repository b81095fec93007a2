"""Starts in motion: whatever way the IMU's axes point, however wrong the course is as a heading."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.earth import ned_between
from navreplay.options import FilterOptions
from navreplay.timeline import GnssFixSeries, ImuSeries, Timeline
from tests.field.promise import DRIVES, spoil


def moving(drive: str, turn: float, start_s: float = 60.0) -> Timeline:
    """The drive from start_s on, its IMU turned about the vertical by turn [rad]."""
    log = spoil(drive, None).log
    begin = log.imu.t_ns[0] + round(start_s * 1e9)
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    late = log.imu.t_ns >= begin
    imu = ImuSeries(log.imu.t_ns[late], log.imu.gyro[late] @ matrix.T, log.imu.accel[late] @ matrix.T, log.imu.increments)
    fixes, rows = log.fixes, log.fixes.t_ns >= begin
    parts = fixes.t_ns, fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel, fixes.status
    return replace(log.timeline(), imu=imu, fixes=GnssFixSeries(*(part[rows] for part in parts)))


@pytest.mark.parametrize("turn", np.radians([0.0, 90.0, 135.0, 180.0, -90.0]))
@pytest.mark.parametrize("drive", ["town", "town-rtk", "town-positions"])
def test_a_start_in_motion_finds_its_heading(drive: str, turn: float) -> None:
    timeline = moving(drive, turn)
    options = FilterOptions(imu_noise=DRIVES[drive].imu.noise, output_rate=0.0)
    solution = run_filter(timeline, build_method("checked"), options)
    truth = timeline.reference
    at = np.searchsorted(truth.t_ns, solution.t_ns[solution.t_ns <= truth.t_ns[-1]])
    error = np.hypot(*ned_between(truth.lla[at], solution.lla[: len(at)])[:, :2].T)
    limit = {"town": 2.7, "town-rtk": 0.4, "town-positions": 2.7}[drive]
    assert np.sqrt(np.mean(error[5:] ** 2)) < limit
    tried = any("tried, one with heading" in event.text for event in solution.events)
    assert tried or abs(turn) < np.radians(100)


def test_a_good_start_is_left_alone() -> None:
    timeline = moving("town-rtk", 0.0)
    options = FilterOptions(imu_noise=DRIVES["town-rtk"].imu.noise, output_rate=0.0)
    solution = run_filter(timeline, build_method("fixed"), options)
    assert not any("contradicts the first" in event.text for event in solution.events)
