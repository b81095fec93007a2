"""The verdict on a run in plain words, and as plain data; warnings of the filter, grouped."""

import re
from collections.abc import Mapping
from math import isfinite, sqrt
from typing import Any

import numpy as np

from navreplay.evaluation.credit import KindUse
from navreplay.evaluation.verdict import Fault, Verdict
from navreplay.solution import Event, Solution
from pipelines.drive.advice import Advice
from pipelines.drive.result import RunResult
from pipelines.report.plain_data import plain_data
from pipelines.report.table import Notice, figure_text
from pipelines.trajectory.solution_csv import utc_text

__all__ = ["describe_verdict", "group_warnings", "verdict_notice"]

_FIGURE = re.compile(r"\d[\d.e+-]*")
_LONG_OUTAGE_S = 10.0
_FAR_BETTER = 0.05


def describe_verdict(result: RunResult) -> dict[str, Any]:
    """The verdict as plain data; ``lines`` are its sentences."""
    verdict = result.verdict
    median, p95 = verdict.accuracy
    return {
        "grade": verdict.grade,
        "summary": _summary(verdict),
        "faults": [
            {"grade": fault.grade, "code": fault.code, "kind": fault.kind or None, "value": plain_data(fault.value)}
            | {"text": _fault_text(fault)}
            for fault in verdict.faults
        ],
        "kinds": {use.kind: _describe_kind(use) for use in verdict.kinds},
        "expected_horizontal_m": plain_data({"median": median, "p95": p95, "calibration": verdict.calibration}),
        "fixes": _describe_closeness(verdict),
        "beside_reference": _describe_errors(verdict),
        "backward": plain_data(verdict.backward),
        "restarts": verdict.events["restart"],
        "lock_outs": verdict.events["lock-out"],
        "outages": {"count": verdict.outages[0], "longest_s": plain_data(verdict.outages[1])},
        "limited_by": _limit(result),
        "setting": None if result.advice is None else _describe_advice(result.advice),
        "lines": list(_lines(result)),
    }


def _describe_kind(use: KindUse) -> dict[str, Any]:
    return {
        "read": use.read,
        "used": use.used,
        "rejected": use.rejected,
        "unexplained": use.unexplained,
        "main_reason": use.reason or None,
        "nis_over_expected": plain_data(use.nis),
        "windows": use.windows,
        "windows_off": use.windows_off,
    }


def _describe_closeness(verdict: Verdict) -> dict[str, Any] | None:
    near = verdict.closeness
    if near is None:
        return None
    figures = {"count": near.count, "median_m": near.median, "p95_m": near.p95, "square_over_expected": near.square}
    return plain_data(figures | {"windows": near.windows, "windows_off": near.windows_off})


def _describe_errors(verdict: Verdict) -> dict[str, Any] | None:
    errors = verdict.fix_errors
    if errors is None:
        return None
    return plain_data(
        {"count": errors.count, "fixes_rms_m": errors.fixes, "solution_rms_m": errors.solution, "own": errors.own}
    )


def _describe_advice(advice: Advice) -> dict[str, Any]:
    return plain_data(
        {
            "set": advice.setting or None,
            "told_m": advice.told,
            "found_m": advice.found if advice.setting else None,
            "tried": advice.tried,
            "stretch_s": advice.seconds,
            "held_fixes": advice.held,
        }
    )


def verdict_notice(described: Mapping[str, Any]) -> Notice:
    """What stands on top of a report, from `describe_verdict`."""
    return Notice(described["grade"], f"Verdict: {described['summary']}", tuple(described["lines"]))


def _summary(verdict: Verdict) -> str:
    median, p95 = verdict.accuracy
    if verdict.grade == "poor":
        return f"poor: {_fault_text(verdict.faults[0])}"
    expected = (
        f"expected horizontally {_metres(median)} median, {_metres(p95)} 95 %" if isfinite(median) else "no accuracy known"
    )
    return f"{verdict.grade}: {_fault_text(verdict.faults[0]) + '; ' if verdict.faults else ''}{expected}"


def _metres(value: float) -> str:
    return figure_text(value if isfinite(value) else None, "m")


def _fault_text(fault: Fault) -> str:
    kind, times = _plural(fault.kind), f"{sqrt(max(fault.value, 0)):.2g} times"
    return {
        "finite": f"{100 * fault.value:.3g} % of the rows are not finite",
        "rejected": f"{100 * fault.value:.2g} % of {kind} were rejected, and outliers do not explain it",
        "innovations": f"innovations of {kind} are {times} as large as they should be",
        "windows": f"innovations of {kind} are more than twice as large as they should be in {_share(fault.value)}",
        "distance": f"the positions it was given lie {times} as far from the solution as both covariances say",
        "far-windows": f"the fixes lie more than twice as far off as both covariances say in {_share(fault.value)}",
        "restarts": f"the filter lost its way and was started anew {_count(round(fault.value), 'time')}",
        "reference": f"against the reference the solution is {fault.value:.2g} times as far off as the positions it was given",
        "expected": f"against the reference the solution is {fault.value:.2g} times as far off as it expects of itself",
        "told": f"the log tells the accuracy of {kind} too well: {fault.value:.2g} times as much was taken",
        "backward": f"forward and smoothed positions differ {times} as much as they should",
        "outage": f"positions are missing for {fault.value:.0f} s in a row",
    }[fault.code]


