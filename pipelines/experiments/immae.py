"""Si, Wang and Niu, section 4: a ballistic flight past the stars, with process noise told wrong and with one that changes."""

from math import pi

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions
from pipelines.monte_carlo.experiment import LAUNCH_ARCSEC, Arm, Experiment, OrderClaim, Published, Stretch
from synthetic_logs.scenarios import SCENARIOS

__all__ = ["IMMAE_1", "IMMAE_2"]

_PAPER = "Si, Wang and Niu, High precision attitude estimation algorithm for SINS/CNS with unknown noise, section 4"
_ARCSEC = pi / 180 / 3600
_OPTIONS = FilterOptions(
    imu_noise=SCENARIOS["ballistic"].imu.noise,
    alignment=AlignmentOptions("reference", given_std=(10 * _ARCSEC, 6 * _ARCSEC, 10 * _ARCSEC)),
    gate=GateOptions(probability=1.0),
    output_rate=2.0,
)
_BANKS = (
    Arm("MMAE", "mmae"),
    Arm("IMMAE", "immae"),
    Arm("mmae-floor", "mmae-floor"),
    Arm("IMM", "imm"),
)
_WHOLE = Stretch("whole flight", ((0.0, 600.0),))
_AXES = ("yaw", "pitch", "roll")
_NOTES = (
    "Errors are the components of the rotation vector in the launch frame: roll about x (downrange), yaw about y (up), pitch "
    "about z (to the right). The pitch is 90 deg at launch, where Euler angles with yaw first have no meaning.",
    "Q0 is read as white noise of 1 deg/h per sample of the 100 Hz gyro, in the data and in the filter: (0.0224 arcsec)^2 per "
    "axis and filter period of 0.05 s, the one of four readings that fits the published figures.",
    "The error model is the one of NED with attitudes as the only measurement, not that of the launch frame; position and "
    "velocity are not observable, and their figures mean nothing. NEES is that of the attitude against the stars.",
    "The bank scales all of Q by 1, 10, 100, 1000 and 10000. The filter starts at the true attitude with the paper's standard "
    "deviations of 10, 6 and 10 arcsec; the first attitudes, of 1 arcsec, take it from there.",
    "Published figures are of 600 runs, without intervals.",
)


def _published(table: str, **figures: tuple[float, float, float]) -> tuple[Published, ...]:
    rows = zip(_AXES, *figures.values(), strict=True)
    return tuple(Published(table, _WHOLE.name, f"attitude {axis}", dict(zip(figures, row, strict=True))) for axis, *row in rows)


IMMAE_1 = Experiment(
    name="immae-1",
    description="Multiple models with a star sensor: the single filter is told four times the process noise",
    paper=_PAPER,
    scenario=SCENARIOS["ballistic"],
    options=_OPTIONS,
    arms=(Arm("KF", "mmae", {"q_scales": [4.0]}), *_BANKS, Arm("moment oracle", "fixed", told="moments")),
    stretches=(_WHOLE,),
    drawn=("KF", "MMAE", "IMMAE", "mmae-floor", "moment oracle"),
    published=_published("table 2", KF=(0.18296, 0.17572, 0.17851), IMMAE=(0.16666, 0.15636, 0.16422)),
    attitude=LAUNCH_ARCSEC,
    notes=(*_NOTES, "KF is a bank of one hypothesis, which is the plain filter told 4 Q0."),
)

IMMAE_2 = Experiment(
    name="immae-2",
    description="Multiple models with a star sensor: from 200 to 400 s the process noise is ten times what is told",
    paper=_PAPER,
    scenario=SCENARIOS["ballistic-step"],
    options=_OPTIONS,
    arms=(Arm("KF", "fixed"), *_BANKS, Arm("moment oracle", "fixed", told="moments")),
    stretches=(
        _WHOLE,
        Stretch("Q0", ((0.0, 200.0), (400.0, 600.0))),
        Stretch("10 Q0", ((200.0, 400.0),)),
    ),
    drawn=("KF", "MMAE", "IMMAE", "mmae-floor", "moment oracle"),
    published=_published(
        "table 3",
        KF=(0.21911, 0.26309, 0.25783),
        MMAE=(0.21413, 0.22653, 0.22957),
        IMMAE=(0.19681, 0.20683, 0.21063),
    ),
    orders=(
        OrderClaim("section 4: better where the noise has grown", "10 Q0", "attitude", "IMMAE", "KF"),
        OrderClaim("section 4: better where the noise has grown", "10 Q0", "attitude", "IMMAE", "MMAE"),
    ),
    changes=((200.0, "Q × 10"), (400.0, "Q × 1")),
    attitude=LAUNCH_ARCSEC,
    notes=_NOTES,
)
