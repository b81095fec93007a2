"""What an experiment has shown: figures over its seeds, and which of the paper's statements they support."""

from collections.abc import Iterable, Sequence
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.special import chdtri, stdtrit

from navreplay.timeline import Floats
from pipelines.monte_carlo.experiment import (
    CONSISTENT,
    DEGREES,
    QUANTITIES,
    ArmOutcome,
    AttitudeScale,
    Experiment,
    OrderClaim,
    Outcome,
    Stretch,
)
from pipelines.monte_carlo.promises import judge_consistency, judge_promises, tell_consistency, tell_promises
from pipelines.report.content import Report
from pipelines.report.plain_data import plain_data

__all__ = ["SETTLED", "WHOLE", "published_orders", "rmse_figures", "stretch_rows", "summarise_experiment"]

WHOLE = Stretch("whole drive", ((0.0, float("inf")),))
_NED = ("north", "east", "down")
_SCHEMA = "navreplay experiment 1"
SETTLED = 1.5
"""Factor within which R counts as found."""


def stretch_rows(stretch: Stretch, t_s: Floats) -> np.ndarray:
    """(k,) bool: which of t_s (k,) [s] lie in the stretch."""
    rows = np.zeros(len(t_s), dtype=np.bool_)
    for start, end in stretch.windows:
        rows |= (t_s >= start) & (t_s < end)
    return rows


def rmse_figures(errors: Floats, attitude: AttitudeScale = DEGREES) -> dict[str, float]:
    """Root mean squares of errors (k, 9) by name: ``position`` of the 3-D error, ``position horizontal``, ``position north``
    and so on, likewise velocity, and attitude in its unit. Rows of NaN are left out."""
    squares = errors[np.isfinite(errors).all(axis=1)] ** 2
    squares[:, 6:] *= attitude.per_radian**2
    means = squares.mean(axis=0) if len(squares) else np.full(9, np.nan)
    figures = {}
    for i, quantity in enumerate(QUANTITIES):
        part = means[3 * i : 3 * i + 3]
        figures[quantity] = float(np.sqrt(part.sum()))
        figures[f"{quantity} horizontal"] = float(np.sqrt(part[:2].sum()))
        axes = attitude.axes if quantity == "attitude" else _NED
        figures |= {f"{quantity} {axis}": float(np.sqrt(v)) for axis, v in zip(axes, part, strict=True)}
    return figures


def summarise_experiment(experiment: Experiment, outcomes: Sequence[Outcome]) -> Report:
    """Plain data: for every arm and stretch the mean over seeds and its 95 % interval, consistency, R used over true; then the
    published orders and explanations with what was measured of them."""
    stretches = (*experiment.stretches, WHOLE)
    figures = {
        arm.label: {stretch.name: _seed_figures(experiment, arm.label, stretch, outcomes) for stretch in stretches}
        for arm in experiment.arms
    }
    first = experiment.arms[0].label
    arms = {
        arm.label: {
            "method": arm.method,
            "parameters": dict(arm.parameters),
            "told": arm.told,
            "failures": {str(o.seed): o.failures[arm.label] for o in outcomes if arm.label in o.failures},
            "cpu_ms_per_epoch": _cpu_ms_per_epoch(arm.label, outcomes),
            "restarts": arm.restarts,
            "switching_s": _switching_times(arm.label, experiment, outcomes),
            "stretches": {
                stretch.name: {
                    "rmse": _intervals(figures[arm.label][stretch.name]),
                    f"rmse_minus_{first}": _differences(figures[arm.label][stretch.name], figures[first][stretch.name]),
                    "nees": _consistency(arm.label, stretch, outcomes),
                    "noise_ratio": _noise_ratios(arm.label, stretch, outcomes),
                    "noise_used": _noise_means(arm.label, stretch, outcomes),
                    "noise_settled_s": _settling_times(arm.label, stretch, outcomes),
                }
                for stretch in stretches
            },
        }
        for arm in experiment.arms
    }
    promises = judge_promises(experiment.ratios, figures, _interval)
    consistency = judge_consistency(experiment.accepted, arms)
    orders = [_judge_order(claim, figures) for claim in (*published_orders(experiment), *experiment.orders)]
    explanations = [
        {
            "text": claim.text,
            "stretch": claim.stretch,
            "kind": claim.kind,
            "arm": claim.arm,
            "low": claim.low,
            "high": claim.high,
            "measured": (ratio := arms[claim.arm]["stretches"][claim.stretch]["noise_ratio"].get(claim.kind, float("nan"))),
            "holds": bool(claim.low < ratio < claim.high),
        }
        for claim in experiment.noise_claims
    ]
    return plain_data(
        {
            "schema": _SCHEMA,
            "name": experiment.name,
            "description": experiment.description,
            "paper": experiment.paper,
            "scenario": {"name": experiment.scenario.name, "description": experiment.scenario.description},
            "seeds": [outcome.seed for outcome in outcomes],
            "stretches": {stretch.name: stretch.windows for stretch in experiment.stretches},
            "units": {"position": "m", "velocity": "m/s", "attitude": experiment.attitude.unit},
            "arms": arms,
            "published": [
                {"source": p.source, "stretch": p.stretch, "quantity": p.quantity, "figures": dict(p.figures)}
                for p in experiment.published
            ],
            "published_noise": [
                {"source": p.source, "stretch": p.stretch, "arm": p.arm, "figures": dict(p.figures)}
                for p in experiment.published_noise
            ],
            "orders": orders,
            "explanations": explanations,
            "promises": promises,
            "accepted": consistency,
            "conclusions": (
                *_conclude(orders, explanations, len(outcomes)),
                *tell_promises(promises),
                *tell_consistency(consistency),
            ),
            "notes": experiment.notes,
        }
    )


