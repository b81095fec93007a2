"""The set-up as states: what a lever arm and delays change in fixes, by differences; without parameters nothing is there."""

import numpy as np
import pytest

from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.error_models.set_up import PARAMETERS, STILL, FixStates, Moving, SetUpStates
from navreplay.geodesy.rotation import matrix_from_euler
from navreplay.options import SetUpOptions

NAMES = tuple(PARAMETERS)
STATES = SetUpStates(SetUpOptions(NAMES, tuple(map(tuple, np.diag([1.0, 1, 1, 0.09, 0.09]).tolist()))))
MOVING = Moving(
    matrix_from_euler(0.1, -0.2, 1.0), np.array([0.1, -0.2, 0.4]), np.array([9.0, -3, 0.5]), np.array([1.0, 2, -0.3])
)


def antenna(kind: str, values: np.ndarray) -> np.ndarray:
    """What is measured of a kind beside the IMU's own motion."""
    lever = STATES.lever(values)
    arm = MOVING.c_nb @ (lever if kind == "position" else np.cross(MOVING.rate_b, lever))
    return arm + STATES.shift(kind, values, MOVING)


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_the_jacobian_is_that_of_the_measurement(kind: str) -> None:
    step = 1e-6
    columns = [(antenna(kind, step * one) - antenna(kind, -step * one)) / (2 * step) for one in np.eye(len(NAMES))]
    assert STATES.jacobian(kind, MOVING) == pytest.approx(np.column_stack(columns), abs=1e-8)


def test_a_start_at_a_fix_is_off_by_what_the_set_up_is_off_by() -> None:
    states = FixStates(CorrelatedErrors(()), STATES)
    cov = states.enter(np.eye(15) * 1e-4, MOVING)
    seen = np.hstack([np.eye(3), np.zeros((3, 12)), STATES.jacobian("position", MOVING)])
    # the fix that it was started from holds no more than the noise it was told
    assert seen @ cov @ seen.T == pytest.approx(np.eye(3) * 1e-4, abs=1e-9)
    assert np.linalg.eigvalsh(cov).min() > 0


def test_constants_neither_move_nor_grow() -> None:
    states = FixStates(CorrelatedErrors(()), STATES)
    assert np.array_equal(states.transitions(np.array([1.0, 9.0]))[1], np.eye(5))
    assert not states.noises(np.array([1.0, 9.0])).any()


def test_without_parameters_nothing_changes() -> None:
    states = FixStates(CorrelatedErrors(()), SetUpStates(SetUpOptions()))
    cov = np.eye(15)
    assert states.size == 0
    assert states.enter(cov, STILL) is cov
