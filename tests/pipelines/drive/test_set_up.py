"""What a log tells of its own set-up: offsets are believed only where the filter bears them out; the direction of travel."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.timeline import Timeline
from pipelines.config.spec import validate
from pipelines.drive.set_up import find_set_up
from pipelines.drive.time_offset import shift_imu
from tests.field.promise import DRIVES, spoil

CONFIG = validate({}, "test")


def timeline(drive: str, fault: str | None = None) -> Timeline:
    return replace(spoil(drive, fault).log.timeline(), reference=None)


@pytest.mark.parametrize("offset", [-0.5, -0.2, 0.2, 0.5])
@pytest.mark.parametrize("drive", ["town-rtk", "flight"])
def test_an_offset_is_found_and_moved(drive: str, offset: float) -> None:
    given = timeline(drive, f"imu-late-{offset:g}s")
    moved, _, findings = find_set_up(given, CONFIG)
    assert [finding.code for finding in findings] == ["time-offset"]
    assert (moved.imu.t_ns - given.imu.t_ns)[0] / 1e9 == pytest.approx(-offset, abs=0.03)


@pytest.mark.parametrize("drive", DRIVES)
def test_a_sound_log_is_not_moved(drive: str) -> None:
    given = timeline(drive)
    moved, forward, findings = find_set_up(given, CONFIG)
    assert moved is given
    assert (forward, findings) == (0.0, ())


@pytest.mark.parametrize("turn", [np.pi, np.pi / 2, -np.pi / 2])
def test_the_direction_of_travel_is_found_in_the_axes_of_the_imu(turn: float) -> None:
    given = timeline("town-rtk")
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    turned = replace(given, imu=replace(given.imu, gyro=given.imu.gyro @ matrix.T, accel=given.imu.accel @ matrix.T))
    _, forward, findings = find_set_up(turned, CONFIG)
    assert np.cos(forward + turn) > np.cos(np.radians(8))
    assert findings[0].code == "forward-axis"
    told = validate({"alignment": {"forward_deg": 0.0}}, "test")
    assert find_set_up(turned, told)[1] == 0.0


def test_moving_stamps_is_exact() -> None:
    given = timeline("town")
    assert np.array_equal(shift_imu(shift_imu(given, 0.25), -0.25).imu.t_ns, given.imu.t_ns)