def _share(value: float) -> str:
    return f"{100 * value:.0f} % of the windows of 30 s"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _lines(result: RunResult) -> list[str]:
    verdict = result.verdict
    lines = [f"{fault.grade}: {_fault_text(fault)}" for fault in verdict.faults[1:]]  # the first is in the summary
    lines += [_kind_line(use) for use in verdict.kinds]
    median, p95 = verdict.accuracy
    calibrated = (
        f", the covariance's times {verdict.calibration:.2g} as the innovations say" if verdict.calibration > 1.05 else ""
    )
    accuracy = f"{_metres(median)} median, {_metres(p95)} 95 %{calibrated}"
    lines.append(f"expected horizontal accuracy: {accuracy}; a fault that all measurements share is not in it")
    lines += _fix_lines(verdict)
    lines.append(_backward_line(verdict))
    count, longest = verdict.outages
    lost = f"{_count(count, 'stretch').replace('stretchs', 'stretches')} without positions, the longest {longest:.1f} s"
    restarts = f"{_count(verdict.events['restart'], 'restart')}, {_count(verdict.events['lock-out'], 'lock-out')}"
    lines.append(f"{lost if count else 'no stretch without positions'}; {restarts} of the filter")
    lines.append(f"limited by: {_limit(result)}")
    return [*lines, *_advice_lines(result.advice)]


def _kind_line(use: KindUse) -> str:
    rejected = f", {use.rejected} rejected"
    if use.rejected:
        rejected += f" ({use.unexplained} not explained by outliers; {use.reason})"
    nis = f"; their squared innovations are {figure_text(use.nis)} of what is expected (median)" if isfinite(use.nis) else ""
    off = f", too large in {use.windows_off} of {use.windows} windows of 30 s" if use.windows else ""
    return f"{_plural(use.kind)}: {use.read} read, {use.used} used{rejected if use.rejected else ''}{nis}{off}"


def _fix_lines(verdict: Verdict) -> list[str]:
    lines = []
    near, errors = verdict.closeness, verdict.fix_errors
    they = "least-squares positions of single epochs" if verdict.by_points else "fixes"
    if near is not None:
        lines.append(
            f"distance of {they} to the solution: {_metres(near.median)} median, {_metres(near.p95)} 95 %; squared "
            f"{figure_text(near.square if isfinite(near.square) else None)} of what both covariances say"
        )
    if errors is not None and errors.own:
        lines.append("the reference is made of these fixes, and does not judge them")
    elif errors is not None:
        lines.append(
            f"against the reference, outside outages: {they} {_metres(errors.fixes)} RMS, solution {_metres(errors.solution)} "
            f"({errors.count} of them)"
        )
    return lines


def _backward_line(verdict: Verdict) -> str:
    if verdict.backward is None:
        return "forward only: no backward pass to compare with (--smooth makes one)"
    return (
        f"forward against smoothed positions: squared differences {figure_text(verdict.backward)} of what is expected (median)"
    )


def _limit(result: RunResult) -> str:
    """What holds the run back most, as far as it can be told."""
    verdict = result.verdict
    if verdict.faults:
        return _cause(verdict.faults[0])
    if verdict.outages[1] > _LONG_OUTAGE_S:
        return f"a stretch of {verdict.outages[1]:.0f} s without positions"
    better = [use.kind for use in verdict.kinds if use.kind in ("position", "range") and use.nis < _FAR_BETTER]
    if better:
        return f"the accuracy of {_plural(better[0])}, which lie far closer to the prediction than the log tells of them"
    return "the accuracy of the measurements"


def _cause(fault: Fault) -> str:
    contradicting = (
        f"{_plural(fault.kind) if fault.kind else 'fixes'} that contradict the IMU or each other more than was told: "
    )
    return {
        "finite": "arithmetic that left the finite numbers: noise or values in the log that are out of all proportion",
        "reference": "a fault that the fixes do not show: a lever arm, the time, or the reference's own frame",
        "expected": "errors that stay and that all measurements share, which no innovation shows: atmosphere, a base, a datum",
        "told": f"the accuracy of {_plural(fault.kind)}, which the log tells too well",
        "backward": "the told noise of IMU or measurements, by which the forward pass was surer of itself than it should be",
        "outage": f"a stretch of {fault.value:.0f} s without positions",
    }.get(fault.code, contradicting + "their accuracy, their time, the lever arm, or the attitude")


def _plural(kind: str) -> str:
    words = kind.replace("_", " ")
    return {"velocity": "velocities", "standstill": "standstill", "no slip": "no-slip constraints"}.get(words, f"{words}s")


def _advice_lines(advice: Advice | None) -> list[str]:
    if advice is None:
        return []
    base = f"on {advice.seconds:.0f} s, of which {advice.held} fixes were withheld"
    if not advice.setting:
        return [f"no setting helps clearly: {advice.tried} were tried {base}"]
    return [
        f"most likely to help: --set {advice.setting} (of {advice.tried} settings tried {base}: 68 % of them within "
        f"{_metres(advice.found)} of the prediction instead of {_metres(advice.told)})"
    ]


def group_warnings(solution: Solution) -> list[dict[str, Any]]:
    """The events of level warning, those that differ in figures alone together: the first's ``text`` and ``utc``, and their
    ``count``."""
    groups: dict[str, list[Event]] = {}
    for event in solution.events:
        if event.level == "warning":
            groups.setdefault(_FIGURE.sub("…", event.text), []).append(event)
    firsts = [group[0] for group in groups.values()]
    times = utc_text(np.array([event.t_ns for event in firsts], dtype=np.int64))
    counts = [len(group) for group in groups.values()]
    return [{"text": event.text, "count": count, "utc": utc} for event, count, utc in zip(firsts, counts, times, strict=True)]
