"""Scenarios by name. A scenario is a plain value: `dataclasses.replace` makes another of it, `with_duration` a shorter one."""

from dataclasses import replace
from math import pi, sqrt

from navreplay.options import ImuNoise
from navreplay.timeline import FixStatus
from synthetic_logs.motion.ballistic import BallisticFlight
from synthetic_logs.motion.manoeuvres import Leg, Motion, accelerate, climb, course_rate_of_bank, spiral, stop, straight, turn
from synthetic_logs.range_scenarios import RANGE_SCENARIOS
from synthetic_logs.sensors.gnss import GnssErrors
from synthetic_logs.sensors.imu_errors import ImuErrors
from synthetic_logs.sensors.star_sensor import StarSensor
from synthetic_logs.simulation import Journey, Scenario

__all__ = ["SCENARIOS"]

_DEG = pi / 180
_DPH = _DEG / 3600
_MG = 9.80665e-3


def _place(lat_deg: float, lon_deg: float, height: float) -> tuple[float, float, float]:
    return lat_deg * _DEG, lon_deg * _DEG, height


def _corner(angle_deg: float) -> Leg:
    """A street corner: slow down, turn, speed up."""
    return accelerate(6.0, 5.0) + turn(angle_deg * _DEG, 20 * _DEG) + accelerate(13.0, 7.0)


_STAND = straight(30.0)
_CITY_LOOP = (
    accelerate(13.0, 8.0)
    + straight(12.0)
    + _corner(90)
    + straight(8.0)
    + climb(3 * _DEG, 20.0)
    + _corner(-90)
    + stop(15.0, 6.0)
    + accelerate(14.0, 9.0)
    + straight(15.0)
    + _corner(90)
    + climb(-3 * _DEG, 20.0)
    + accelerate(18.0, 6.0)
    + turn(60 * _DEG, 6 * _DEG)
    + straight(10.0)
    + turn(-60 * _DEG, 6 * _DEG)
    + _corner(90)
    + stop(10.0, 8.0)
)
_CITY = Motion(_place(47.3769, 8.5417, 460.0), _STAND, _CITY_LOOP, course=35 * _DEG)
_HIGHWAY = Motion(
    _place(48.1374, 11.5755, 520.0),
    _STAND + accelerate(33.0, 20.0),
    straight(40.0)
    + turn(25 * _DEG, 2 * _DEG, 3.0)
    + climb(2 * _DEG, 25.0)
    + turn(-20 * _DEG, 2 * _DEG, 3.0)
    + climb(-2 * _DEG, 25.0),
    course=-70 * _DEG,
)
_STATIC = Motion(_place(52.0, 13.0, 80.0), straight(60.0), course=50 * _DEG)

_UAV_SPEED = 40.0
_UAV_TURN_RATE = course_rate_of_bank(25 * _DEG, _UAV_SPEED)
_UAV_LOOP = (
    straight(20.0)
    + turn(90 * _DEG, _UAV_TURN_RATE, 3.0)
    + climb(6 * _DEG, 30.0)
    + turn(-135 * _DEG, _UAV_TURN_RATE, 3.0)
    + accelerate(50.0, 10.0)
    + straight(25.0)
    + accelerate(_UAV_SPEED, 10.0)
    + spiral(360 * _DEG, _UAV_TURN_RATE, 5 * _DEG)
    + climb(-9 * _DEG, 54.0)
    + turn(135 * _DEG, _UAV_TURN_RATE, 3.0)
)
_UAV = Motion(
    _place(34.246, 108.997, 400.0),
    straight(30.0) + accelerate(_UAV_SPEED, 20.0) + climb(8 * _DEG, 40.0),
    _UAV_LOOP,
    course=20 * _DEG,
    coordinated=True,
)
_UAV_AIRBORNE = Motion(
    _place(34.246, 108.997, 1000.0),
    straight(30.0),
    straight(30.0)
    + climb(5 * _DEG, 40.0, 8.0)
    + turn(90 * _DEG, course_rate_of_bank(20 * _DEG, 150.0), 4.0)
    + climb(-5 * _DEG, 40.0, 8.0)
    + accelerate(170.0, 20.0)
    + straight(40.0)
    + accelerate(150.0, 20.0)
    + turn(-90 * _DEG, course_rate_of_bank(20 * _DEG, 150.0), 4.0),
    speed=150.0,
    coordinated=True,
)
_SPIRAL = Motion(
    _place(39.96, 116.31, 300.0),
    straight(100.0)
    + accelerate(120.0, 40.0)
    + straight(60.0)
    + spiral(360 * _DEG, course_rate_of_bank(20 * _DEG, 120.0), 4 * _DEG)
    + straight(60.0)
    + accelerate(80.0, 40.0),
    speed=80.0,
    course=90 * _DEG,
    coordinated=True,
)

