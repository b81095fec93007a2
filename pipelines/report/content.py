"""report.json: everything a run has to say about itself, as plain data (keys in docs/report.md)."""

import json
import math
import platform
import re
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from navreplay.evaluation.metrics import (
    Evaluation,
    OutageErrors,
    Statistics,
    assess_outages,
    compute_nis,
    find_outages,
    summarise,
    summarise_outages,
)
from navreplay.evaluation.outages import count_outages
from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.time_scales import week_tow_from_gps
from navreplay.solution import InnovationSeries, Solution, WeightSeries
from navreplay.timeline import Provenance
from pipelines.drive.result import RunResult
from pipelines.report.plain_data import plain_data
from pipelines.report.satellites import describe_satellites
from pipelines.report.verdict import describe_verdict, group_warnings
from pipelines.trajectory.solution_csv import utc_text

__all__ = ["Report", "build_report", "dump_json", "outage_errors"]

Report = dict[str, Any]
_SCHEMA = "navreplay report 1"
_FIGURE = re.compile(r"\d[\d.e+-]*")
"""Figures in a reason, which differ from epoch to epoch; without them equal reasons are counted together."""
_DEPENDENCIES = ("numpy", "scipy", "numba", "rosbags", "mcap", "rerun-sdk")


def build_report(result: RunResult) -> Report:
    """The report as nested dictionaries and lists; angles in degrees, unknown figures None."""
    solution, evaluation = result.solution, result.evaluation
    outages = outage_errors(result)
    return {
        "schema": _SCHEMA,
        "versions": _versions(),
        "verdict": describe_verdict(result),
        "drive": _describe_drive(solution),
        "errors": None if evaluation is None else _describe_errors(evaluation),
        "nees": None if evaluation is None else {name: plain_data(judged) for name, judged in evaluation.nees.items()},
        "within_3_sigma": None if evaluation is None else plain_data(evaluation.within_3_sigma),
        "nis": {kind: plain_data(judged) for kind, judged in compute_nis(solution.innovations).items()},
        "innovations": {series.kind: _describe_innovations(series) for series in solution.innovations},
        "weights": None if solution.weights is None else _describe_weights(solution.weights),
        "satellites": None if result.sky is None else describe_satellites(result.sky, solution),
        "outages": {
            "count": len(outages),
            "counted": len(count_outages(outages)),
            "summary": {name: plain_data(statistics) for name, statistics in summarise_outages(outages).items()},
            "list": [_describe_outage(outage, int(solution.t_ns[0])) for outage in outages],
        },
        **_describe_provenance(result.timeline.provenance),
        "findings": [asdict(finding) for finding in result.findings],
        "warnings": group_warnings(solution),
        "events": _describe_events(solution),
        "configuration": plain_data(result.config.model_dump(mode="json")),
        "timing_s": plain_data(result.timing_s),
    }


def dump_json(report: Report) -> str:
    """Valid JSON (no NaN), one key per line."""
    return json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def outage_errors(result: RunResult) -> tuple[OutageErrors, ...]:
    """The outages of a run; without a reference their errors are NaN."""
    if result.evaluation is not None:
        return result.evaluation.outages
    return assess_outages(result.solution, result.solution.outages or find_outages(result.solution))


def _versions() -> dict[str, str]:
    return dict(_found_versions())


@cache
def _found_versions() -> tuple[tuple[str, str], ...]:
    """Looked up once: each costs milliseconds, and an archive has many reports."""
    try:
        own = version("navreplay")
    except PackageNotFoundError:
        own = "not installed (run from a source tree)"
    others = ((name, version(name)) for name in _DEPENDENCIES)
    return (("navreplay", own), ("python", platform.python_version()), *others)


def _describe_drive(solution: Solution) -> dict[str, Any]:
    start, end = utc_text(solution.t_ns[[0, -1]])
    week, tow = week_tow_from_gps(solution.t_ns[:1])
    steps = ned_between(solution.lla[:-1], solution.lla[1:])
    return {
        "method": solution.method,
        "start_utc": start,
        "end_utc": end,
        "start_gps_week": int(week[0]),
        "start_gps_tow_s": float(tow[0]),
        "duration_s": (int(solution.t_ns[-1]) - int(solution.t_ns[0])) / 1e9,
        "distance_m": plain_data(float(np.linalg.norm(steps, axis=1).sum())),
        "rows": len(solution),
        "states": list(solution.state_names),
    }


