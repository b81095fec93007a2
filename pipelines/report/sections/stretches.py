"""What to look at first: the worst stretches of a run with what is known of their cause, and the shares by quality."""

import numpy as np

from navreplay.timeline import Floats
from pipelines.drive.result import RunResult
from pipelines.report.content import outage_errors
from pipelines.report.sections.grades import GRADES, grade_of
from pipelines.report.table import Table, figure_text
from pipelines.trajectory.solution_csv import utc_text

__all__ = ["stretch_tables"]

_MOST = 5
_HALF_S = 10.0
"""Around the worst point [s]: what belongs to one stretch."""


def stretch_tables(result: RunResult) -> tuple[Table, Table]:
    """The five worst stretches, by measured horizontal error or, without a reference, by sigma; and shares by grade."""
    return _worst_table(result), _grade_table(result)


def _sizes(result: RunResult) -> tuple[Floats, Floats]:
    """Horizontal errors (k,), NaN without a reference there, and sigmas (k,) of the rows [m]."""
    solution, evaluation = result.solution, result.evaluation
    sigma = np.hypot(solution.std[:, 0], solution.std[:, 1])
    if evaluation is None:
        return np.full(len(solution), np.nan), sigma
    error = evaluation.errors["position"].error
    return np.interp(solution.t_ns, evaluation.t_ns, np.hypot(error[:, 0], error[:, 1]), np.nan, np.nan), sigma


def _worst_table(result: RunResult) -> Table:
    error, sigma = _sizes(result)
    size = error if np.isfinite(error).any() else sigma
    t = (result.solution.t_ns - result.solution.t_ns[0]) / 1e9
    left = np.where(np.isfinite(size), size, -np.inf)
    rows, spans = [], []
    while len(rows) < _MOST and left.max() > -np.inf:
        worst = int(np.argmax(left))
        low, high = max(float(t[worst]) - _HALF_S, 0.0), min(float(t[worst]) + _HALF_S, float(t[-1]))
        left[(t >= low - _HALF_S) & (t <= high + _HALF_S)] = -np.inf
        utc = utc_text(result.solution.t_ns[worst : worst + 1])[0].partition("T")[2][:10]
        known = float(error[worst]) if np.isfinite(error[worst]) else None
        rows.append((utc, figure_text(known, "m"), figure_text(float(sigma[worst]), "m"), _reason(result, worst, low, high)))
        spans.append((low, high))
    by = "measured error" if size is error else "sigma"
    header = ("UTC", "horizontal error", "sigma", "what is known there")
    return Table("What to look at first", header, tuple(rows), f"Worst by {by}, at least 20 s apart.", tuple(spans))


def _reason(result: RunResult, worst: int, low: float, high: float) -> str:
    solution = result.solution
    start, end = (int(solution.t_ns[0]) + round(edge * 1e9) for edge in (low, high))
    reasons = [
        f"stretch of {one.length_s:.0f} s without positions ({one.outage.cause})"
        for one in outage_errors(result)
        if one.outage.start_ns <= solution.t_ns[worst] <= one.outage.end_ns
    ]
    for series in solution.innovations:
        inside = (series.t_ns >= start) & (series.t_ns <= end)
        refused = int((inside & ~series.used).sum())
        if refused:
            reasons.append(f"{refused} of {int(inside.sum())} {series.kind.replace('_', ' ')} measurements rejected")
    reasons += [event.text for event in solution.events if event.level == "warning" and start <= event.t_ns <= end][:1]
    if solution.t_ns[worst] - solution.t_ns[0] < 60_000_000_000:
        reasons.append("within the first minute, while attitude and biases settle")
    error, sigma = (float(values[worst]) for values in _sizes(result))
    if error > 3 * sigma:
        reasons.append(f"error is {error / max(sigma, 1e-9):.1f} times sigma: the covariance does not tell it")
    return "; ".join(reasons) or "nothing unusual: no outage, rejection or warning"


def _grade_table(result: RunResult) -> Table:
    by_error, by_sigma = (grade_of(size) for size in _sizes(result))
    rows = []
    for grade, name in enumerate(GRADES, start=1):
        rows.append((name, _share(by_sigma, grade), _share(by_error, grade)))
    note = "Share of the rows of the solution by horizontal size; by error where the reference knows."
    return Table("Quality grades", ("grade", "by sigma", "by measured error"), tuple(rows), note)


def _share(grades: Floats, grade: int) -> str:
    known = grades[np.isfinite(grades)]
    return f"{100 * float(np.mean(known == grade)):.1f} %" if len(known) else "–"
