"""Headline figures of a run: what a catalogue has as columns, and a recording as properties."""

from typing import Any

import numpy as np

from navreplay.evaluation.outages import find_outages
from navreplay.evaluation.statistics import compute_nis
from navreplay.geodesy.earth import ned_between
from navreplay.timeline import ImuSeries
from pipelines.drive.result import RunResult
from pipelines.trajectory.solution_csv import utc_text

__all__ = ["FIGURES", "headline"]

FIGURES: dict[str, str] = {
    "attention": "float",
    "verdict": "str",
    "start_utc": "str",
    "duration_s": "float",
    "distance_m": "float",
    "lat_deg": "float",
    "lon_deg": "float",
    "imu_hz": "float",
    "gnss_hz": "float",
    "gnss": "str",
    "imu_gaps": "int",
    "longest_imu_gap_s": "float",
    "used_share": "float",
    "horizontal_rms_m": "float",
    "horizontal_p95_m": "float",
    "horizontal_max_m": "float",
    "height_rms_m": "float",
    "heading_rms_deg": "float",
    "position_nees": "float",
    "position_nis": "float",
    "std_horizontal_m": "float",
    "outages": "int",
    "outage_s": "float",
    "longest_outage_s": "float",
    "outage_end_median_m": "float",
    "findings": "int",
    "first_finding": "str",
    "warnings": "int",
}
"""Names with their types (``str``, ``float``, ``int``), which are the same for every run. attention: what asks to be looked at
has the most, see `_attention`."""

_GRADES = {"good": 0.0, "fair": 1.0, "poor": 2.0}
_GAP = 3.0
"""Usual intervals that make a gap."""


def headline(result: RunResult) -> dict[str, Any]:
    """The figures of a run by name, unknown ones None. SI units, degrees where a name says so."""
    solution, timeline = result.solution, result.timeline
    steps = np.linalg.norm(ned_between(solution.lla[:-1], solution.lla[1:])[:, :2], axis=1)
    aiding = timeline.ranges if timeline.ranges is not None else timeline.fixes
    used = np.concatenate([series.used for series in solution.innovations]) if solution.innovations else np.ones(0)
    nis = compute_nis(solution.innovations)
    lasting = [(outage.end_ns - outage.start_ns) / 1e9 for outage in solution.outages or find_outages(solution)]
    warnings = sum(event.level == "warning" for event in solution.events)
    row: dict[str, Any] = {
        "verdict": result.verdict.grade,
        "start_utc": utc_text(solution.t_ns[:1])[0],
        "duration_s": (int(solution.t_ns[-1]) - int(solution.t_ns[0])) / 1e9,
        "distance_m": float(steps.sum()),
        "lat_deg": float(np.degrees(solution.lla[0, 0])),
        "lon_deg": float(np.degrees(solution.lla[0, 1])),
        "imu_hz": None if timeline.imu is None else _rate(timeline.imu.t_ns),
        "gnss_hz": None if aiding is None else _rate(np.unique(aiding.t_ns)),
        "gnss": "ranges" if timeline.ranges is not None else "fixes" if timeline.fixes is not None else "",
        "used_share": float(used.mean()) if len(used) else None,
        "position_nis": _mean(nis.get("position") or nis.get("range")),
        "std_horizontal_m": float(np.median(np.hypot(solution.std[:, 0], solution.std[:, 1]))),
        "outages": len(lasting),
        "outage_s": float(sum(lasting)),
        "longest_outage_s": max(lasting, default=None),
        "findings": sum(finding.level != "info" for finding in result.findings),
        "first_finding": next((f.text for f in result.findings if f.level != "info"), ""),
        "warnings": warnings,
        **_gaps(timeline.imu),
        **_errors(result),
    }
    row["attention"] = _attention(row)
    return {name: None if isinstance(value, float) and not np.isfinite(value) else value for name, value in row.items()}


def _errors(result: RunResult) -> dict[str, Any]:
    evaluation = result.evaluation
    if evaluation is None:
        return {}
    outside = evaluation.statistics.get("outside") or evaluation.statistics["all"]
    position = outside.get("position") or evaluation.statistics["all"]["position"]
    horizontal, down = position["horizontal"], position["down"]
    attitude = (evaluation.statistics.get("outside") or evaluation.statistics["all"]).get("attitude")
    ends = [one.end_horizontal for one in evaluation.outages if np.isfinite(one.end_horizontal)]
    return {
        "horizontal_rms_m": horizontal.rms,
        "horizontal_p95_m": horizontal.p95,
        "horizontal_max_m": horizontal.max,
        "height_rms_m": down.rms,
        "heading_rms_deg": None if attitude is None else float(np.degrees(attitude["heading"].rms)),
        "position_nees": _mean(evaluation.nees.get("position")),
        "outage_end_median_m": float(np.median(ends)) if ends else None,
    }


def _attention(row: dict[str, Any]) -> float:
    """The verdict (good 0, fair 1, poor 2), and within one verdict the horizontal error that 95 % keep, or without a reference
    the expected one, e / (1 m + e)."""
    error = row.get("horizontal_p95_m")
    error = row["std_horizontal_m"] if error is None or not np.isfinite(error) else error
    return _GRADES[row["verdict"]] + (error / (1.0 + error) if np.isfinite(error) else 1.0)


def _gaps(imu: ImuSeries | None) -> dict[str, Any]:
    if imu is None or len(imu.t_ns) < 2:
        return {}
    steps = np.diff(imu.t_ns)
    gaps = steps[steps > _GAP * np.median(steps)]
    return {"imu_gaps": len(gaps), "longest_imu_gap_s": float(gaps.max()) / 1e9 if len(gaps) else None}


def _mean(judged: Any) -> float | None:
    return None if judged is None else float(judged.mean)


def _rate(t_ns: np.ndarray) -> float | None:
    return None if len(t_ns) < 2 else round(1e9 / float(np.median(np.diff(t_ns))), 2)