_UAV_TOUR = Motion(
    _place(39.96, 116.31, 3.0),
    straight(30.0) + accelerate(_UAV_SPEED, 20.0) + climb(8 * _DEG, 40.0),
    _UAV_LOOP,
    coordinated=True,
)

_SINGLE = GnssErrors((1.5, 1.5, 2.5), (0.08, 0.08, 0.12))
_FIXED = GnssErrors((0.015, 0.015, 0.03), (0.03, 0.03, 0.05), status=FixStatus.FIXED)
_UAV_FIXES = GnssErrors((5.0, 5.0, 8.0), (0.05, 0.05, 0.05))
_CAR_LEVER = (-0.4, 0.3, -1.2)
_UAV_LEVER = (0.2, 0.0, -0.3)

# as data sheets have them: no vibration, no scale factors
_CONSUMER_NOISE = ImuNoise(0.01 * _DEG, 2e-3, 0.5 * _DEG, 30 * _MG, 5e-4 * _DEG, 1e-4)
_INDUSTRIAL_NOISE = ImuNoise(0.004 * _DEG, 8e-4, 0.15 * _DEG, 8 * _MG, 1e-4 * _DEG, 3e-5)
_TACTICAL_NOISE = ImuNoise(0.1 * _DEG / 60, 3e-4, 5 * _DPH, 1.5 * _MG, 0.1 * _DPH, 5e-6)
_TOUR_NOISE = ImuNoise(0.0001 * _DPH, 0.001 * _MG, 0.03 * _DPH, 0.1 * _MG, 0.0, 0.0)
_NAVIGATION_NOISE = ImuNoise(0.003 * _DEG / 60, 5e-5, 0.02 * _DPH, 0.05 * _MG, 2e-4 * _DPH, 2e-7)
_CONSUMER = ImuErrors(_CONSUMER_NOISE, gyro_quantum=0.0076 * _DEG, accel_quantum=0.0012)
_INDUSTRIAL = ImuErrors(_INDUSTRIAL_NOISE)
_TACTICAL = ImuErrors(_TACTICAL_NOISE)
_NAVIGATION = ImuErrors(_NAVIGATION_NOISE)

_CAR_JOURNEY = Journey(_CITY, 600.0, lever_b=_CAR_LEVER)
_UAV_JOURNEY = Journey(_UAV, 600.0, increments=True, lever_b=_UAV_LEVER)
_AIRBORNE_JOURNEY = Journey(_UAV_AIRBORNE, 1000.0, imu_rate=25.0, increments=True)
_OUTAGES = tuple((90.0 + 60.0 * i, 105.0 + 60.0 * i) for i in range(8))

# Si, Wang and Niu, table 1: white noise is told per sample of a 100 Hz IMU; drift and bias are drawn with these deviations
_BALLISTIC_G0 = 9.7803267714
_BALLISTIC_NOISE = ImuNoise(0.1 * _DPH, 5e-5 * _BALLISTIC_G0, 0.5 * _DPH, 1e-4 * _BALLISTIC_G0, 0.0, 0.0)
_BALLISTIC = Scenario(
    "ballistic",
    "Ballistic flight of 600 s: IMU of 1 deg/h and 0.5 mg white noise per sample at 100 Hz, star sensor of 1 arcsec at 20 Hz.",
    Journey(BallisticFlight(_place(39.98, 116.34, 0.0), 90 * _DEG), 600.0, increments=True),
    ImuErrors(_BALLISTIC_NOISE),
    None,
    stars=StarSensor(),
)

