"""Smooth trajectories from legs: straight, accelerate, turn, climb, spiral, stop.

Speed, climb angle and course rate are piecewise polynomials in time whose steps are seventh-order smooth steps, so all three
are three times continuously differentiable; course is the exact integral. The body x axis points along the velocity: yaw is
the course, pitch the climb angle, and roll either zero (a car) or that of a coordinated turn (an aircraft). Position is the
integral of the velocity over the WGS-84 ellipsoid by Gauss-Legendre quadrature. Units: SI and radians; NED; times in seconds
from the start of the motion.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, cycle
from math import pi, tan

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PPoly

from navreplay.geodesy.earth import radii
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.timeline import Floats
from synthetic_logs.motion.kinematics import Kinematics

__all__ = [
    "LegPath",
    "Motion",
    "Segment",
    "accelerate",
    "climb",
    "course_rate_of_bank",
    "smooth_step",
    "spiral",
    "stop",
    "straight",
    "turn",
]

_STANDARD_GRAVITY = 9.80665
_SMOOTH_STEP = (-20.0, 70.0, -84.0, 35.0)
"""Coefficients of u^7 .. u^4 of the polynomial from 0 to 1 on [0, 1] whose first three derivatives vanish at both ends."""
_PANEL_S = 0.02
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(3)[0] + 1) / 2, np.polynomial.legendre.leggauss(3)[1] / 2


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of duration [s] at whose end speed [m/s], climb angle [rad] and course rate [rad/s] are reached smoothly.

    speed None keeps the speed. Raises ValueError unless the duration is positive and the climb angle is below 90 degrees.
    """

    duration: float
    speed: float | None = None
    climb: float = 0.0
    course_rate: float = 0.0

    def __post_init__(self) -> None:
        if self.duration <= 0:
            raise ValueError(
                f"a segment of the motion must last longer than 0 s, got {self.duration} s; is a turn shorter than its ramps?"
            )
        if abs(self.climb) >= pi / 2:
            raise ValueError(f"a climb angle must be below 90 degrees, got {self.climb} rad")


Leg = tuple[Segment, ...]


def straight(duration: float) -> Leg:
    """Level and straight at the present speed for duration [s]."""
    return (Segment(duration),)


def accelerate(speed: float, duration: float) -> Leg:
    """Straight to another speed [m/s] within duration [s]; the largest acceleration is 2.19 times the mean."""
    return (Segment(duration, speed=speed),)


def spiral(angle: float, rate: float, climb_angle: float, ramp: float = 4.0) -> Leg:
    """Turn by angle [rad, positive to the right] at rate [rad/s, positive] while climbing at climb_angle [rad].

    ramp [s]: time in which the course rate and the climb angle build up, and again go back to zero.
    Raises ValueError for a turn that is shorter than its ramps.
    """
    signed = float(np.copysign(rate, angle))
    hold = abs(angle) / rate - ramp
    return (Segment(ramp, None, climb_angle, signed), Segment(hold, None, climb_angle, signed), Segment(ramp))


def turn(angle: float, rate: float, ramp: float = 2.0) -> Leg:
    """Level turn by angle [rad, positive to the right] at rate [rad/s, positive]; ramp and errors as in `spiral`."""
    return spiral(angle, rate, 0.0, ramp)


def climb(angle: float, duration: float, ramp: float = 4.0) -> Leg:
    """Straight climb (descent where negative) at angle [rad] over duration [s], both ramps [s] included."""
    return (Segment(ramp, climb=angle), Segment(duration - 2 * ramp, climb=angle), Segment(ramp))


def stop(wait: float, braking: float) -> Leg:
    """Brakes to standstill within braking [s] and stands for wait [s]."""
    return (Segment(braking, speed=0.0), Segment(wait))


def course_rate_of_bank(bank: float, speed: float) -> float:
    """Course rate [rad/s] of a level coordinated turn with bank [rad] at speed [m/s]."""
    return _STANDARD_GRAVITY * tan(bank) / speed


@dataclass(frozen=True, slots=True)
class Motion:
    """Where a motion starts and what follows.

    lla: latitude, longitude [rad], height [m] at the start. legs: segments run once; loop: segments repeated behind them for
    as long as needed (where empty, the motion goes on straight). speed [m/s], course [rad] at the start. coordinated: banks in
    turns like an aircraft.
    """

    lla: tuple[float, float, float]
    legs: Leg
    loop: Leg = ()
    speed: float = 0.0
    course: float = 0.0
    coordinated: bool = False

    def segments(self) -> Iterator[Segment]:
        """The segments in order, without end."""
        return chain(self.legs, cycle(self.loop or straight(60.0)))

    def trace(self, duration: float) -> "LegPath":
        """The motion integrated over duration [s]."""
        panels = int(np.ceil(duration / _PANEL_S)) + 1
        grid = np.arange(panels + 1, dtype=np.float64) * _PANEL_S
        profile, course = _profiles(self, float(grid[-1]))
        lla = _integrate_position(np.array(self.lla), profile, course, grid)
        return LegPath(duration, self.coordinated, profile, course, lla)


