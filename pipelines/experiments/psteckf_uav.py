"""The simulation of Lou et al. (2019), section 5: biased fixes and perturbed predictions, in two settings that the paper leaves
open."""

from dataclasses import replace
from math import radians

from navreplay.options import AlignmentOptions, ConsiderOptions, FilterOptions, GateOptions
from pipelines.monte_carlo.experiment import Arm, Experiment, OrderClaim, Published, Stretch
from pipelines.monte_carlo.perturbed import Perturbation
from pipelines.monte_carlo.told_noise import StartErrors
from synthetic_logs.scenarios import SCENARIOS

__all__ = ["PSTECKF_UAV"]

_SCENARIO = SCENARIOS["uav-biased-fixes"]
_PERTURBED = ((400.0, 700.0), (1000.0, 1500.0))
_CALM = ((100.0, 400.0), (800.0, 1000.0), (1600.0, 1932.0))
_MEASURED = ConsiderOptions(position_bias=(0.111, 0.00085, 5.0), velocity_bias=(0.1, 0.1, 0.9))
_A = FilterOptions(
    imu_noise=_SCENARIO.imu.noise,
    alignment=AlignmentOptions(
        "given",
        given=(radians(0.0001), radians(-0.0001), radians(0.0058)),
        given_std=(radians(0.0001), radians(0.0001), radians(0.0058)),
    ),
    gate=GateOptions(probability=1.0),
    output_rate=2.0,
    consider=replace(_MEASURED, position_rate=(50.0, 50.0, 50.0), velocity_rate=(0.8, 0.8, 0.8)),
)
_B = replace(_A, imu_noise=replace(_SCENARIO.imu.noise, accel_noise=0.1), consider=_MEASURED)


def _orders(stretch: str, setting: str) -> tuple[OrderClaim, ...]:
    """The paper's statements, of the arms of a setting ('A: ' or nothing)."""
    ekf, eckf, psteckf = (f"{setting}{name}" for name in ("EKF", "ECKF", "PSTECKF"))
    smallest = (
        OrderClaim("figures 2 to 4: PSTECKF's position errors are the smallest", stretch, "position", psteckf, other)
        for other in (ekf, eckf)
    )
    if stretch == "perturbed":
        between = OrderClaim("section 5: ECKF is worse than EKF in manoeuvres", stretch, "position", ekf, eckf)
        velocity = (
            OrderClaim(
                "figures 5, 6: PSTECKF's velocity errors are the smallest", stretch, "velocity horizontal", psteckf, other
            )
            for other in (ekf, eckf)
        )
        return (*smallest, between, *velocity)
    return (*smallest, OrderClaim("figure 4: EKF is off in height, ECKF is not", stretch, "position down", eckf, ekf))


PSTECKF_UAV = Experiment(
    name="psteckf-uav",
    description="Consider parameters and partially strong tracking: biased fixes, perturbed predictions (loosely coupled)",
    paper="Lou et al., Robust partially strong tracking extended consider Kalman filtering, IEEE Access 7 (2019), section 5",
    scenario=_SCENARIO,
    options=_B,
    arms=(
        Arm("EKF", "ekf"),
        Arm("ECKF", "eckf"),
        Arm("PSTECKF", "psteckf"),
        Arm("strong-tracking", "strong-tracking"),
        Arm("moment oracle", "fixed", told="moments"),
        Arm("A: EKF", "ekf", options=_A),
        Arm("A: ECKF", "eckf", options=_A),
        Arm("A: PSTECKF", "psteckf", options=_A),
        Arm("A: strong-tracking", "strong-tracking", options=_A),
        Arm("clairvoyant", "fixed", told="model", options=_A),
    ),
    stretches=(Stretch("calm", _CALM), Stretch("perturbed", _PERTURBED)),
    drawn=("EKF", "ECKF", "PSTECKF", "strong-tracking", "A: ECKF", "A: PSTECKF"),
    published=(Published("figure 7, a bias of about 2 m/s", "perturbed", "velocity down", {"EKF": 2.0}),),
    orders=tuple(claim for setting in ("", "A: ") for stretch in ("calm", "perturbed") for claim in _orders(stretch, setting)),
    start=StartErrors(position=(0.1, 0.1, 0.1), velocity=(0.1, 0.1, -0.1)),
    perturbations=(
        Perturbation(400.0, 700.0, (50.0, 50.0, -50.0), (0.5, 0.5, -0.5)),
        Perturbation(1000.0, 1500.0, (-10.0, -10.0, 10.0), (-0.8, -0.8, 0.8)),
    ),
    notes=(
        "The paper gives neither Q nor P_pp of p1. Setting A puts p1 into P_pp (50 m/s on the position, 0.8 m/s^2 on the "
        "velocity) and takes Q from the sensors; the other takes p2 alone and white accelerations of 0.1 m/s in a second.",
        "Perturbations (61) are added to every prediction of a measurement epoch, once per second; those of the clairvoyant "
        "have none. EKF is the fixed filter told the nominal noise.",
        "The biases of fixes are drawn once per seed, the paper's figures taken for standard deviations. The moment oracle and "
        "the clairvoyant are told their values.",
        "White noise of the sensors is per sample at 100 Hz, sensor biases are drawn with the paper's figures as standard "
        "deviations. The initial position is off by 0.1 m in place of nothing, since no uncertainty cannot be told.",
        "Figures only are published: orders can be compared, and the size of EKF's error in the up velocity.",
        "No innovation gate, as in the paper.",
    ),
)
