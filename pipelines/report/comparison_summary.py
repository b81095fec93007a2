"""The headline figures of a comparison, for the terminal and for programs."""

from collections.abc import Mapping
from typing import Any

from pipelines.report.comparison import Comparison, build_comparison, overview_table
from pipelines.report.summary import NO_REFERENCE, describe_log, describe_warnings
from pipelines.report.table import table_lines

__all__ = ["comparison_values", "summarise_comparison"]


def comparison_values(comparison: Comparison) -> dict[str, object]:
    """Plain values for JSON: per run those of `pipelines.report.summary.headline_figures` with label and value of the varied
    key, and once the findings and why runs failed."""
    report = build_comparison(comparison)
    return {
        "varied": report["varied"],
        "methods": [_method_values(label, method) for label, method in report["methods"].items()],
        "failures": report["failures"],
        "findings": [{key: finding[key] for key in ("level", "code", "text")} for finding in report["findings"]],
    }


def _method_values(label: str, method: Mapping[str, Any]) -> dict[str, object]:
    values = {"label": label, "value": method["value"]}
    values |= {"verdict": method["verdict"], "warnings": method["warnings"]}
    values |= {key: method["drive"][key] for key in ("method", "rows", "duration_s")}
    values["timing_s"] = {stage: round(seconds, 3) for stage, seconds in method["timing_s"].items()}
    if method["errors"] is not None:
        values["errors_m"] = {stretch: _position_errors(method["errors"][stretch]) for stretch in ("all", "outside")}
        ends = method["outages"]["summary"]["end_horizontal"]
        values["outage_end_horizontal_m"] = {"median": ends["p50"]} | {name: ends[name] for name in ("count", "p95", "max")}
    return values


def _position_errors(errors: Mapping[str, Any]) -> dict[str, float | None]:
    return {
        f"{component}_{name}": errors["position"][component][name]
        for component in ("horizontal", "3d")
        for name in ("rms", "p95")
    }


def summarise_comparison(comparison: Comparison) -> list[str]:
    """Lines for the terminal: what was processed, what looked wrong, how good each run is, what could not run."""
    first = comparison.drawn[0][1]
    minutes = (int(first.solution.t_ns[-1]) - int(first.solution.t_ns[0])) / 60e9
    report = build_comparison(comparison)
    overview = overview_table(report)
    lines = [f"{len(comparison.reports)} runs of {minutes:.1f} min", *describe_log(first)]
    lines += [*table_lines(overview), overview.note] if overview.rows else [NO_REFERENCE]
    for label, method in report["methods"].items():
        lines += describe_warnings(method["warnings"], f"{label}: ")
    lines += [f"verdict: {label}: {method['verdict']['summary']}" for label, method in report["methods"].items()]
    return lines + [f"could not run: {variant.label}: {reason}" for variant, reason in comparison.failures]
