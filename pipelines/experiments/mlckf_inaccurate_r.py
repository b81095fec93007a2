"""Gao et al. (2021), section 4.1: from 500 to 700 s filters are told 16 R, while the noise stays what it was."""

from pipelines.experiments.mlckf_flight import ARCMIN_DEG, NOTES, OPTIONS, PAPER, START, fly
from pipelines.monte_carlo.experiment import Arm, Experiment, NoiseClaim, Published, PublishedNoise, Stretch

__all__ = ["MLCKF_INACCURATE_R"]

_COMPONENTS = ("velocity east", "velocity north", "velocity down", "position east", "position north", "position down")
_TOLD = (500.0, 700.0)
# the true ratio, 1/16, would lie at the default floor of 0.05
_FLOOR = {"floor": 1e-3}
_WHOLE, _FOUND = "told 16 R", "520 to 700 s"
_SQP = 0.0031, 0.0032, 0.0036, 24.7801, 25.0178, 64.8577
_GENETIC = 0.0054, 0.0056, 0.0053, 27.2759, 27.9192, 68.8187


def _table(stretch: str, arm: str, *figures: float) -> PublishedNoise:
    return PublishedNoise("table 1", stretch, arm, dict(zip(_COMPONENTS, figures, strict=True)))


def _published(source: str, quantity: str, ckf: float, hrckf: float, mlckf: float) -> Published:
    return Published(source, _WHOLE, quantity, {"CKF": ckf, "HRCKF": hrckf, "MLCKF": mlckf})


MLCKF_INACCURATE_R = Experiment(
    name="mlckf-inaccurate-r",
    description="R by maximum likelihood in a cubature filter that is told 16 R for a while",
    paper=PAPER,
    scenario=fly("told-noise"),
    options=OPTIONS,
    arms=(
        Arm("CKF", "ckf"),
        Arm("HRCKF", "hrckf", {"gamma": 30.0}),
        Arm("HRCKF, gamma 10", "hrckf"),
        Arm("MCSCKF", "mcsckf"),
        Arm("MLCKF", "mlckf", _FLOOR, restarts=_TOLD),
        Arm("MLCKF, all epochs", "mlckf", _FLOOR | {"window": 1000}, restarts=_TOLD),
        Arm("MLCKF, not told", "mlckf", _FLOOR),
        Arm("MLCKF, all epochs, not told", "mlckf", _FLOOR | {"window": 1000}),
        Arm("MLCKF-GA", "mlckf-ga", _FLOOR, restarts=_TOLD),
        Arm("EKF", "fixed"),
        Arm("correntropy", "correntropy"),
        Arm("moment oracle", "fixed", told="moments"),
        Arm("clairvoyant", "fixed", told="model"),
    ),
    stretches=(
        Stretch("told R", ((200.0, 500.0),)),
        Stretch(_WHOLE, (_TOLD,)),
        Stretch(_FOUND, ((520.0, _TOLD[1]),)),
    ),
    drawn=("CKF", "HRCKF", "MCSCKF", "MLCKF", "MLCKF-GA", "moment oracle"),
    published=(
        _published("section 4.1.2", "attitude", 0.82 * ARCMIN_DEG, 0.71 * ARCMIN_DEG, 0.55 * ARCMIN_DEG),
        _published("section 4.1.2", "velocity", 0.53, 0.41, 0.29),
        _published("section 4.1.2", "position", 19.17, 16.31, 13.29),
    ),
    published_noise=(
        *(_table(stretch, "MLCKF", *_SQP) for stretch in (_WHOLE, _FOUND)),
        *(_table(stretch, "MLCKF-GA", *_GENETIC) for stretch in (_WHOLE, _FOUND)),
    ),
    noise_claims=(
        NoiseClaim("SQP finds R of the positions", _FOUND, "position", "MLCKF", 0.8, 1.25),
        NoiseClaim("SQP finds R of the velocities", _FOUND, "velocity", "MLCKF", 0.8, 1.25),
        NoiseClaim("the genetic algorithm overestimates R", _FOUND, "velocity", "MLCKF-GA", 1.25, 10.0),
    ),
    start=START,
    notes=(
        *NOTES,
        "Maximum likelihood is restarted with an empty history at 500 s, from 16 R, and again at 700 s, from R; else it would "
        "never see the wrong value: the two arms that are not told do not restart. It holds what it is told for its first 14 "
        "epochs; published means of R stand beside ours of their own interval, 500 to 700 s, where 16 R for that time alone "
        "makes a mean of 2 R, and of 520 s on. Its window is 50 epochs; 'all epochs' is the paper's sum from the first one on.",
    ),
)
