"""Promises of an experiment: an arm's error is at most so many times that of another."""

from collections.abc import Callable, Sequence
from typing import Any

from navreplay.timeline import Floats
from pipelines.experiment import RatioClaim

__all__ = ["judge_promises", "tell_promises"]

Figures = dict[str, dict[str, dict[str, Floats]]]
"""By arm, stretch and quantity: a root mean square error per seed."""


def judge_promises(
    claims: Sequence[RatioClaim], figures: Figures, interval: Callable[[Floats], dict[str, float]]
) -> list[dict[str, Any]]:
    """Plain data: of each claim the ratio over seeds with its interval, and whether it is kept, broken or undecided."""
    judged = []
    for claim in claims:
        arm, reference = (figures[label][claim.stretch][claim.quantity] for label in (claim.arm, claim.reference))
        ratio = interval(arm / reference)
        verdict = "undecided"
        if abs(ratio["mean"] - claim.most) >= ratio["half_width"]:
            verdict = "kept" if ratio["mean"] <= claim.most else "broken"
        judged.append(
            {
                "stretch": claim.stretch,
                "quantity": claim.quantity,
                "arm": claim.arm,
                "reference": claim.reference,
                "most": claim.most,
                "ratio": ratio,
                "verdict": verdict,
            }
        )
    return judged


def tell_promises(judged: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """A sentence for each."""
    return tuple(
        f"That the {one['quantity']} error of {one['arm']} is at most {one['most']:g} times that of {one['reference']} in "
        f"'{one['stretch']}' is {one['verdict']}: {one['ratio']['mean']:.3f} ± {one['ratio']['half_width']:.3f} times."
        for one in judged
    )
