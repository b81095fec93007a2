"""Synthetic faults do what they say, and leave the rest of a log as it was."""

import numpy as np
import pytest

from synthetic_logs.faults import FAULTS
from tests.field.promise import DRIVES, spoil


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_changes_what_it_names_and_nothing_else(name: str) -> None:
    sound, spoilt = spoil("town", None).log, spoil("town", name).log
    same_imu = np.array_equal(sound.imu.t_ns, spoilt.imu.t_ns) and np.array_equal(sound.imu.gyro, spoilt.imu.gyro)
    assert same_imu == (FAULTS[name].kind != "clock")
    if FAULTS[name].kind == "velocity":
        assert np.array_equal(sound.fixes.lla, spoilt.fixes.lla)
        assert not np.array_equal(sound.fixes.vel_n, spoilt.fixes.vel_n)
    if FAULTS[name].kind in ("jump", "frozen"):
        assert np.array_equal(np.unique(sound.fixes.vel_n[0]), np.unique(spoilt.fixes.vel_n[0]))
    assert np.array_equal(spoilt.truth.lla, sound.truth.lla)


def test_names_tell_apart() -> None:
    assert len({fault.description for fault in FAULTS.values()}) == len(FAULTS)
    assert {"town", "town-rtk", "town-positions", "flight"} == set(DRIVES)
