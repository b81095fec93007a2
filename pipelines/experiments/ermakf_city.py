"""The field test of Ge et al. (2020), section 4, as a synthetic drive of the same sensors and stretches."""

from pipelines.experiments.ungated_ranges import NOTES, ungated_options
from pipelines.monte_carlo.experiment import Arm, Experiment, NoiseClaim, OrderClaim, Published, Stretch
from synthetic_logs.scenarios import SCENARIOS

__all__ = ["ERMAKF_CITY"]

_SCENARIO = SCENARIOS["ermakf-city"]
_ROUNDS = (0.0, 600.0, 1200.0)


def _repeat(start: float, end: float) -> tuple[tuple[float, float], ...]:
    return tuple((start + shift, end + shift) for shift in _ROUNDS)


def _foliage(quantity: str, better: str, worse: str, text: str) -> OrderClaim:
    return OrderClaim(f"section 4.2: {text}", "foliage", quantity, better, worse)


_VELOCITIES = ("velocity east", "velocity north", "velocity down")

ERMAKF_CITY = Experiment(
    name="ermakf-city",
    description="Redundant-measurement estimation of R among foliage and buildings (tightly coupled)",
    paper="Ge et al., Enhanced Redundant Measurement-Based Kalman Filter, Sensors 20 (2020) 6041, section 4",
    scenario=_SCENARIO,
    options=ungated_options(_SCENARIO),
    arms=(
        Arm("EKF", "fixed"),
        Arm("EIAKF", "eiakf"),
        Arm("SRMAKF", "srmakf"),
        Arm("ERMAKF", "ermakf"),
        Arm("ermakf-derived", "ermakf-derived"),
        Arm("ermakf-whitened", "ermakf-whitened"),
        Arm("sage-husa", "sage-husa"),
        Arm("huber", "huber"),
        Arm("moment oracle", "fixed", told="moments"),
        Arm("clairvoyant", "fixed", told="model"),
    ),
    stretches=(
        Stretch("open", _repeat(160.0, 240.0)),
        Stretch("foliage", _repeat(40.0, 120.0)),
        Stretch("buildings", _repeat(260.0, 320.0)),
    ),
    drawn=("EKF", "EIAKF", "SRMAKF", "ERMAKF", "ermakf-derived", "moment oracle"),
    published=(
        Published("table 1", "buildings", "position", {"EKF": 5.52, "EIAKF": 6.24, "SRMAKF": 6.12, "ERMAKF": 4.60}),
        Published("table 1", "buildings", "velocity", {"EKF": 0.38, "EIAKF": 0.29, "SRMAKF": 0.38, "ERMAKF": 0.17}),
        Published("table 1", "buildings", "attitude", {"EKF": 0.22, "EIAKF": 0.25, "SRMAKF": 0.24, "ERMAKF": 0.18}),
    ),
    orders=(
        _foliage("position down", "ERMAKF", "EKF", "height 56 % better"),
        _foliage("position down", "ERMAKF", "EIAKF", "height 50 % better"),
        _foliage("position down", "EKF", "SRMAKF", "SRMAKF's height is worse"),
        _foliage("position east", "SRMAKF", "EKF", "longitude 26 % better"),
        _foliage("position east", "SRMAKF", "EIAKF", "longitude 47 % better"),
        _foliage("position east", "ERMAKF", "SRMAKF", "longitude 36 % better"),
        *(
            _foliage(quantity, better, worse, text)
            for worse, text in (("EKF", "63, 27, 44 % better"), ("EIAKF", "68, 52, 19 % better"))
            for quantity, better in ((quantity, "SRMAKF") for quantity in _VELOCITIES)
        ),
        *(_foliage(quantity, "ERMAKF", "SRMAKF", "velocity further improved") for quantity in _VELOCITIES),
        _foliage("attitude heading", "EKF", "ERMAKF", "ERMAKF's yaw is slightly worse"),
    ),
    noise_claims=(
        NoiseClaim("SRMAKF underestimates R under foliage", "foliage", "range", "SRMAKF", 0.0, 0.5),
        NoiseClaim("ERMAKF does not underestimate R under foliage", "foliage", "range", "ERMAKF", 0.5, 2.0),
        NoiseClaim("ERMAKF does not underestimate R among buildings", "buildings", "range", "ERMAKF", 0.5, 2.0),
        NoiseClaim("the derived variance is of the right size", "foliage", "range", "ermakf-derived", 0.5, 2.0),
        NoiseClaim("the derived variance is of the right size", "buildings", "range", "ermakf-derived", 0.5, 2.0),
    ),
    notes=(
        "The paper's field data are not public; sensors, rates and the times of foliage and buildings are the paper's, the "
        "errors of the ranges are the scenario's, and both places come back after ten and twenty minutes.",
        "Published figures are of one drive. Orders and ratios can be compared, metres cannot.",
        *NOTES,
    ),
)
