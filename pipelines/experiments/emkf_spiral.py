"""The simulation of Lai et al. (2022), section 4.1: a climbing spiral with position fixes."""

from dataclasses import replace
from math import radians

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, ImuNoise
from pipelines.monte_carlo.experiment import Arm, Experiment, OrderClaim, Stretch
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.sensors.imu_errors import ImuErrors

__all__ = ["EMKF_SPIRAL"]

_DPH = radians(1 / 3600)
_UG = 9.80665e-6
_IMU = ImuNoise(
    gyro_noise=radians(0.003 / 60),
    accel_noise=10 * _UG,
    gyro_bias_std=0.01 * _DPH,
    accel_bias_std=100 * _UG,
    gyro_bias_walk=0.0,
    accel_bias_walk=0.0,
)
_SPIRAL = SCENARIOS["aircraft-spiral"]
_SCENARIO = replace(
    _SPIRAL,
    name="emkf-spiral",
    description="Straight and accelerated legs and a climbing spiral; position fixes at 1 Hz, told twice their deviation.",
    imu=ImuErrors(_IMU),
    gnss=replace(_SPIRAL.gnss, told_position_std=(10.0, 10.0, 16.0)),
)
_OPTIONS = FilterOptions(
    imu_noise=_IMU,
    alignment=AlignmentOptions(
        "given",
        given=(radians(0.01), radians(-0.01), radians(90.05)),
        given_std=(radians(0.01), radians(0.01), radians(0.05)),
    ),
    gate=GateOptions(probability=1.0),
    output_rate=2.0,
)
_WHOLE = "from 60 s on"


def _better(one: str, other: str, text: str) -> tuple[OrderClaim, ...]:
    return tuple(OrderClaim(text, _WHOLE, quantity, one, other) for quantity in ("position", "velocity"))


EMKF_SPIRAL = Experiment(
    name="emkf-spiral",
    description="Expectation maximisation of P and R at each epoch, on a climbing spiral (loosely coupled, positions only)",
    paper="Lai et al., A Novel Robust Kalman Filter Algorithm With Unknown Noise Statistics (2022), section 4.1",
    scenario=_SCENARIO,
    options=_OPTIONS,
    arms=(
        Arm("KF", "fixed"),
        Arm("EM-KF", "em-kf"),
        Arm("EM-KF printed", "em-kf-printed"),
        Arm("EM-KF, 2 iterations", "em-kf", {"iterations": 2}),
        Arm("sage-husa", "sage-husa"),
        Arm("huber", "huber"),
        Arm("IAE", "iae"),
        Arm("IAE, R and Q", "iae-q"),
        Arm("EM offline", "em-offline"),
        Arm("unaided SINS", "fixed", options=replace(_OPTIONS, position_noise_scale=1e6)),
        Arm("moment oracle", "fixed", told="moments"),
        Arm("clairvoyant", "fixed", told="model"),
    ),
    stretches=(Stretch(_WHOLE, ((60.0, 595.0),)), Stretch("spiral", ((200.0, 415.0),))),
    drawn=("KF", "EM-KF", "EM-KF printed", "sage-husa", "EM offline", "moment oracle"),
    orders=(
        *_better("EM-KF", "unaided SINS", "section 4.1: EM-KF outperforms SINS"),
        *_better("EM-KF printed", "unaided SINS", "section 4.1: EM-KF outperforms SINS"),
        *(
            claim
            for other in ("KF", "sage-husa", "huber", "IAE", "EM offline")
            for claim in _better("EM-KF", other, "section 5: higher accuracy than existing algorithms")
        ),
    ),
    notes=(
        "The paper gives duration, rate, the biases (taken for standard deviations here) and the kinds of motion. Ours are the "
        "white noise of the IMU (0.003 deg/sqrt(h), 10 ug/sqrt(Hz)), fixes at 1 Hz of 5, 5, 8 m, an R at the start that is "
        "four times too large (noise being unknown), S = 1, and initial attitude errors of 0.01, -0.01 and 0.05 deg.",
        "Legs: uniform motion at 80 m/s, acceleration to 120 m/s, a climbing spiral of 360 deg at 20 deg of bank, then slower.",
        "The paper compares with the unaided SINS alone, by figures without numbers, and claims more in its conclusion.",
        "Unaided SINS is the filter with fixes told a million times their deviation. No innovation gate.",
    ),
)
