"""An IMU in any of the 24 axes ends up upright; one whose forces and turns contradict each other is left to be refused."""

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from importers.rows.axes import axes_matrix
from importers.vetting.axes import turn_upright
from navreplay.timeline import ImuSeries
from synthetic_logs import SyntheticLog
from tests.field.promise import spoil

AXES = [
    letters
    for order in permutations(range(3))
    for choice in product((0, 1), repeat=3)
    if np.linalg.det(axes_matrix(letters := "".join(("fb", "rl", "du")[i][c] for i, c in zip(order, choice, strict=True)))) > 0
]


@pytest.fixture(scope="module")
def log() -> SyntheticLog:
    return spoil("town", None).log


def mounted(imu: ImuSeries, axes: str, assumed: str) -> ImuSeries:
    """What is read of a sensor in some axes by someone who assumes others."""
    turn = axes_matrix(assumed) @ axes_matrix(axes).T
    return replace(imu, gyro=imu.gyro @ turn.T, accel=imu.accel @ turn.T)


@pytest.mark.parametrize("axes", AXES)
def test_every_mounting_is_found_where_the_way_forward_shows(log: SyntheticLog, axes: str) -> None:
    assert len(AXES) == 24
    found = turn_upright(mounted(log.imu, axes, "flu"), log.fixes, "flu")
    if axes[2] == "u":  # gravity is where it was assumed: nothing to refute
        assert found is None
        return
    assert found is not None
    imu, letters, finding = found
    assert letters == axes
    assert letters in finding.text
    np.testing.assert_allclose(imu.gyro, log.imu.gyro, atol=1e-12)


def test_without_fixes_gravity_alone_is_put_right(log: SyntheticLog) -> None:
    found = turn_upright(mounted(log.imu, "urb", "frd"), None, "frd")
    assert found is not None
    assert np.median(found[0].accel, axis=0)[2] < -9
    assert found[1][0] == "u"
    assert "do not tell" in found[2].text


def test_forces_against_turns_are_no_mounting(log: SyntheticLog) -> None:
    inverted = replace(log.imu, accel=-log.imu.accel)
    assert turn_upright(inverted, log.fixes, "frd") is None


def test_a_tilt_between_axes_is_left_alone(log: SyntheticLog) -> None:
    c = np.sqrt(0.5)
    turn = np.array([[1.0, 0, 0], [0, c, -c], [0, c, c]])
    imu = replace(log.imu, gyro=log.imu.gyro @ turn.T, accel=log.imu.accel @ turn.T)
    assert turn_upright(imu, log.fixes, "frd") is None
