"""The method `auto` against the fixed filter, the moment oracle and the clairvoyant, one scenario after the other."""

from dataclasses import replace
from math import radians

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions
from pipelines.monte_carlo.experiment import Arm, ConsistencyClaim, Experiment, RatioClaim, Stretch
from pipelines.monte_carlo.perturbed import Perturbation
from synthetic_logs.scenarios import SCENARIOS

__all__ = ["AUTO_EXPERIMENTS"]

_FROM_COURSE = AlignmentOptions(course_std=radians(0.3))
_ARCMIN = radians(1 / 60)
_AIRBORNE = AlignmentOptions("given", given=(_ARCMIN, _ARCMIN, 1.5 * _ARCMIN), given_std=(_ARCMIN, _ARCMIN, 1.5 * _ARCMIN))
_QUANTITIES = ("position", "velocity", "attitude")
_LATER = "settled"


def _arms(options: FilterOptions) -> tuple[Arm, ...]:
    smoothed = replace(options, smooth=True)
    plain = (
        Arm("moment oracle", "fixed", told="moments"),
        Arm("fixed", "fixed"),
        Arm("auto", "auto"),
        Arm("vb", "vb"),
        Arm("student-t", "student-t"),
        Arm("clairvoyant", "fixed", told="model"),
    )
    chosen = ("moment oracle", "fixed", "auto", "clairvoyant")
    return plain + tuple(replace(arm, label=f"{arm.label}, smoothed", options=smoothed) for arm in plain if arm.label in chosen)


def _pairs(reference: str) -> tuple[tuple[str, str], ...]:
    """`auto` and a reference, forward against forward and smoothed against smoothed."""
    return tuple((f"auto{how}", f"{reference}{how}") for how in ("", ", smoothed"))


def _ratios(most: float | None, against: str) -> tuple[RatioClaim, ...]:
    return tuple(
        RatioClaim(_LATER, quantity, arm, reference, most) for arm, reference in _pairs(against) for quantity in _QUANTITIES
    )


_ACCEPTED = tuple(
    ConsistencyClaim(_LATER, quantity, arm, reference) for arm, reference in _pairs("moment oracle") for quantity in _QUANTITIES
)


def _experiment(scenario: str, alignment: AlignmentOptions, promises: tuple[RatioClaim, ...]) -> Experiment:
    chosen = SCENARIOS[scenario]
    options = FilterOptions(imu_noise=chosen.imu.noise, alignment=alignment, gate=GateOptions(probability=1.0), output_rate=2.0)
    return Experiment(
        name=f"auto-{scenario}",
        description=f"The default that needs no tuning: {chosen.description[0].lower()}{chosen.description[1:]}",
        paper="none; the promises of docs/methods/auto.md",
        scenario=chosen,
        options=options,
        arms=_arms(options),
        stretches=(Stretch(_LATER, ((60.0, chosen.journey.duration),)),),
        drawn=("moment oracle", "fixed", "auto", "clairvoyant"),
        ratios=(*promises, *_ratios(None, "clairvoyant")),
        accepted=_ACCEPTED,
        notes=(
            "Promised: within 5 % of the moment oracle, forward against forward and smoothed against smoothed; where the told "
            "noise is right at most 2 % worse than fixed; better than the moment oracle under the mixture; NEES accepted. The "
            "distance to the clairvoyant is told without a promise.",
            "The clairvoyant of correlated noise is told white noise of the same density at low frequencies; auto may estimate "
            "the correlated error and so do better than it.",
            "No innovation gate in any arm; `vb` and `student-t` are there for comparison.",
        ),
    )


_NOMINAL = (*_ratios(1.02, "fixed"), *_ratios(1.05, "moment oracle"))
_PUSHED = replace(
    _experiment("uav-flight", _FROM_COURSE, _ratios(None, "moment oracle")),
    name="auto-perturbed",
    description="The default that needs no tuning: from 200 to 400 s the flight accelerates as no inertial sensor tells.",
    stretches=(Stretch(_LATER, ((60.0, 600.0),)), Stretch("perturbed", ((200.0, 400.0),))),
    perturbations=(Perturbation(200.0, 400.0, (0.01, 0.01, -0.01), (0.02, 0.02, -0.02)),),
    accepted=(),
    notes=(
        "Every prediction of a measurement epoch, once per second, is off by 0.01 m and 0.02 m/s per axis from 200 to 400 s: "
        "an acceleration of 0.02 m/s^2 per axis that is neither sensed nor told. The clairvoyant is without it.",
        "Nothing is promised here: `auto` looks for noise, and this is none.",
        "No innovation gate in any arm; `vb` and `student-t` are there for comparison.",
    ),
)

AUTO_EXPERIMENTS = (
    _experiment("car-city", _FROM_COURSE, _NOMINAL),
    _experiment("uav-flight", _FROM_COURSE, _NOMINAL),
    _experiment("step-noise", _FROM_COURSE, _ratios(1.05, "moment oracle")),
    _experiment("told-noise", _AIRBORNE, _ratios(1.05, "moment oracle")),
    _experiment("mixture", _AIRBORNE, _ratios(1.0, "moment oracle")),
    _experiment("car-correlated", _FROM_COURSE, _ratios(1.05, "moment oracle")),
    _PUSHED,
)
