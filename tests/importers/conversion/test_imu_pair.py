"""Angular rates and accelerations on two channels."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from importers.rows.log import Table
from navreplay.timeline import LogError, Timeline
from tests.helpers.memory_log import load_tables

START_NS = 1_700_000_000_000_000_000


def channel_table(rate_hz: float, gyro: bool, accel: bool, seconds: float = 10.0) -> Table:
    """A sensor that turns and speeds up linearly with time, so that interpolation is exact."""
    n = int(seconds * rate_hz)
    t_ns = START_NS + np.rint(np.arange(n) * 1e9 / rate_hz).astype(np.int64)
    grow = ((t_ns - START_NS) / 1e9)[:, None]
    zero = np.zeros((n, 3))
    columns = {
        "header.stamp": t_ns,
        "angular_velocity": grow * [0.1, 0.2, 0.3] if gyro else zero,
        "linear_acceleration": grow * [1.0, 2.0, 3.0] + [0, 0, 9.8] if accel else zero,
    }
    return Table(t_ns, columns, n)


def load(folder: Path, tables: dict[str, Table], **imu: Any) -> Timeline:
    typed = {name: ("sensor_msgs/msg/Imu", table) for name, table in tables.items()}
    return load_tables(folder, typed, {"imu": {"axes": "frd", "gyro_unit": "rad/s", **imu}})


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("/camera/gyro/sample", "/camera/accel/sample"), {}),
        (("/gyroscope", "/accelerometer"), {}),
        (("/imu/gyro", "/imu/acc"), {}),
        (("/imu/angular_velocity", "/imu/linear_acceleration"), {}),
        (("/camera/gyro/sample", "/camera/accel/sample"), {"channel": "/camera/gyro/sample"}),
        (("/a", "/b"), {"channel": "/a", "accel_channel": "/b"}),
    ],
    ids=str,
)
@pytest.mark.parametrize("accel_hz", [50.0, 100.0, 125.0])
def test_accelerations_of_another_channel(
    tmp_path: Path, names: tuple[str, str], told: dict[str, str], accel_hz: float
) -> None:
    timeline = load(
        tmp_path, {names[0]: channel_table(100.0, True, False), names[1]: channel_table(accel_hz, False, True)}, **told
    )
    assert timeline.imu is not None
    seconds = (timeline.imu.t_ns - timeline.imu.t_ns[0])[:, None] / 1e9
    assert len(seconds) >= 995
    assert np.allclose(timeline.imu.gyro, seconds * [0.1, 0.2, 0.3], atol=1e-9)
    assert np.allclose(timeline.imu.accel, seconds * [1.0, 2.0, 3.0] + [0, 0, 9.8], atol=1e-6)
    assert {use.name: use.role for use in timeline.provenance.channels} == {names[0]: "imu", names[1]: "accel"}
    assert all(use.read == use.used + sum(use.rejected.values()) for use in timeline.provenance.channels)


def test_a_whole_sensor_keeps_its_own_accelerations(tmp_path: Path) -> None:
    timeline = load(tmp_path, {"/gyro": channel_table(100.0, True, True), "/accel": channel_table(50.0, False, True)})
    assert timeline.imu is not None
    assert {use.name: use.role for use in timeline.provenance.channels} == {"/gyro": "imu", "/accel": "unused"}


def test_accelerations_are_not_made_up_in_a_gap(tmp_path: Path) -> None:
    accel = channel_table(50.0, False, True)
    kept = (accel.log_time_ns < START_NS + 3 * 10**9) | (accel.log_time_ns > START_NS + 5 * 10**9)
    columns = {name: column[kept] for name, column in accel.columns.items()}
    timeline = load(
        tmp_path,
        {"/gyro": channel_table(100.0, True, False), "/accel": Table(accel.log_time_ns[kept], columns, int(kept.sum()))},
    )
    assert timeline.imu is not None
    inside = (timeline.imu.t_ns - timeline.imu.t_ns[0]) / 1e9
    assert not ((inside > 3.0) & (inside < 5.0)).any()


def test_a_channel_without_accelerations_is_told(tmp_path: Path) -> None:
    tables = {"/a": channel_table(100.0, True, False), "/b": channel_table(100.0, True, False)}
    with pytest.raises(LogError, match="/b: holds no accelerations"):
        load(tmp_path, tables, channel="/a", accel_channel="/b")
    with pytest.raises(LogError, match=r"/a: holds no accelerations .*name that one with input\.imu\.accel_channel"):
        load(tmp_path, tables, channel="/a")
