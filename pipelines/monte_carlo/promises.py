"""Promises of an experiment: how many times an arm's error is that of another, and whether its NEES is accepted."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from navreplay.timeline import Floats
from pipelines.monte_carlo.experiment import ConsistencyClaim, RatioClaim

__all__ = ["ACCEPTED", "judge_consistency", "judge_promises", "tell_consistency", "tell_promises"]

Figures = dict[str, dict[str, dict[str, Floats]]]
"""By arm, stretch and quantity: a root mean square error per seed."""

ACCEPTED = 0.9
"""Least share of epochs whose NEES, averaged over seeds, lies in its 95 % bounds."""


def judge_promises(
    claims: Sequence[RatioClaim], figures: Figures, interval: Callable[[Floats], dict[str, float]]
) -> list[dict[str, Any]]:
    """Plain data: of each claim the ratio over seeds with its interval, and whether it is kept, broken or undecided; None where
    nothing is promised."""
    judged = []
    for claim in claims:
        arm, reference = (figures[label][claim.stretch][claim.quantity] for label in (claim.arm, claim.reference))
        ratio = interval(arm / reference)
        judged.append(
            {
                "stretch": claim.stretch,
                "quantity": claim.quantity,
                "arm": claim.arm,
                "reference": claim.reference,
                "most": claim.most,
                "ratio": ratio,
                "verdict": None if claim.most is None else _verdict(ratio, claim.most),
            }
        )
    return judged


def _verdict(ratio: Mapping[str, float], most: float) -> str:
    if not abs(ratio["mean"] - most) >= ratio["half_width"]:  # of one seed the interval is unknown
        return "undecided"
    return "kept" if ratio["mean"] <= most else "broken"


def judge_consistency(claims: Sequence[ConsistencyClaim], arms: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Plain data: of each claim the shares of epochs inside their bounds, of the arm and of the reference, and whether it is
    kept or broken. arms: as `summarise_experiment` has them."""
    judged = []
    for claim in claims:
        arm, reference = (
            arms[label]["stretches"][claim.stretch]["nees"].get(claim.quantity) for label in (claim.arm, claim.reference)
        )
        if arm is not None and reference is not None:
            share = arm["share_inside"]
            judged.append(
                {
                    "stretch": claim.stretch,
                    "quantity": claim.quantity,
                    "arm": claim.arm,
                    "reference": claim.reference,
                    "share_inside": share,
                    "mean": arm["mean"],
                    "reference_share_inside": reference["share_inside"],
                    "verdict": "kept" if share >= ACCEPTED else "broken",
                }
            )
    return judged


def tell_promises(judged: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """A sentence for each."""
    return tuple(
        f"The {one['quantity']} error of {one['arm']} is {one['ratio']['mean']:.3f} ± {one['ratio']['half_width']:.3f} times "
        f"that of {one['reference']} in '{one['stretch']}'{_promised(one)}."
        for one in judged
    )


def _promised(one: Mapping[str, Any]) -> str:
    return "" if one["most"] is None else f"; that it is at most {one['most']:g} times is {one['verdict']}"


def tell_consistency(judged: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """A sentence for each."""
    return tuple(
        f"That the NEES of {one['quantity']} of {one['arm']} is accepted in '{one['stretch']}' is {one['verdict']}: "
        f"{100 * one['share_inside']:.0f} % of the epochs are inside their bounds ({one['reference']}: "
        f"{100 * one['reference_share_inside']:.0f} %), mean {one['mean']:.2f}."
        for one in judged
    )
