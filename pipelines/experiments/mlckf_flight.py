"""The flight of Gao et al. (2021), section 4: sensors, initial errors, and what both of its experiments share."""

from dataclasses import replace
from math import pi

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, ImuNoise
from pipelines.monte_carlo.told_noise import StartErrors
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.sensors.imu_errors import ImuErrors
from synthetic_logs.simulation import Scenario

__all__ = ["ARCMIN_DEG", "NOTES", "OPTIONS", "PAPER", "START", "fly"]

ARCMIN_DEG = 1 / 60
_ARCMIN = pi / 180 / 60
_DPH = pi / 180 / 3600
_G = 9.80665
_TILTS = (_ARCMIN, _ARCMIN, 1.5 * _ARCMIN)
_IMU = ImuNoise(
    gyro_noise=0.05 * pi / 180 / 60,
    accel_noise=1e-4 * _G,
    gyro_bias_std=0.1 * _DPH,
    accel_bias_std=1e-3 * _G,
    gyro_bias_walk=0.0,
    accel_bias_walk=0.0,
)

PAPER = "Gao et al., Maximum Likelihood-Based Measurement Noise Covariance Estimation ... (2021), section 4"
OPTIONS = FilterOptions(
    imu_noise=_IMU,
    alignment=AlignmentOptions("given", given=_TILTS, given_std=_TILTS),
    gate=GateOptions(probability=1.0),
    output_rate=2.0,
)
START = StartErrors(position=(8.0, 8.0, 15.0), velocity=(0.5, 0.5, 0.5))
NOTES = (
    "Start, speed, sensors (25 Hz and 1 Hz), R and initial errors are the paper's; the trajectory is of its kind, not its own: "
    "level flight at 150 m/s, climbs and descents of 5 deg, turns of 90 deg at 20 deg of bank, and legs accelerated to 170 m/s "
    "and back.",
    "Drift and bias of the sensors are constants drawn by seed with the paper's figures as standard deviations, which the "
    "filters know. Initial errors are one standard deviation in every component, their signs are ours.",
    "Judged halfway between fixes. Published figures are those of a receiver by itself (10.7 m, 0.087 m/s) and more, not of a "
    "filter that has converged: orders and ratios can be compared, metres cannot.",
    "No innovation gate. The reference lines are extended Kalman filters.",
    "HRCKF: gamma is not published. 30 initial standard deviations keep the filter consistent while R is right; the default of "
    "10 widens heading, which straight flight hardly shows, until it means little. Its gain is that of the widened prior, in "
    "the source that of the unchanged one.",
)


def fly(name: str) -> Scenario:
    """A scenario of the airborne journey with the paper's IMU."""
    return replace(SCENARIOS[name], imu=ImuErrors(_IMU))