def _arms_of(label: str, outcomes: Sequence[Outcome]) -> Iterable[tuple[Outcome, ArmOutcome]]:
    return ((outcome, outcome.arms[label]) for outcome in outcomes if label in outcome.arms)


def _seed_figures(experiment: Experiment, label: str, stretch: Stretch, outcomes: Sequence[Outcome]) -> dict[str, Floats]:
    """By figure: its value on every seed, NaN where the arm failed."""
    names = rmse_figures(np.zeros((1, 9)), experiment.attitude)
    figures = {name: np.full(len(outcomes), np.nan) for name in names}
    for i, outcome in enumerate(outcomes):
        if label in outcome.arms:
            rows = stretch_rows(stretch, outcome.t_s)
            for name, value in rmse_figures(outcome.arms[label].errors[rows], experiment.attitude).items():
                figures[name][i] = value
    return figures


def _switching_times(label: str, experiment: Experiment, outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """For each change, the time [s] that a bank takes until the weight of the hypothesis that is true from then on is the
    largest: mean over the seeds where it is before the next change, and how many these are."""
    banks = [(outcome, arm.weights) for outcome, arm in _arms_of(label, outcomes) if arm.weights is not None]
    start_ns = experiment.scenario.journey.start_ns
    found = []
    for (at, hypothesis), (end, _) in pairwise((*experiment.changes, (np.inf, ""))):
        taken = []
        for _, weights in banks:
            if hypothesis in weights.labels:
                t_s = (weights.t_ns - start_ns) / 1e9
                leads = weights.values.argmax(axis=1) == weights.labels.index(hypothesis)
                times = t_s[leads & (t_s >= at) & (t_s < end)]
                taken += [float(times[0] - at)] if len(times) else []
        if banks:
            mean = float(np.mean(taken)) if taken else float("nan")
            found.append({"at_s": at, "hypothesis": hypothesis, "mean_s": mean, "seeds": len(taken)})
    return found


def _interval(values: Floats) -> dict[str, float]:
    """Mean of values (n,) and half the width of its 95 % interval by Student's t; unknown for fewer than two."""
    known = values[np.isfinite(values)]
    n = len(known)
    half = float(stdtrit(n - 1, 0.975) * known.std(ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
    return {"mean": float(known.mean()) if n else float("nan"), "half_width": half, "seeds": n}


def _intervals(figures: dict[str, Floats]) -> dict[str, dict[str, float]]:
    return {name: _interval(values) for name, values in figures.items()}


def _differences(figures: dict[str, Floats], reference: dict[str, Floats]) -> dict[str, dict[str, float]]:
    return {name: _interval(values - reference[name]) for name, values in figures.items()}


def _consistency(label: str, stretch: Stretch, outcomes: Sequence[Outcome]) -> dict[str, dict[str, float]]:
    """By quantity the mean NEES (3 expected), and the share of epochs whose average over seeds lies in its 95 % bounds (at
    least 0.9 for a filter that is to be believed)."""
    nees = [arm.nees[stretch_rows(stretch, outcome.t_s)] for outcome, arm in _arms_of(label, outcomes)]
    if not nees:
        return {}
    averages, dof = np.mean(nees, axis=0), 3 * len(nees)
    low, high = chdtri(dof, [0.975, 0.025]) / len(nees)
    known = np.isfinite(averages)
    inside = (averages > low) & (averages < high)
    return {
        quantity: {
            "mean": float(averages[known[:, i], i].mean()),
            "share_inside": float(inside[known[:, i], i].mean()),
        }
        for i, quantity in enumerate(CONSISTENT)
        if known[:, i].any()
    }


def _noise_ratios(label: str, stretch: Stretch, outcomes: Sequence[Outcome]) -> dict[str, float]:
    """By kind of measurement: median over seeds and measurements of R used over true."""
    gathered: dict[str, list[Floats]] = {}
    for _, arm in _arms_of(label, outcomes):
        for kind, noise in arm.noise.items():
            gathered.setdefault(kind, []).append(noise.ratio[stretch_rows(stretch, noise.t_s)])
    joined = {kind: np.concatenate(parts) for kind, parts in gathered.items()}
    return {kind: float(np.median(ratios)) for kind, ratios in joined.items() if len(ratios)}


def _noise_means(label: str, stretch: Stretch, outcomes: Sequence[Outcome]) -> dict[str, dict[str, float]]:
    """By component (``position north``): mean over epochs and seeds of the variance used, and of the true one."""
    gathered: dict[str, list[Floats]] = {}
    for _, arm in _arms_of(label, outcomes):
        for kind, noise in arm.noise.items():
            rows = stretch_rows(stretch, noise.t_s)
            for j, name in enumerate(noise.labels):
                used, ratio = (a[rows].reshape(-1, len(noise.labels))[:, j] for a in (noise.used, noise.ratio))
                if len(used):
                    gathered.setdefault(f"{kind} {name}", []).append(np.array([used.mean(), (used / ratio).mean()]))
    means = {name: np.mean(figures, axis=0) for name, figures in gathered.items()}
    return {name: {"used": float(used), "true": float(true)} for name, (used, true) in means.items()}


def _settling_times(label: str, stretch: Stretch, outcomes: Sequence[Outcome]) -> dict[str, float]:
    """By kind: median over seeds of the time [s] from the start of the stretch until R used is first within a factor of
    SETTLED of the true one (geometric mean over an epoch's components); infinite where it is not."""
    start, end = stretch.windows[0]
    gathered: dict[str, list[float]] = {}
    for _, arm in _arms_of(label, outcomes):
        for kind, noise in arm.noise.items():
            rows = (noise.t_s >= start) & (noise.t_s < end)
            t_s, inverse = np.unique(noise.t_s[rows], return_inverse=True)
            mean = np.bincount(inverse, np.log(noise.ratio[rows])) / np.bincount(inverse)
            settled = t_s[np.abs(mean) < np.log(SETTLED)]
            gathered.setdefault(kind, []).append(float(settled[0] - start) if len(settled) else np.inf)
    return {kind: float(np.median(times)) for kind, times in gathered.items()}


def _cpu_ms_per_epoch(label: str, outcomes: Sequence[Outcome]) -> float:
    """Median over seeds of the CPU time of filtering, propagation included, per measurement epoch."""
    costs = [1e3 * outcome.seconds[label] / max(arm.epochs, 1) for outcome, arm in _arms_of(label, outcomes)]
    return float(np.median(costs or [np.nan]))


def published_orders(experiment: Experiment) -> tuple[OrderClaim, ...]:
    """What the published tables say of every pair of arms; pairs of equal figures say nothing."""
    claims = []
    for row in experiment.published:
        for one, other in combinations(row.figures, 2):
            better, worse = sorted((one, other), key=row.figures.__getitem__)
            if row.figures[better] < row.figures[worse]:
                source = f"{row.source}: {row.figures[better]:g} < {row.figures[worse]:g}"
                claims.append(OrderClaim(source, row.stretch, row.quantity, better, worse))
    return tuple(claims)


def _judge_order(claim: OrderClaim, figures: dict[str, dict[str, dict[str, Floats]]]) -> dict[str, Any]:
    better, worse = (figures[label][claim.stretch][claim.quantity] for label in (claim.better, claim.worse))
    gain = _interval(worse - better)
    verdict = "undecided"
    if abs(gain["mean"]) > gain["half_width"]:
        verdict = "holds" if gain["mean"] > 0 else "contradicted"
    return {
        "source": claim.source,
        "stretch": claim.stretch,
        "quantity": claim.quantity,
        "better": claim.better,
        "worse": claim.worse,
        "measured_better": _interval(better)["mean"],
        "measured_worse": _interval(worse)["mean"],
        "gain": gain,
        "verdict": verdict,
    }


def _conclude(orders: Sequence[dict[str, Any]], explanations: Sequence[dict[str, Any]], seeds: int) -> tuple[str, ...]:
    """Sentences: how much of the published order holds, and which explanations do."""
    sentences = []
    for stretch in dict.fromkeys(order["stretch"] for order in orders):
        verdicts = [order["verdict"] for order in orders if order["stretch"] == stretch]
        held, contradicted, open_ = (verdicts.count(verdict) for verdict in ("holds", "contradicted", "undecided"))
        whole = "holds" if held == len(verdicts) else "does not hold as a whole"
        sentences.append(
            f"The published order in '{stretch}' {whole}: of {len(verdicts)} comparisons {held} hold, {contradicted} are "
            f"contradicted and {open_} are undecided (paired differences over {seeds} seeds, 95 %). Were all arms alike, "
            f"chance would decide {0.05 * len(verdicts):.2g} of them."
        )
    for explanation in explanations:
        state = "holds" if explanation["holds"] else "does not hold"
        sentences.append(
            f"That {explanation['text']} {state}: R used over true is {explanation['measured']:.2g} (median) for "
            f"{explanation['arm']}, {explanation['kind'].replace('_', ' ')}, in '{explanation['stretch']}'."
        )
    return tuple(sentences)
