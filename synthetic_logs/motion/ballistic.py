"""A ballistic flight: vertical launch, pitch-over, burn-out, coast; thrust, gravity and attitude are consistent.

The launcher stands on its pad until time 0. From then on its engine pushes along the body's x axis, which turns in the plane of
flight and otherwise keeps its direction against the stars; there is no air. Thrust and attitude are given in closed form, the
motion is the integral of thrust and normal gravitation in inertial space. Units: SI and radians; seconds from the start.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from navreplay.geodesy.earth import earth_rate_n, ecef_from_lla, gravitation, matrix_en, transport_rate_n
from navreplay.geodesy.launch_frame import LaunchFrame, LaunchState, cross_earth_rate, earth_turn
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_matrix
from navreplay.timeline import Floats
from synthetic_logs.motion.kinematics import Kinematics
from synthetic_logs.motion.manoeuvres import smooth_step

__all__ = ["BallisticFlight", "BallisticPath"]


@dataclass(frozen=True, slots=True)
class BallisticFlight:
    """lla: latitude, longitude [rad], height [m] of the pad. azimuth: of the plane of flight, clockwise from north [rad].

    lift_off [m/s^2]: specific force at the start; it grows with 1 / (1 - t / exhaustion), exhaustion [s], as fuel is spent,
    until the engine fades out within fade [s] before burn_out [s]. The pitch against the launch frame goes from 90 degrees to
    final_pitch [rad] smoothly in turn_window (start, end) [s]. Raises ValueError unless the fuel outlasts the burn.
    """

    lla: tuple[float, float, float]
    azimuth: float
    lift_off: float = 18.0
    exhaustion: float = 135.0
    burn_out: float = 110.0
    fade: float = 2.0
    turn_window: tuple[float, float] = (8.0, 80.0)
    final_pitch: float = 45 * pi / 180

    def __post_init__(self) -> None:
        if self.exhaustion <= self.burn_out:
            raise ValueError(f"the fuel must outlast the burn of {self.burn_out} s, but lasts {self.exhaustion} s")

    @property
    def frame(self) -> LaunchFrame:
        """The launch-inertial frame of the flight."""
        return LaunchFrame(self.lla, self.azimuth)

    def thrust(self, t_s: Floats) -> Floats:
        """Specific force along body x (n,) [m/s^2] at t_s (n,)."""
        fading, _ = smooth_step((t_s - (self.burn_out - self.fade)) / self.fade)
        return np.asarray(self.lift_off / (1 - np.minimum(t_s, self.burn_out) / self.exhaustion) * (1 - fading))

    def pitch(self, t_s: Floats) -> tuple[Floats, Floats]:
        """Pitch (n,) [rad] of body x above the horizon of the launch frame, and its rate (n,) [rad/s]."""
        start, end = self.turn_window
        share, slope = smooth_step((t_s - start) / (end - start))
        change = self.final_pitch - pi / 2
        return pi / 2 + change * share, change * slope / (end - start)

    def trace(self, duration: float) -> "BallisticPath":
        """The flight over duration [s], integrated to below a millimetre."""
        frame = self.frame

        def derivative(t: float, y: Floats) -> Floats:
            """Of position and velocity (6,) in the axes of the Earth at launch."""
            pitch, _ = self.pitch(np.array([t]))
            push = self.thrust(np.array([t]))[0] * (frame.c_il @ [np.cos(pitch[0]), np.sin(pitch[0]), 0.0])
            return np.concatenate([y[3:], push + gravitation(y[:3])])

        start = np.concatenate([frame.origin_i, cross_earth_rate(frame.origin_i)])
        # short steps: the interpolant between them is of lower order than the steps
        solved = solve_ivp(derivative, (0.0, duration), start, "DOP853", dense_output=True, max_step=1.0, rtol=1e-12, atol=1e-9)
        return BallisticPath(self, solved.sol)


@dataclass(frozen=True, eq=False, slots=True)
class BallisticPath:
    """A flight made ready for evaluation at any time within its duration; orbit: its solution in the axes of the Earth at
    launch, position [m] and velocity [m/s]."""

    flight: BallisticFlight
    orbit: OdeSolution

    def at(self, t_s: Floats) -> Kinematics:
        """The motion at times t_s (n,) [s]."""
        frame = self.flight.frame
        solved = self.orbit(t_s).T
        pitch, pitch_rate = self.flight.pitch(t_s)
        c_lb = _matrix_lb(pitch)
        position = (solved[:, :3] - frame.origin_i) @ frame.c_il
        lla, vel_n, q_nb = frame.to_earth(t_s, LaunchState(position, solved[:, 3:] @ frame.c_il, quat_from_matrix(c_lb)))
        push = (self.flight.thrust(t_s)[:, None] * c_lb[:, :, 0]) @ frame.c_il.T
        accel_e = earth_turn(-t_s, push + gravitation(solved[:, :3]))
        c_en, r_e = matrix_en(lla[:, 0], lla[:, 1]), ecef_from_lla(lla)
        vel_e = np.einsum("kij,kj->ki", c_en, vel_n)
        accel_e -= 2 * cross_earth_rate(vel_e) + cross_earth_rate(cross_earth_rate(r_e))
        transport_n = transport_rate_n(lla, vel_n)
        accel_n = np.einsum("kji,kj->ki", c_en, accel_e) - np.cross(transport_n, vel_n)
        zero = np.zeros_like(pitch_rate)
        frame_turn_b = np.einsum("kji,kj->ki", matrix_from_quat(q_nb), earth_rate_n(lla[:, 0]) + transport_n)
        return Kinematics(lla, vel_n, accel_n, q_nb, np.stack([zero, pitch_rate, zero], axis=-1) - frame_turn_b)


def _matrix_lb(pitch: Floats) -> Floats:
    """C_lb (n, 3, 3) of a body in the plane of flight: x along its nose, y to the right, z down where level."""
    sine, cosine, zero, one = np.sin(pitch), np.cos(pitch), np.zeros_like(pitch), np.ones_like(pitch)
    rows = [[cosine, zero, sine], [sine, zero, -cosine], [zero, one, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
