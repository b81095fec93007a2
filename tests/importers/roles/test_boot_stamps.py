"""Stamps that count from power-on: set to UTC by the recorder's clock, without a setting, and anew behind a restart."""

from pathlib import Path

import numpy as np
import pytest

from importers.rows.log import Table
from navreplay.geodesy.time_scales import LEAP_SECONDS, gps_from_utc
from navreplay.timeline import LogError
from tests.helpers.memory_log import load_tables

START_NS = 1_700_000_000_000_000_000
N = 2000


def imu_table(boot_ns: np.ndarray, utc_ns: np.ndarray, latest_ms: float = 20.0) -> Table:
    """Samples taken at utc_ns, stamped boot_ns, recorded up to some milliseconds later."""
    rng = np.random.default_rng(4)
    delay = rng.uniform(0, latest_ms * 1e6, len(utc_ns)).astype(np.int64)
    delay[:: len(utc_ns) // 10] = 0
    columns = {
        "header.stamp": boot_ns,
        "angular_velocity": rng.normal(0, 0.01, (len(utc_ns), 3)),
        "linear_acceleration": rng.normal(0, 0.01, (len(utc_ns), 3)) + [0, 0, 9.8],
    }
    return Table(utc_ns + delay, columns, len(utc_ns))


def read(folder: Path, table: Table, **imu: object) -> np.ndarray:
    timeline = load_tables(folder, {"/imu": ("sensor_msgs/msg/Imu", table)}, {"imu": imu})
    assert timeline.imu is not None
    return timeline.imu.t_ns


@pytest.mark.parametrize("base", ["auto", "boot"])
@pytest.mark.parametrize("restarts", [0, 1, 3])
def test_stamps_are_set_to_the_recorders_clock(tmp_path: Path, restarts: int, base: str) -> None:
    utc_ns = START_NS + np.arange(N) * 10**7
    boot_ns = np.arange(N) * 10**7 + 5 * 10**9
    for part in range(1, restarts + 1):
        at = part * N // (restarts + 1)
        boot_ns[at:] = np.arange(N - at) * 10**7 + part * 10**8
    t_ns = read(tmp_path, imu_table(boot_ns, utc_ns), time_base=base)
    assert len(t_ns) == N
    assert np.abs(t_ns - gps_from_utc(utc_ns, LEAP_SECONDS)).max() < 1_000_000


def test_a_clock_that_stands_still_is_not_taken_for_one(tmp_path: Path) -> None:
    utc_ns = START_NS + np.arange(N) * 10**7
    with pytest.raises(LogError, match="stamps lie before 1990, so the clock that made them was never set"):
        read(tmp_path, imu_table(np.zeros(N, dtype=np.int64), utc_ns))


def test_a_clock_that_runs_at_another_speed_is_not_taken_for_one(tmp_path: Path) -> None:
    utc_ns = START_NS + np.arange(N) * 10**7
    with pytest.raises(LogError, match="stamps lie before 1990"):
        read(tmp_path, imu_table(np.arange(N) * 10**8, utc_ns))
