"""Constraints of a vehicle see the states of motion alone, whatever stands behind them: clocks, correlated errors."""

import numpy as np
import pytest

from navreplay.aiding.no_slip import NoSlipAiding
from navreplay.aiding.standstill import StandstillAiding, StopRates
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GRADES, CorrelatedNoise, VehicleOptions
from navreplay.timeline import ImuSeries

T_NS = np.arange(0, 2_000_000_000, 10_000_000)
STATE = NavState.at(np.array([0.8, 0.1, 100.0]), np.array([10.0, 2.0, 0.1]), np.array([1.0, 0.0, 0.0, 0.0]))


def models() -> tuple[ErrorModel, ErrorModel]:
    """15 states, and 18 of which three are correlated errors of positions: as many as with a Gauss-Markov gyro error."""
    inertial = NedErrorModel(GRADES["industrial"])
    return inertial, ClockedModel(inertial, CorrelatedErrors((CorrelatedNoise("position", (1.0, 2.0), 20.0),)))


def jacobian(name: str, model: ErrorModel) -> np.ndarray:
    imu = ImuSeries(T_NS, np.full((len(T_NS), 3), 0.01), np.tile([0.0, 0.0, -9.8], (len(T_NS), 1)))
    epochs = T_NS[100:101]
    if name == "no_slip":
        aiding = NoSlipAiding(imu, epochs, 0.0, VehicleOptions(rear_axle=(-1.0, 0.2, 0.5)), model)
    else:
        aiding = StandstillAiding(epochs, 0.01, model, StopRates(np.full((1, 3), 0.01), np.full(1, 1e-4)))
    measurement = aiding.observe(0, STATE, np.eye(model.size), np.full(3, 1e-4), 0.01).measurement
    assert measurement is not None
    return measurement.jacobian


@pytest.mark.parametrize("name", ["no_slip", "standstill"])
def test_what_stands_behind_the_states_of_motion_is_not_seen(name: str) -> None:
    plain, wider = (jacobian(name, model) for model in models())
    assert plain[:, 9:12].any()
    np.testing.assert_array_equal(wider[:, :15], plain)
    assert not wider[:, 15:].any()
