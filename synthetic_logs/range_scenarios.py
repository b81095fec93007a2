"""Scenarios with raw ranges instead of fixes."""

from dataclasses import replace
from math import pi

from navreplay.options import ImuNoise
from synthetic_logs.motion.manoeuvres import Motion, accelerate, climb, stop, straight, turn
from synthetic_logs.ranges.receiver import Receiver
from synthetic_logs.ranges.receiver_clock import ReceiverClock
from synthetic_logs.ranges.surroundings import Surroundings
from synthetic_logs.sensors.imu_errors import ImuErrors
from synthetic_logs.simulation import Journey, Scenario

__all__ = ["RANGE_SCENARIOS"]

_DEG = pi / 180
_DPH = _DEG / 3600
_UG = 9.80665e-6

_BLOCK = accelerate(6.0, 5.0) + turn(90 * _DEG, 20 * _DEG) + accelerate(13.0, 7.0)
_LOOP = (
    accelerate(13.0, 8.0)
    + straight(60.0)
    + _BLOCK
    + straight(25.0)
    + stop(12.0, 6.0)
    + accelerate(14.0, 9.0)
    + climb(2 * _DEG, 20.0)
    + straight(20.0)
    + _BLOCK
    + straight(15.0)
    + climb(-2 * _DEG, 20.0)
    + turn(40 * _DEG, 5 * _DEG)
    + straight(30.0)
    + turn(-40 * _DEG, 5 * _DEG)
    + stop(8.0, 7.0)
    + accelerate(12.0, 7.0)
    + _BLOCK
    + straight(35.0)
)
_DRIVE = Motion((39.1 * _DEG, 117.2 * _DEG, 12.0), straight(30.0), _LOOP, course=20 * _DEG)
_LEVER = (-0.4, 0.2, -1.3)

_GE2020 = ImuNoise(
    gyro_noise=0.012 * _DEG / 60,
    accel_noise=100 * _UG,
    gyro_bias_std=0.5 * _DPH,
    accel_bias_std=1250 * _UG,
    gyro_bias_walk=0.0,
    accel_bias_walk=1250 * _UG * (2 / 3600) ** 0.5,
    accel_bias_tau=3600.0,
    gyro_markov_std=0.1 * _DPH,
    gyro_markov_tau=300.0,
)
"""IMU of Ge et al. (2020), section 4: turn-on biases and random walks as published, in-run figures of its grade."""

_FOLIAGE = Surroundings(
    40.0,
    120.0,
    attenuation=6.0,
    multipath_std=4.0,
    rate_multipath_std=0.15,
)
_BUILDINGS = Surroundings(
    260.0,
    320.0,
    roof_elevation=68 * _DEG,
    attenuation=2.0,
    multipath_std=4.0,
    rate_multipath_std=0.2,
    reflected_share=0.3,
    reflected_attenuation=8.0,
    reflected_bias=8.0,
    reflected_rate_std=0.4,
    outlier_probability=0.05,
    outlier_std=25.0,
    outlier_rate_std=3.0,
)
_ROUND_S = 600.0


def _repeat(rounds: int, *places: Surroundings) -> tuple[Surroundings, ...]:
    shifts = [_ROUND_S * i for i in range(rounds)]
    return tuple(replace(place, start=place.start + shift, end=place.end + shift) for shift in shifts for place in places)


_OPEN = Receiver()
_CITY = Receiver(
    systems="GC",
    multipath_std=0.5,
    rate_multipath_std=0.02,
    surroundings=_repeat(3, _FOLIAGE, _BUILDINGS),
    ionosphere_mismatch=0.2,
    troposphere_mismatch=0.05,
    system_offset_std=10.0,
)
_SHORT = Journey(_DRIVE, 180.0, lever_b=_LEVER)
_IMU = ImuErrors(_GE2020)

_ALL = (
    Scenario(
        "ranges-open",
        "Three minutes of driving under open sky: tactical IMU, ranges at 1 Hz with white noise as told.",
        _SHORT,
        _IMU,
        None,
        _OPEN,
    ),
    Scenario(
        "ranges-step",
        "Four minutes of driving; from 120 to 180 s the ranges are four times as noisy as told.",
        replace(_SHORT, duration=240.0),
        _IMU,
        None,
        replace(_OPEN, noise_windows=((120.0, 180.0, 4.0),)),
    ),
    Scenario(
        "ranges-correlated",
        "Four minutes of driving; from 120 to 180 s multipath of 5 m, correlated over 20 s, which is not told.",
        replace(_SHORT, duration=240.0),
        _IMU,
        None,
        replace(_OPEN, surroundings=(Surroundings(120.0, 180.0, multipath_std=5.0, rate_multipath_std=0.2),)),
    ),
    Scenario(
        "ranges-resets",
        "Three minutes under open sky with a clock that drifts fast and jumps by milliseconds.",
        _SHORT,
        _IMU,
        None,
        replace(_OPEN, clock=ReceiverClock(offset=140_000.0, drift=2_000.0, resets=True)),
    ),
    Scenario(
        "ermakf-city",
        "Half an hour of town: tactical IMU, ranges at 1 Hz; foliage 40-120 s and buildings 260-320 s in every ten minutes.",
        replace(_SHORT, duration=1800.0),
        _IMU,
        None,
        _CITY,
    ),
)

RANGE_SCENARIOS: dict[str, Scenario] = {scenario.name: scenario for scenario in _ALL}
"""All scenarios with ranges by name."""