_ALL = (
    Scenario(
        "static",
        "Standing still, level: tactical IMU, single-point fixes at 1 Hz.",
        Journey(_STATIC, 300.0),
        _TACTICAL,
        _SINGLE,
    ),
    Scenario(
        "car-short",
        "Two minutes of town driving: industrial IMU, single-point fixes at 1 Hz between the IMU samples.",
        replace(_CAR_JOURNEY, duration=120.0, gnss_offset=0.0037),
        _INDUSTRIAL,
        _SINGLE,
    ),
    Scenario(
        "car-city",
        "Town driving with stops, corners and slopes: industrial IMU, single-point fixes at 1 Hz.",
        _CAR_JOURNEY,
        _INDUSTRIAL,
        _SINGLE,
    ),
    Scenario(
        "car-highway",
        "Highway with long bends and slopes: consumer IMU at 200 Hz, quantised, single-point fixes at 5 Hz.",
        Journey(_HIGHWAY, 600.0, imu_rate=200.0, gnss_rate=5.0, lever_b=_CAR_LEVER),
        _CONSUMER,
        _SINGLE,
    ),
    Scenario(
        "car-outages",
        "Town driving with RTK fixes at 1 Hz and eight outages of 15 s.",
        _CAR_JOURNEY,
        _INDUSTRIAL,
        replace(_FIXED, outages=_OUTAGES),
    ),
    Scenario(
        "car-outliers",
        "Town driving; one fix in twenty is 40 m off, which its covariance does not tell.",
        _CAR_JOURNEY,
        _INDUSTRIAL,
        replace(_SINGLE, outlier_probability=0.05, outlier_size=40.0),
    ),
    Scenario(
        "car-correlated",
        "Town driving with position errors correlated over 20 s (multipath) beside the white ones.",
        _CAR_JOURNEY,
        _INDUSTRIAL,
        replace(_SINGLE, correlated_std=(3.0, 3.0, 5.0), correlation_time=20.0, told_position_std=(1.5, 1.5, 2.5)),
    ),
    Scenario(
        "uav-flight",
        "Take-off, climbs, banked turns and a spiral: tactical IMU in increments, fixes at 1 Hz.",
        _UAV_JOURNEY,
        _TACTICAL,
        replace(_SINGLE, status=FixStatus.DIFFERENTIAL),
    ),
    Scenario(
        "step-noise",
        "UAV flight; from 200 to 400 s the fixes are four times as noisy as told.",
        _UAV_JOURNEY,
        _TACTICAL,
        replace(_UAV_FIXES, noise_windows=((200.0, 400.0, 4.0),)),
    ),
    Scenario(
        "told-noise",
        "UAV cruise of 1000 s, IMU at 25 Hz; from 500 to 700 s the told covariance is 16 times too large.",
        _AIRBORNE_JOURNEY,
        _TACTICAL,
        replace(_UAV_FIXES, told_windows=((500.0, 700.0, 4.0),)),
    ),
    Scenario(
        "mixture",
        "UAV cruise of 1000 s, IMU at 25 Hz; one fix in five has eight times the told standard deviation.",
        _AIRBORNE_JOURNEY,
        _TACTICAL,
        replace(_UAV_FIXES, mixture_probability=0.2, mixture_scale=8.0),
    ),
    Scenario(
        "aircraft-spiral",
        "Straight legs, speed changes and a climbing spiral: navigation-grade IMU in increments, position fixes only.",
        Journey(_SPIRAL, 595.0, increments=True, lever_b=_UAV_LEVER),
        _NAVIGATION,
        GnssErrors((5.0, 5.0, 8.0), None),
    ),
    Scenario(
        "uav-biased-fixes",
        "UAV flight of 1932 s from rest, gyros of 0.03 deg/h; fixes at 1 Hz whose biases are drawn once and stay.",
        Journey(_UAV_TOUR, 1932.0, increments=True),
        ImuErrors(_TOUR_NOISE),
        GnssErrors(
            (8.0, 8.0, 4.0), (0.3, 0.3, 0.3), position_bias_std=(0.111, 0.00085, 5.0), velocity_bias_std=(0.1, 0.1, 0.9)
        ),
    ),
    _BALLISTIC,
    replace(
        _BALLISTIC,
        name="ballistic-step",
        description="The same; from 200 to 400 s the white noise of the IMU has ten times its variance.",
        imu=replace(_BALLISTIC.imu, noise_windows=((200.0, 400.0, sqrt(10)),)),
    ),
)

SCENARIOS: dict[str, Scenario] = {scenario.name: scenario for scenario in _ALL} | RANGE_SCENARIOS
"""All scenarios by name."""