@dataclass(frozen=True, eq=False, slots=True)
class LegPath:
    """A motion made ready for evaluation at any time within duration [s]; see `Motion.trace`."""

    duration: float
    coordinated: bool
    profile: PPoly
    course: PPoly
    lla: CubicHermiteSpline

    def at(self, t_s: Floats) -> Kinematics:
        """The motion at times t_s (n,) [s]; derivatives are analytic, position is exact to 1e-8 m."""
        speed, pitch, yaw_rate = self.profile(t_s).T
        speed_rate, pitch_rate, yaw_accel = self.profile.derivative()(t_s).T
        yaw = self.course(t_s)
        sp, cp, sy, cy = np.sin(pitch), np.cos(pitch), np.sin(yaw), np.cos(yaw)
        across, across_rate = speed * cp, speed_rate * cp - speed * sp * pitch_rate
        vel_n = np.stack([across * cy, across * sy, -speed * sp], axis=-1)
        north = across_rate * cy - across * sy * yaw_rate
        east = across_rate * sy + across * cy * yaw_rate
        accel_n = np.stack([north, east, -speed_rate * sp - speed * cp * pitch_rate], axis=-1)
        roll, roll_rate = np.zeros_like(yaw), np.zeros_like(yaw)
        if self.coordinated:
            slope = across * yaw_rate / _STANDARD_GRAVITY
            roll = np.arctan(slope)
            roll_rate = (across_rate * yaw_rate + across * yaw_accel) / _STANDARD_GRAVITY / (1 + slope**2)
        turn_b = _turn_rate_b(roll, pitch, roll_rate, pitch_rate, yaw_rate)
        return Kinematics(self.lla(t_s), vel_n, accel_n, quat_from_euler(roll, pitch, yaw), turn_b)


def _turn_rate_b(roll: Floats, pitch: Floats, roll_rate: Floats, pitch_rate: Floats, yaw_rate: Floats) -> Floats:
    """Angular rate of the body against NED, body axes (n, 3) [rad/s], from Euler angles and their rates (n,)."""
    x = roll_rate - yaw_rate * np.sin(pitch)
    y = pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll)
    z = -pitch_rate * np.sin(roll) + yaw_rate * np.cos(pitch) * np.cos(roll)
    return np.stack([x, y, z], axis=-1)


def smooth_step(u: Floats) -> tuple[Floats, Floats]:
    """The smooth step from 0 to 1 on [0, 1], constant beyond, and its derivative, at u (n,)."""
    u = np.clip(u, 0.0, 1.0)
    c7, c6, c5, c4 = _SMOOTH_STEP
    return u**4 * (c4 + u * (c5 + u * (c6 + u * c7))), u**3 * (4 * c4 + u * (5 * c5 + u * (6 * c6 + u * 7 * c7)))


def _profiles(motion: Motion, duration: float) -> tuple[PPoly, PPoly]:
    """Speed, climb angle and course rate as one vector-valued polynomial, and the course."""
    knots, coefficients = [0.0], []
    value = np.array([motion.speed, 0.0, 0.0])
    for segment in motion.segments():
        speed = value[0] if segment.speed is None else segment.speed
        target = np.array([speed, segment.climb, segment.course_rate])
        step = [c / segment.duration**power * (target - value) for c, power in zip(_SMOOTH_STEP, (7, 6, 5, 4), strict=True)]
        coefficients.append(np.stack([*step, *np.zeros((3, 3)), value]))
        knots.append(knots[-1] + segment.duration)
        value = target
        if knots[-1] > duration:
            break
    profile = PPoly(np.stack(coefficients, axis=1), np.array(knots))
    course = PPoly(profile.c[..., 2], profile.x).antiderivative()
    course.c[-1] += motion.course
    return profile, course


def _velocity(profile: PPoly, course: PPoly, t_s: Floats) -> Floats:
    speed, pitch, _ = np.moveaxis(profile(t_s), -1, 0)
    yaw = course(t_s)
    return np.stack([speed * np.cos(pitch) * np.cos(yaw), speed * np.cos(pitch) * np.sin(yaw), -speed * np.sin(pitch)], axis=-1)


def _position_rate(lla: Floats, vel_n: Floats) -> Floats:
    meridian, normal = radii(lla[..., 0])
    north = vel_n[..., 0] / (meridian + lla[..., 2])
    east = vel_n[..., 1] / ((normal + lla[..., 2]) * np.cos(lla[..., 0]))
    return np.stack([north, east, -vel_n[..., 2]], axis=-1)


def _integrate_position(start: Floats, profile: PPoly, course: PPoly, grid: Floats) -> CubicHermiteSpline:
    """Picard iteration: the rates depend on the position only through the slowly changing radii, and each pass divides the
    error by the Earth's radius over the distance travelled; six passes reach rounding for any drive or flight."""
    nodes = grid[:-1, None] + _PANEL_S * _NODES
    vel_nodes, vel_grid = _velocity(profile, course, nodes), _velocity(profile, course, grid)
    lla_nodes = np.broadcast_to(start, vel_nodes.shape)
    for _ in range(6):
        steps = _PANEL_S * np.einsum("k,nki->ni", _WEIGHTS, _position_rate(lla_nodes, vel_nodes))
        lla_grid = start + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        lla = CubicHermiteSpline(grid, lla_grid, _position_rate(lla_grid, vel_grid))
        lla_nodes = lla(nodes)
    return lla
