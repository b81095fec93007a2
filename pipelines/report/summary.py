"""The headline figures of a run, for the terminal and for programs."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from navreplay.evaluation.metrics import Evaluation, summarise_outages
from navreplay.evaluation.outages import count_outages
from navreplay.timeline import Provenance
from pipelines.drive.result import RunResult
from pipelines.report.verdict import describe_verdict, group_warnings

__all__ = [
    "NO_REFERENCE",
    "describe_log",
    "describe_outputs",
    "describe_verdict_lines",
    "describe_warnings",
    "headline_figures",
    "summarise_run",
]

_COLOURS = {"good": 32, "fair": 33, "poor": 31}
"""Of a terminal: green, yellow, red."""

NO_REFERENCE = "no reference, so no errors; give one with --reference"


def headline_figures(result: RunResult) -> dict[str, object]:
    """Plain values for JSON: method, rows, duration [s], errors against the reference [m], outages, findings, seconds."""
    solution = result.solution
    figures: dict[str, object] = {
        "method": solution.method,
        "rows": len(solution),
        "duration_s": (int(solution.t_ns[-1]) - int(solution.t_ns[0])) / 1e9,
        "findings": [{"level": f.level, "code": f.code, "text": f.text} for f in result.findings],
        "verdict": describe_verdict(result),
        "warnings": group_warnings(solution),
        "timing_s": {stage: round(seconds, 3) for stage, seconds in result.timing_s.items()},
    }
    if result.evaluation is not None:
        figures["errors_m"] = _position_errors(result.evaluation)
        figures["outage_end_horizontal_m"] = _outage_ends(result.evaluation)
    return figures


def _position_errors(evaluation: Evaluation) -> dict[str, dict[str, float | None]]:
    """Root mean square and 95 % of the horizontal and 3-D error, over all and outside outages; None where unknown."""
    errors = {}
    for stretch in ("all", "outside"):
        table = evaluation.statistics[stretch]["position"]
        errors[stretch] = {
            f"{component}_{name}": _known(getattr(table[component], name))
            for component in ("horizontal", "3d")
            for name in ("rms", "p95")
        }
    return errors


def _outage_ends(evaluation: Evaluation) -> dict[str, float | int | None]:
    ends = summarise_outages(evaluation.outages)["end_horizontal"]
    return {"count": ends.count, "median": _known(ends.p50), "p95": _known(ends.p95), "max": _known(ends.max)}


def _known(value: float) -> float | None:
    return value if isfinite(value) else None


def summarise_run(result: RunResult) -> list[str]:
    """Lines for the terminal: what was processed, how good it is, what looked wrong."""
    solution = result.solution
    minutes = (int(solution.t_ns[-1]) - int(solution.t_ns[0])) / 60e9
    lines = [f"{solution.method}: {minutes:.1f} min, {len(solution)} rows, {sum(result.timing_s.values()):.1f} s to process"]
    lines += describe_log(result) + describe_warnings(group_warnings(result.solution))
    if result.evaluation is None:
        return [*lines, NO_REFERENCE]
    return lines + _describe_errors(result.evaluation)


def describe_warnings(groups: Sequence[Mapping[str, Any]], of: str = "") -> list[str]:
    """A line per group of a filter's warnings, as `group_warnings` makes them; of: the name of its run."""
    lines = []
    for group in groups:
        count = f" ({group['count']} times, first at" if group["count"] > 1 else " (at"
        lines.append(f"warning: {of}{group['text']}{count} {group['utc'].partition('T')[2][:10]})")
    return lines


def describe_verdict_lines(result: RunResult, colour: bool = False) -> list[str]:
    """The verdict for the end of the terminal's output, its first line in the colour of its grade where asked."""
    described = describe_verdict(result)
    first = f"verdict: {described['summary']}"
    if colour:
        first = f"\033[1;{_COLOURS[described['grade']]}m{first}\033[0m"
    return [first, *(f"  {line}" for line in described["lines"])]


def describe_log(result: RunResult) -> list[str]:
    """What looked wrong in the log, and what of it was lost."""
    findings = [finding for finding in result.findings if finding.level != "info"]
    lines = [f"{finding.level}: {finding.text} {finding.hint}".rstrip() for finding in findings]
    return lines + _describe_losses(result.timeline.provenance)


def _describe_losses(provenance: Provenance) -> list[str]:
    """Damage found in files and messages that were rejected."""
    return [f"damaged: {note}" for note in provenance.damage] + [
        f"rejected: {channel.name}: {count} of {channel.read} messages ({reason})"
        for channel in provenance.channels
        for reason, count in channel.rejected.items()
    ]


def _describe_errors(evaluation: Evaluation) -> list[str]:
    lines = []
    for stretch, name in (("all", "all epochs"), ("outside", "outside outages")):
        table = evaluation.statistics[stretch]["position"]
        flat, total = table["horizontal"], table["3d"]
        if flat.count and (stretch == "all" or evaluation.in_outage.any()):
            lines.append(
                f"{name + ':':<17}horizontal error {flat.rms:.3f} m rms, {flat.p95:.3f} m 95 %; "
                f"3-D {total.rms:.3f} m rms, {total.p95:.3f} m 95 % ({flat.count} epochs)"
            )
    ends = summarise_outages(evaluation.outages)["end_horizontal"]
    if ends.count:
        counted = count_outages(evaluation.outages)
        kind = ("simulated " if counted[0].outage.cause == "simulated" else "") + ("outage" if ends.count == 1 else "outages")
        others = len(evaluation.outages) - len(counted)
        apart = f"; {others} of other causes in the report" if others else ""
        lines.append(
            f"end of outage:   horizontal error {ends.p50:.2f} m median, {ends.p95:.2f} m 95 % ({ends.count} {kind}{apart})"
        )
    return lines


def describe_outputs(outputs: Mapping[str, Path]) -> list[str]:
    """A line per file written."""
    width = max(len(name) for name in outputs) + 1
    return [f"{name + ':':<{width}} {path}" for name, path in outputs.items()]
