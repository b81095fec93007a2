"""The velocity of a point of the vehicle in its own axes: derivatives, noise, zero rate."""

import numpy as np
import pytest

from navreplay.error_models.ned import NedErrorModel
from navreplay.geodesy.earth import earth_rate_n
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_euler, skew
from navreplay.measurements.body_velocity import (
    Slip,
    VehiclePoint,
    body_velocity,
    no_slip_measurement,
    zero_rate_measurement,
)
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GRADES

MODEL = NedErrorModel(GRADES["tactical"])
STATE = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([10.0, -3.0, 0.5]), quat_from_euler(0.1, -0.2, 1.0))
POINT = VehiclePoint(matrix_from_quat(quat_from_euler(0.02, 0.1, -0.2)), np.array([-2.0, 0.3, 0.5]))
RATE = np.array([0.1, 0.2, 0.6])


def at(state=STATE, point=POINT):
    return body_velocity(state, point, RATE - state.gyro_bias, MODEL.size)


def test_jacobian_is_the_derivative():
    for i, step in enumerate(np.repeat([1.0, 1e-3, 1e-6, 1e-3, 1e-3], 3)):
        slope = (at(MODEL.retract(STATE, step * np.eye(15)[i])).velocity - at().velocity) / step
        np.testing.assert_allclose(at().jacobian[:, i], slope, atol=1e-4)


def test_mounting_and_lever_are_the_derivatives():
    for axis in np.eye(3):
        turned = VehiclePoint(POINT.c_vb @ (np.eye(3) - skew(1e-6 * axis)), POINT.lever_b)
        np.testing.assert_allclose(at().mounting @ axis, (at(point=turned).velocity - at().velocity) / 1e-6, atol=1e-4)
        moved = POINT._replace(lever_b=POINT.lever_b + axis)
        np.testing.assert_allclose(at().lever @ axis, at(point=moved).velocity - at().velocity, atol=1e-12)


def test_a_car_that_turns_about_its_rear_axle_does_not_slip_there():
    """The IMU, 2 m before it, moves sideways."""
    c_nb = matrix_from_quat(STATE.q_nb)
    rate_b = np.array([0.0, 0.0, 0.4])
    at_axle, lever_b = np.array([8.0, 0.0, 0.0]), np.array([-2.0, 0.0, 0.0])
    state = NavState.at(STATE.lla, c_nb @ (at_axle - np.cross(rate_b, lever_b)), STATE.q_nb)
    point = VehiclePoint(np.eye(3), lever_b)
    measured = no_slip_measurement(body_velocity(state, point, rate_b, 15), 0.4, Slip(0.1, 0.1, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(measured.residual, 0.0, atol=1e-12)
    wrong = no_slip_measurement(
        body_velocity(state, VehiclePoint(np.eye(3), np.zeros(3)), rate_b, 15), 0.4, Slip(0.1, 0.1, 0, 0, 0)
    )
    assert wrong.residual[0] == pytest.approx(-0.8)


def test_noise_grows_with_speed_turning_and_lateral_acceleration():
    slip = Slip(0.1, 0.2, np.radians(1), 0.005, 1.5)
    still, fast, turning = (np.sqrt(np.diag(slip.noise(*motion))) for motion in ((0.0, 0.0), (20.0, 0.0), (20.0, 0.2)))
    np.testing.assert_allclose(still, [0.1, 0.2])
    np.testing.assert_allclose(fast, np.hypot([0.1, 0.2], 20 * np.radians(1)))
    assert turning[0] ** 2 == pytest.approx(fast[0] ** 2 + (0.005 * 20 * 0.2 * 20) ** 2 + (1.5 * 0.2) ** 2)
    assert turning[1] == fast[1]


def test_zero_rate_is_the_gyro_less_bias_and_earth():
    def measure(state):
        c_nb = matrix_from_quat(state.q_nb)
        earth_b = c_nb.T @ earth_rate_n(state.lla[0])
        return zero_rate_measurement(RATE - state.gyro_bias - earth_b, earth_b, c_nb, 1e-3, 15)

    measured = measure(STATE)
    for i in range(6, 12):
        slope = -(measure(MODEL.retract(STATE, 1e-4 * np.eye(15)[i])).residual - measured.residual) / 1e-4
        np.testing.assert_allclose(measured.jacobian[:, i], slope, atol=1e-8)
