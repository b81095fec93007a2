"""Wheel speeds against the speed of fixes: scale, delay and quantum, found before any filter runs.

The delay is that of the least scatter about a line through the origin, robustly; the scale is its slope there, and its sign
tells a sensor that counts backwards. Speeds along the way and over ground are the same on a road. What a vehicle reverses has
another sign by its wheels and none over ground, so sizes are compared, and the sign is that of most of the way.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, SpeedSeries

__all__ = ["WheelFit", "apply_fit", "fit_speed", "fit_turn"]

_LONGEST_S = 1.5
_STEP_S = 0.02
_FEWEST = 50
_SLOWEST = 2.0
"""Speed over ground [m/s] below which a fix says nothing of the scale."""
_STEPS = 10
_HUBER = 1.345
_POOR = 0.1
"""Scatter against speed at which wheel speeds and fixes are not of the same drive."""
_LEAST_STD, _LEAST_SCALE_STD, _LEAST_DELAY_STD = 0.03, 0.003, 0.02


class WheelFit(NamedTuple):
    """scale: metres per second for a unit of the sensor. delay [s]: to be added to its stamps. quantum [m/s]: least step of its
    speeds, 0 of a fine one. std [m/s]: of one speed beside the fixes. fixes: how many told it."""

    scale: float
    delay: float
    quantum: float
    std: float
    fixes: int


def fit_speed(wheels: SpeedSeries, fixes: GnssFixSeries) -> WheelFit | None:
    """None where too few fixes know a speed in motion, or the two do not belong together."""
    known = fixes.has_velocity
    over_ground = np.hypot(fixes.vel_n[known, 0], fixes.vel_n[known, 1])
    seconds = (fixes.t_ns[known] - wheels.t_ns[0]) / 1e9
    own = (wheels.t_ns - wheels.t_ns[0]) / 1e9
    inside = (seconds > _LONGEST_S) & (seconds < own[-1] - _LONGEST_S) & (over_ground > _SLOWEST)
    if inside.sum() < _FEWEST:
        return None
    seconds, over_ground = seconds[inside], over_ground[inside]
    size = np.abs(wheels.speed)
    delays = np.arange(-_LONGEST_S, _LONGEST_S + _STEP_S / 2, _STEP_S)
    fits = [_slope(np.interp(seconds - delay, own, size), over_ground) for delay in delays]
    best = int(np.argmin([scatter for _, scatter in fits]))
    slope, scatter = fits[best]
    if not scatter < _POOR * float(np.median(over_ground)) or slope <= 0:
        return None
    told = np.interp(seconds - delays[best], own, wheels.speed)
    scale = slope if np.sum(told) >= 0 else -slope
    return WheelFit(float(scale), float(delays[best]), abs(scale) * _quantum(wheels.speed), scatter, len(seconds))


def apply_fit(wheels: SpeedSeries, fit: WheelFit) -> SpeedSeries:
    """In metres per second, at the times of what it measured."""
    return replace(
        wheels,
        t_ns=wheels.t_ns + round(fit.delay * 1e9),
        speed=wheels.speed * fit.scale,
        std=max(fit.quantum / np.sqrt(12), fit.std, _LEAST_STD),
        scale_std=max(_LEAST_SCALE_STD, fit.std / np.sqrt(fit.fixes) / _SLOWEST),
        delay_std=_LEAST_DELAY_STD,
    )


def fit_turn(wheels: SpeedSeries, imu: ImuSeries, c_down: Floats) -> tuple[float, float] | None:
    """What the turn by the wheels is multiplied by to be that of the gyro about the vehicle's down axis c_down (3,), and what
    it scatters by [rad/s]; None where there is none or they do not belong together."""
    known = np.isfinite(wheels.turn)
    if known.sum() < _FEWEST:
        return None
    gyro = imu.gyro @ c_down
    own = (imu.t_ns - imu.t_ns[0]) / 1e9
    felt = np.interp((wheels.t_ns[known] - imu.t_ns[0]) / 1e9, own, gyro)
    turn = wheels.turn[known]
    turning = np.abs(felt - np.median(felt)) > 3 * 1.4826 * np.median(np.abs(felt - np.median(felt)))
    if turning.sum() < _FEWEST:
        return None
    slope, scatter = _slope(turn[turning], (felt - np.median(felt))[turning])
    if not scatter < 0.5 * float(np.std(felt[turning])):
        return None
    return slope, scatter


def _slope(told: Floats, wanted: Floats) -> tuple[float, float]:
    """Slope of wanted over told (k,), with Huber's weights, and the robust deviation about it."""
    weights = np.ones(len(told))
    slope, scale = 0.0, float("inf")
    for _ in range(_STEPS):
        power = float(np.sum(weights * told**2))
        if power == 0:
            return 0.0, float("inf")
        slope = float(np.sum(weights * told * wanted)) / power
        left = np.abs(wanted - slope * told)
        scale = max(1.4826 * float(np.median(left)), 1e-9)
        weights = np.minimum(1.0, _HUBER * scale / np.maximum(left, 1e-12))
    return slope, scale


def _quantum(values: Floats) -> float:
    """The least step between different values (n,), 0 where there are too many of them for one."""
    steps = np.diff(np.unique(np.round(np.abs(values), 9)))
    return float(steps.min()) if 0 < len(steps) < len(values) / 4 else 0.0
