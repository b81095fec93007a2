"""The default that needs no tuning: which noise a whole log shows, found before the filter runs (`auto`).

Told noise is kept until the log speaks against it, by the Bayesian information criterion (Schwarz, Annals of Statistics 6
(1978) 461). Each pass linearises the log about a run with what is known so far, and asks in turn for
1. the white noises of the IMU, or of motion, by expectation maximisation together with R (em_offline.py);
2. errors of fixes that stay, in position (multipath) or velocity (a receiver that smooths): a Gauss-Markov error beside the
   white one, its variance and time of greatest likelihood; if found, it becomes three further states (correlated_error.py);
3. levels of R by kind of measurement, and per satellite when each holds: steps, outliers, heavy tails (noise_levels.py).
The run that counts has a prescribed R for every epoch, outliers included, and so neither adaptation nor a gate.
Assumes: what is in the log repeats itself or lasts: levels that come back, errors correlated throughout; fixes whose north,
east and down errors change together; the error model is right but for its noise.
Ranges: their errors stay satellite by satellite, which is not looked for, and what scatters less than told may stay the more;
so a level below the told is not believed. consider.every_method reckons with what stays.
Fails: on a noise that drifts without levels (three steps stand for it); on correlated errors of single satellites, or of part
of the log only, or that stay for more than a tenth of it; on a log of a few dozen epochs, which is filtered as told.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, log, sqrt
from typing import Literal, NamedTuple

import numpy as np

from navreplay.adapt.prescribed import Prescribed
from navreplay.calibration.em_offline import SCALED_KINDS, Factors, apply_factors, estimated_figures, maximise_likelihood
from navreplay.calibration.linear_log import (
    LinearLog,
    adjoin,
    correlate,
    correlate_anew,
    delete,
    hold_sources,
    log_likelihood,
    process_noise,
    scale_rows,
)
from navreplay.calibration.noise_levels import LEAST_EPOCHS, Chain, find_levels, ratios_of
from navreplay.calibration.settled import Settled, Trace
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.options import CorrelatedNoise, FilterOptions, GateOptions
from navreplay.timeline import Floats

__all__ = ["Auto", "carry_over"]

_SOURCES = ("gyro_noise", "accel_noise", "horizontal", "vertical")
"""Process noises that are asked for; the walk of a bias shows too little of itself in one log."""
_STEPS, _TOLERANCE = 100, 0.01
Kind = Literal["position", "velocity"]
_JOINT: tuple[Kind, ...] = ("position", "velocity")
"""Kinds whose components have their level in common."""
_LEAST = {"range": 1.0, "range_rate": 1.0}
"""Least ratios believed: what scatters less than told may stay the more (satellites, atmosphere, reflections at rest)."""


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """What is known so far. sources: factors of variance. correlated: errors that stay. ratios: by stretch, (r,) of R to
    told R."""

    sources: Factors
    correlated: tuple[CorrelatedNoise, ...]
    ratios: tuple[Floats, ...]


@dataclass(frozen=True, slots=True)
class Auto:
    """passes: linearisations of the log, after a first one that only asks by how much R is off on average."""

    passes: int = 2

    @property
    def traces(self) -> int:
        """How many passes it asks for."""
        return 1 + self.passes

    def settle(self, options: FilterOptions, trace: Trace) -> Settled:
        """The options with what was found, and R by epoch."""
        logs = trace(options, Prescribed(), ())
        kinds, _ = maximise_likelihood(logs, _all_kinds(logs), _STEPS, _TOLERANCE)
        kinds = {kind: max(ratio, _LEAST.get(kind, 0.0)) for kind, ratio in kinds.items()}
        found = Found({}, (), tuple(one.by_kind(kinds) for one in logs))
        for _ in range(self.passes):
            means = _mean_ratios(logs, found.ratios)
            before = logs
            logs = trace(_apply(options, found, means, False), _prescribe(logs, found.ratios, means), _SOURCES)
            logs = tuple(_told_first(one, means, found.sources) for one in logs)
            found = replace(found, ratios=carry_over(before, found.ratios, logs, means))
            found = _find_levels(logs, _find_correlation(logs, _find_sources(logs, found)))
        means = _mean_ratios(logs, found.ratios)
        chosen = _apply(options, found, means, True)
        if _epochs(logs) >= LEAST_EPOCHS:
            # outliers have a level of their own; the gate would only shut out good fixes behind an outage
            chosen = replace(chosen, gate=GateOptions(probability=1.0))
        return Settled(chosen, _prescribe(logs, found.ratios, means), _figures(chosen, found, means), _notes(found, means))


def _mean_ratios(logs: Sequence[LinearLog], ratios: Sequence[Floats]) -> Factors:
    """By kind, the mean over the whole log, with which a filter must expect its first fix."""
    rows: dict[str, list[Floats]] = {}
    for one, part in zip(logs, ratios, strict=True):
        for kind in SCALED_KINDS:
            if kind in one.rows_by_kind:
                rows.setdefault(kind, []).append(part[one.rows_by_kind[kind]])
    return {kind: max(float(np.concatenate(parts).mean()), _LEAST.get(kind, 0.0)) for kind, parts in rows.items()}


def carry_over(
    before: Sequence[LinearLog], ratios: Sequence[Floats], logs: Sequence[LinearLog], means: Factors
) -> tuple[Floats, ...]:
    """The ratios (r,) of each of logs, by those of a pass before: one that lost its way was started anew, and has other
    stretches and epochs than one that did not. What it did not see has the mean of its kind."""
    known: dict[tuple[int, str], float] = {}
    for one, part in zip(before, ratios, strict=True):
        known |= zip(zip(one.t_ns[one.epochs].tolist(), one.labels, strict=True), part.tolist(), strict=True)
    carried = []
    for one in logs:
        rows = zip(one.t_ns[one.epochs].tolist(), one.labels, one.by_kind(means).tolist(), strict=True)
        carried.append(np.array([known.get((t_ns, label), mean) for t_ns, label, mean in rows]))
    return tuple(carried)


def _apply(options: FilterOptions, found: Found, means: Factors, correlated: bool) -> FilterOptions:
    chosen = apply_factors(options, {**means, **found.sources})
    return replace(chosen, correlated_noise=found.correlated) if correlated else chosen


def _prescribe(logs: Sequence[LinearLog], ratios: Sequence[Floats], means: Factors) -> Prescribed:
    by_epoch = {}
    for one, part in zip(logs, ratios, strict=True):
        relative = part / one.by_kind(means)
        for t_ns, first, last in zip(one.t_ns.tolist(), one.starts[:-1].tolist(), one.starts[1:].tolist(), strict=True):
            by_epoch[t_ns] = relative[first:last]
    return Prescribed(by_epoch)


def _told_first(one: LinearLog, means: Factors, sources: Factors) -> LinearLog:
    """A log of a pass with other noise, in terms of that told at first."""
    told = scale_rows(one, 1 / one.by_kind(means))
    return replace(one, told=told, sources={name: part / sources.get(name, 1.0) for name, part in one.sources.items()})


def _with(logs: Sequence[LinearLog], found: Found) -> list[LinearLog]:
    """The logs with what is known taken for told."""
    scaled = []
    for one, ratios in zip(logs, found.ratios, strict=True):
        sources = {name: part * found.sources.get(name, 1.0) for name, part in one.sources.items()}
        known = replace(one, told=scale_rows(one, ratios), sources=sources)
        scaled.append(correlate(known, CorrelatedErrors(found.correlated)))
    return scaled


def _all_kinds(logs: Sequence[LinearLog]) -> Factors:
    return dict.fromkeys((kind for one in logs for kind in one.rows_by_kind), 1.0)


def _epochs(logs: Sequence[LinearLog]) -> int:
    return sum(len(one.t_ns) for one in logs)


def _find_sources(logs: Sequence[LinearLog], found: Found) -> Found:
    """Factors of the process noise, where the likelihood gains more than their number costs."""
    known = _with(logs, found)
    kinds = _all_kinds(known)
    names = dict.fromkeys((name for one in known for name in one.sources), 1.0)
    _, without = maximise_likelihood([hold_sources(one) for one in known], kinds, _STEPS, _TOLERANCE)
    factors, course = maximise_likelihood(known, {**kinds, **names}, _STEPS, _TOLERANCE)
    if course[-1] - without[-1] < 0.5 * len(names) * log(_epochs(logs)):
        return found
    return replace(found, sources={name: found.sources.get(name, 1.0) * factors[name] for name in names})


def _find_correlation(logs: Sequence[LinearLog], found: Found) -> Found:
    """Errors that stay, first of the kind from which the likelihood gains most, where that is worth a variance and a time."""
    found = replace(found, correlated=())
    kinds = [kind for kind in _JOINT if any(kind in one.rows_by_kind for one in logs)]
    while kinds:
        trials = [_try_correlation(logs, found, kind) for kind in kinds]
        best, gain = max(trials, key=lambda trial: trial[1])
        if gain < log(_epochs(logs)):
            break
        found = best
        kinds.remove(best.correlated[-1].kind)
    return found


def _try_correlation(logs: Sequence[LinearLog], found: Found, kind: Kind) -> tuple[Found, float]:
    """With an error of that kind that stays, and the gain of log-likelihood over the white one alone."""
    from scipy.optimize import minimize, minimize_scalar  # slow to load, and hardly any other method needs it

    known = [hold_sources(one) for one in _with(logs, found)]
    told = np.median(np.concatenate([_told_variances(one, kind) for one in logs]), axis=0)
    std = sqrt(told[:2].mean()), sqrt(told[2])

    def build(x: Floats) -> CorrelatedNoise:
        """Of the logarithms x[1] of its variance against that told, and x[2] of its time."""
        return CorrelatedNoise(kind, (std[0] * exp(x[1] / 2), std[1] * exp(x[1] / 2)), exp(x[2]))

    def misfit(x: Floats) -> float:
        """Minus the log-likelihood, with the logarithm x[0] of a factor on R of that kind."""
        errors = CorrelatedErrors((build(x),))
        wider = [correlate_anew(one, wide, errors) for one, wide in zip(known, first, strict=True)]
        noises = [scale_rows(one, one.by_kind({kind: exp(x[0])})) for one in known]
        return -sum(log_likelihood(one, one.rest, noise) for one, noise in zip(wider, noises, strict=True))

    first = [correlate(one, CorrelatedErrors((build(np.zeros(3)),))) for one in known]
    # next to nothing that stays
    white = minimize_scalar(lambda factor: misfit(np.array([factor, -30.0, 0.0])), bracket=(-0.5, 0.5), tol=1e-3).fun
    step = float(np.median(np.concatenate([np.diff(one.t_ns) for one in known]))) / 1e9
    longest = max(max(one.t_ns[-1] - one.start_ns for one in known) / 1e10, 2 * step)
    bounds = [(log(1e-3), log(1e3)), (log(1e-3), log(1e5)), (log(step), log(longest))]
    times = np.geomspace(step, longest, 5)[1:-1].tolist()
    begin = min((np.array([0.0, log(share), log(time)]) for share in (0.1, 2.0) for time in times), key=misfit)
    best = minimize(misfit, begin, method="Nelder-Mead", bounds=bounds, options={"xatol": 0.1, "fatol": 0.3, "maxfev": 80})
    ratios = [old * one.by_kind({kind: exp(best.x[0])}) for one, old in zip(logs, found.ratios, strict=True)]
    return Found(found.sources, (*found.correlated, build(best.x)), tuple(ratios)), white - best.fun


def _told_variances(one: LinearLog, kind: str) -> Floats:
    """(e, 3) NED, of the epochs with that kind."""
    variances = np.diagonal(one.told, axis1=1, axis2=2)[one.epochs, one.places]
    return np.asarray(variances[one.rows_by_kind.get(kind, [])].reshape(-1, 3))


def _find_levels(logs: Sequence[LinearLog], found: Found) -> Found:
    """Levels of R, kind by kind, from what all other measurements say of each; twice, since these have levels too."""
    for _ in range(2):
        new = [ratios.copy() for ratios in found.ratios]
        groups = [group for i, one in enumerate(_with(logs, found)) for group in _chains(i, one, logs[i].told)]
        for kind in dict.fromkeys(group.kind for group in groups):
            same = [group for group in groups if group.kind == kind]
            levels = find_levels([group.chain for group in same])
            for group in same:
                new[group.log][group.rows] = np.maximum(ratios_of(group.chain, levels), _LEAST.get(kind, 0.0))[:, None]
        found = replace(found, ratios=tuple(new))
    return found


class Group(NamedTuple):
    """A chain of the log of that index, and the rows (k, m) of its components."""

    log: int
    kind: str
    rows: np.ndarray
    chain: Chain


def _chains(index: int, known: LinearLog, told: Floats) -> list[Group]:
    """The noises of a log: a chain by kind for those that have their level in common, else one by label."""
    noise = known.told
    adjoints = adjoin(known, process_noise(known, {}), noise)
    groups = []
    for kind, rows in known.rows_by_kind.items():
        if kind in _JOINT:
            parts = [rows.reshape(-1, 3)]
        else:
            labels = np.array(known.labels)[rows]
            parts = [rows[labels == label][:, None] for label in dict.fromkeys(labels.tolist())]
        groups += [Group(index, kind, part, Chain(*delete(known, adjoints, noise, told, part))) for part in parts]
    return groups


def _figures(chosen: FilterOptions, found: Found, means: Factors) -> dict[str, float | tuple[float, float]]:
    figures: dict[str, float | tuple[float, float]] = {**estimated_figures(chosen, {**means, **found.sources})}
    for noise in found.correlated:
        figures |= {f"correlated_{noise.kind}_std": noise.std, f"{noise.kind}_correlation_time": noise.time}
    return figures


def _notes(found: Found, means: Factors) -> tuple[str, ...]:
    factors = {**means, **found.sources}.items()
    scales = ", ".join(f"{name.replace('_', ' ')} times {sqrt(value):.3g}" for name, value in factors)
    notes = [f"auto: standard deviations against those told, on average: {scales}"]
    for noise in found.correlated:
        size = f"{noise.std[0]:.3g} horizontally and {noise.std[1]:.3g} vertically [SI] over {noise.time:.3g} s"
        notes.append(f"auto: the {noise.kind} of the fixes has errors that stay, {size}; they are estimated")
    return tuple(notes)
