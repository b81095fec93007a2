"""R estimated against R true, one kind of noise after the other: what the estimators of Ge et al. (2020) can see."""

from dataclasses import replace

from pipelines.experiments.ungated_ranges import NOTES, ungated_options
from pipelines.monte_carlo.experiment import Arm, Experiment, NoiseClaim, Stretch
from synthetic_logs.ranges.surroundings import Surroundings
from synthetic_logs.scenarios import SCENARIOS

__all__ = ["REDUNDANT_NOISE"]

_STEP = (120.0, 240.0)
_CORRELATED = (360.0, 480.0)
_OPEN = SCENARIOS["ranges-open"]
_SCENARIO = replace(
    _OPEN,
    name="redundant-noise",
    description="Open sky for ten minutes; ranges four times as noisy from 120 to 240 s, multipath from 360 to 480 s.",
    journey=replace(_OPEN.journey, duration=600.0),
    receiver=replace(
        _OPEN.receiver,
        noise_windows=((*_STEP, 4.0),),
        surroundings=(Surroundings(*_CORRELATED, multipath_std=5.0, rate_multipath_std=0.25),),
    ),
)

REDUNDANT_NOISE = Experiment(
    name="redundant-noise",
    description="R estimated against R true in white, step and correlated noise (tightly coupled)",
    paper="Ge et al., Sensors 20 (2020) 6041, sections 3 and 4",
    scenario=_SCENARIO,
    options=ungated_options(_SCENARIO),
    arms=(
        Arm("fixed", "fixed"),
        Arm("iae", "iae"),
        Arm("eiakf", "eiakf"),
        Arm("srmakf", "srmakf"),
        Arm("ermakf", "ermakf"),
        Arm("ermakf-derived", "ermakf-derived"),
        Arm("ermakf-whitened", "ermakf-whitened"),
        Arm("moment oracle", "fixed", told="moments"),
        Arm("clairvoyant", "fixed", told="model"),
    ),
    stretches=(
        Stretch("white", ((60.0, 120.0), (300.0, 360.0), (540.0, 600.0))),
        Stretch("step", ((180.0, 240.0),)),
        Stretch("correlated", ((420.0, 480.0),)),
    ),
    drawn=("fixed", "eiakf", "srmakf", "ermakf", "ermakf-derived", "moment oracle"),
    noise_claims=(
        NoiseClaim("RMAE finds R in white noise", "white", "range", "srmakf", 0.8, 1.25),
        NoiseClaim("ERMAKF finds R in white noise", "white", "range", "ermakf", 0.8, 1.25),
        NoiseClaim("RMAE underestimates correlated noise", "correlated", "range", "srmakf", 0.0, 0.5),
        NoiseClaim("ERMAKF does not underestimate correlated noise", "correlated", "range", "ermakf", 0.5, 2.0),
        NoiseClaim("the derived variance is of the right size", "correlated", "range", "ermakf-derived", 0.5, 2.0),
    ),
    notes=(
        "Judged is the second minute of every kind of noise, when windows of 30 and 60 s hold nothing of the kind before.",
        "Multipath is Gauss-Markov with 20 s, of 5 m and 0.25 m/s beside white noise of 0.8 m and 0.05 m/s.",
        *NOTES,
    ),
)
