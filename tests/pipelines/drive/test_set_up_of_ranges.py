"""The set-up of a log with ranges is found by the positions of its single epochs."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.timeline import Timeline
from pipelines.config.spec import load_config
from pipelines.drive.process import Drive, filter_drive
from pipelines.drive.set_up import find_set_up
from synthetic_logs import SCENARIOS, simulate

CONFIG = load_config(None, ["imu.grade=tactical", "output.rate_hz=0"])


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    return simulate(SCENARIOS["ranges-open"], 1).timeline()


@pytest.mark.parametrize("late_s", [0.3, -1.0])
def test_an_imu_stamped_at_another_time_is_moved(timeline: Timeline, late_s: float) -> None:
    assert timeline.imu is not None
    late = replace(timeline, imu=replace(timeline.imu, t_ns=timeline.imu.t_ns + round(late_s * 1e9)))
    moved, forward, findings = find_set_up(late, CONFIG)
    assert moved.imu is not None
    assert (moved.imu.t_ns[0] - timeline.imu.t_ns[0]) / 1e9 == pytest.approx(0.0, abs=0.03)
    assert [finding.code for finding in findings] == ["time-offset"]
    assert moved.ranges is late.ranges
    result = filter_drive(Drive(moved, findings, {}, forward), CONFIG)
    assert result.evaluation is not None
    assert result.evaluation.statistics["outside"]["position"]["horizontal"].rms < 0.3


def test_a_log_whose_stamps_agree_is_left_alone(timeline: Timeline) -> None:
    found, forward, findings = find_set_up(timeline, CONFIG)
    assert (forward, findings) == (0.0, ())
    assert found.imu is not None
    assert timeline.imu is not None
    np.testing.assert_array_equal(found.imu.t_ns, timeline.imu.t_ns)