def _describe_errors(evaluation: Evaluation) -> dict[str, Any]:
    described: dict[str, Any] = {}
    for stretch, tables in evaluation.statistics.items():
        described[stretch] = {}
        for quantity, table in tables.items():
            unit = evaluation.errors[quantity].unit
            factor = math.degrees(1) if unit == "rad" else 1.0
            figures = {component: plain_data(_scale(statistics, factor)) for component, statistics in table.items()}
            described[stretch][quantity] = {"unit": "deg" if unit == "rad" else unit, **figures}
    return described


def _scale(statistics: Statistics, factor: float) -> dict[str, float]:
    return {name: value if name == "count" else value * factor for name, value in asdict(statistics).items()}


def _describe_innovations(series: InnovationSeries) -> dict[str, Any]:
    reasons = zip(series.reason, series.used.tolist(), strict=True)
    rejected = [_FIGURE.sub("…", reason) for reason, used in reasons if not used]
    ratio = series.noise_std / series.nominal_std
    return {
        "unit": series.unit,
        "read": len(series.t_ns),
        "used": int(series.used.sum()),
        "rejected": {reason: rejected.count(reason) for reason in sorted(set(rejected))},
        "components": {
            label: {
                "residual": plain_data(summarise(series.residual[series.used, i])),
                "normalised": plain_data(summarise(series.residual[series.used, i] / series.std[series.used, i])),
                "noise_over_nominal": plain_data(summarise(ratio[series.used, i])),
            }
            for i, label in enumerate(series.labels)
        },
    }


def _describe_weights(weights: WeightSeries) -> dict[str, dict[str, float]]:
    """By hypothesis: mean over the epochs, last value, and share of the epochs at which it is the largest."""
    leads = np.bincount(weights.values.argmax(axis=1), minlength=len(weights.labels)) / len(weights.t_ns)
    rows = zip(weights.labels, weights.values.mean(axis=0).tolist(), weights.values[-1].tolist(), leads.tolist(), strict=True)
    return {label: plain_data({"mean": mean, "last": last, "leads": share}) for label, mean, last, share in rows}


def _describe_outage(errors: OutageErrors, origin_ns: int) -> dict[str, Any]:
    outage = errors.outage
    start, end = utc_text(np.array([outage.start_ns, outage.end_ns]))
    _, tow = week_tow_from_gps(np.array([outage.start_ns, outage.end_ns]))
    return {
        "start_utc": start,
        "end_utc": end,
        "start_gps_tow_s": float(tow[0]),
        "end_gps_tow_s": float(tow[1]),
        "start_elapsed_s": (outage.start_ns - origin_ns) / 1e9,
        "cause": outage.cause,
        "length_s": errors.length_s,
        "distance_m": plain_data(errors.distance_m),
        "end_horizontal_m": plain_data(errors.end_horizontal),
        "end_3d_m": plain_data(errors.end_3d),
        "max_horizontal_m": plain_data(errors.max_horizontal),
        "max_3d_m": plain_data(errors.max_3d),
    }


def _describe_provenance(provenance: Provenance) -> dict[str, Any]:
    return {
        "channels": [asdict(channel) | {"rejected": dict(channel.rejected)} for channel in provenance.channels],
        "files": [asdict(file) for file in provenance.files],
        "assumptions": list(provenance.assumptions),
        "damage": list(provenance.damage),
    }


def _describe_events(solution: Solution) -> list[dict[str, Any]]:
    times = utc_text(np.array([event.t_ns for event in solution.events], dtype=np.int64))
    return [
        {"utc": utc, "elapsed_s": (event.t_ns - int(solution.t_ns[0])) / 1e9, "level": event.level, "text": event.text}
        for utc, event in zip(times, solution.events, strict=True)
    ]
