"""The velocity of a point of the vehicle in the vehicle's own axes, and what is known of it: a car slips neither sideways nor
up.

Source: Dissanayake, Sukkarieh, Nebot and Durrant-Whyte, The aiding of a low-cost strapdown inertial measurement unit using
vehicle model constraints, IEEE Trans. Robotics and Automation 17 (2001) 731; Groves (2013), 15.4. With C_vb from body to
vehicle axes and l from the IMU to the point,
    v_v = C_vb (C_nb' v_n + w x l),
    dv_v = C_vb (C_nb' dv_n + C_nb' [v_n x] phi + [l x] dw_bias + [v_b x] alpha),
where alpha, a small turn of the vehicle axes in body axes, is for those who estimate the mounting.
"""

from typing import NamedTuple

import numpy as np

from navreplay.error_models.ned import ATTITUDE, VELOCITY, gyro_columns
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.fixes import cross_matrix
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats
from navreplay.update.measurement import Measurement

__all__ = [
    "BodyVelocity",
    "Slip",
    "VehiclePoint",
    "body_velocity",
    "no_slip_measurement",
    "wheel_speed_measurement",
    "wheel_turn_measurement",
    "zero_rate_measurement",
]


class VehiclePoint(NamedTuple):
    """c_vb (3, 3): from body to vehicle axes (forward, right, down). lever_b (3,): from the IMU to the point, body axes [m]."""

    c_vb: Floats
    lever_b: Floats


class BodyVelocity(NamedTuple):
    """velocity (3,) [m/s] in vehicle axes. jacobian (3, n) against the error state. mounting (3, 3): against a small turn of
    the vehicle axes, told in body axes [rad]. lever (3, 3): against the lever arm [m]."""

    velocity: Floats
    jacobian: Floats
    mounting: Floats
    lever: Floats


class Slip(NamedTuple):
    """Standard deviation of the velocity across a vehicle's way. lateral, vertical [m/s]: of a straight and even one. angle
    [rad]: of its axes, to both. per_acceleration [rad s^2/m]: slip angle by lateral acceleration. arm [m]: of the point whose
    velocity it is, along the vehicle."""

    lateral: float
    vertical: float
    angle: float
    per_acceleration: float
    arm: float

    def noise(self, speed: float, yaw_rate: float) -> Floats:
        """(2, 2) R of the lateral and vertical velocity at speed [m/s] and yaw_rate [rad/s]."""
        turned = (self.angle * speed) ** 2
        slipped = (self.per_acceleration * speed * yaw_rate * speed) ** 2
        swung = (self.arm * yaw_rate) ** 2
        return np.diag([self.lateral**2 + turned + slipped + swung, self.vertical**2 + turned])


def body_velocity(state: NavState, point: VehiclePoint, rate_b: Floats, size: int) -> BodyVelocity:
    """Of a point of the vehicle that turns with rate_b (3,) against the Earth [rad/s]; error state of given size."""
    c_nb = matrix_from_quat(state.q_nb)
    c_vn = point.c_vb @ c_nb.T
    moved_b = c_nb.T @ state.vel_n + cross_matrix(rate_b) @ point.lever_b
    jacobian = np.zeros((3, size))
    jacobian[:, VELOCITY] = c_vn
    jacobian[:, ATTITUDE] = c_vn @ cross_matrix(state.vel_n)
    swung = point.c_vb @ cross_matrix(point.lever_b)
    for columns in gyro_columns(size):
        jacobian[:, columns] = swung
    mounting = point.c_vb @ cross_matrix(moved_b)
    return BodyVelocity(point.c_vb @ moved_b, jacobian, mounting, point.c_vb @ cross_matrix(rate_b))


def no_slip_measurement(moved: BodyVelocity, yaw_rate: float, slip: Slip) -> Measurement:
    """Lateral and vertical velocity zero (non-holonomic constraint); yaw_rate [rad/s]."""
    noise = slip.noise(abs(float(moved.velocity[0])), yaw_rate)
    return Measurement(-moved.velocity[1:], moved.jacobian[1:], noise, ("no_slip",) * 2, ("right", "down"))


def wheel_speed_measurement(moved: BodyVelocity, speed: float, std: float) -> Measurement:
    """Velocity along the vehicle's way, as its wheels tell it [m/s]."""
    return Measurement(
        np.array([speed - moved.velocity[0]]), moved.jacobian[:1], np.array([[std**2]]), ("wheel_speed",), ("forward",)
    )


def wheel_turn_measurement(turn: float, rate_b: Floats, c_vb: Floats, std: float, size: int) -> Measurement:
    """Angular rate to the right [rad/s], as the difference of left and right wheels tells it, of a body that is computed to
    turn with rate_b (3,) [rad/s]."""
    jacobian = np.zeros((1, size))
    for columns in gyro_columns(size):
        jacobian[0, columns] = -c_vb[2]
    return Measurement(np.array([turn - c_vb[2] @ rate_b]), jacobian, np.array([[std**2]]), ("wheel_turn",), ("right",))


def zero_rate_measurement(rate_b: Floats, earth_b: Floats, c_nb: Floats, std: float, size: int) -> Measurement:
    """Angular rate zero of a body that is computed to turn with rate_b (3,) against the Earth, whose own rate is earth_b (3,)
    in body axes [rad/s]; std [rad/s] per axis."""
    jacobian = np.zeros((3, size))
    for columns in gyro_columns(size):
        jacobian[:, columns] = -np.eye(3)
    jacobian[:, ATTITUDE] = -cross_matrix(earth_b) @ c_nb.T
    return Measurement(-rate_b, jacobian, np.eye(3) * std**2, ("zero_rate",) * 3, ("x", "y", "z"))
