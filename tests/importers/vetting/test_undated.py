"""An IMU that counts from power-on is set to the fixes where one time alone fits; laps, and stamps with a date, are left."""

from dataclasses import replace

import numpy as np
import pytest

from importers.rows.clock import NOMINAL_NS
from importers.vetting.undated import set_to_fixes
from navreplay.timeline import ImuSeries
from tests.field.promise import spoil

LOG = spoil("town", None).log


def counted(imu: ImuSeries, on_s: float) -> ImuSeries:
    return replace(imu, t_ns=imu.t_ns - imu.t_ns[0] + NOMINAL_NS + round(on_s * 1e9))


@pytest.mark.parametrize("on_s", [3.0, 40_000.0])
def test_turns_tell_the_time(on_s: float) -> None:
    part = slice(1500, None)  # the IMU begins 15 s behind the fixes
    imu = ImuSeries(LOG.imu.t_ns[part], LOG.imu.gyro[part], LOG.imu.accel[part], LOG.imu.increments)
    found = set_to_fixes(counted(imu, on_s), LOG.fixes)
    assert found is not None
    assert abs(int(found[0].t_ns[0]) - int(imu.t_ns[0])) < 0.4e9
    assert "input.imu.time_offset_s" in found[1].hint


def test_stamps_with_a_date_are_believed() -> None:
    assert set_to_fixes(LOG.imu, LOG.fixes) is None


def test_laps_fit_at_several_times_and_none_is_taken() -> None:
    t = np.arange(0, 200, 0.01)
    rate = 0.3 * np.sin(2 * np.pi * t / 20)
    course = np.cumsum(rate) * 0.01
    gyro = np.column_stack([0 * t, 0 * t, rate])
    imu = ImuSeries(NOMINAL_NS + np.rint(t * 1e9).astype(np.int64), gyro, np.tile([0.0, 0.0, -9.8], (len(t), 1)))
    rows = slice(0, None, 100)
    fixes = LOG.fixes
    vel = 10 * np.column_stack([np.cos(course), np.sin(course), 0 * course])[rows]
    n = len(vel)
    ones = np.tile(np.eye(3), (n, 1, 1))
    lla = np.tile(fixes.lla[0], (n, 1))
    laps = type(fixes)(fixes.t_ns[0] + np.arange(n) * 10**9, lla, vel, ones, ones, np.ones(n, dtype=np.int8))
    assert set_to_fixes(imu, laps) is None
