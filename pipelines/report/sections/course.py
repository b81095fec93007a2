"""The tracks of runs for a map: courses over time, and what they can be coloured by."""

from collections.abc import Mapping, Sequence

import numpy as np

from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.solution import Solution
from navreplay.timeline import FixStatus, Floats, Timeline
from pipelines.drive.result import RunResult
from pipelines.plotting.live import Clock
from pipelines.plotting.track import Course, Shading, Track, thin_course
from pipelines.report.sections.grades import GRADES, grade_of

__all__ = ["clock_of", "track_of"]


def clock_of(results: Sequence[RunResult]) -> Clock:
    """From the first row of any of the runs to the last row of any."""
    start = min(int(result.solution.t_ns[0]) for result in results)
    end = max(int(result.solution.t_ns[-1]) for result in results)
    return Clock(float(np.asarray(utc_from_gps(np.array([start])))[0] / 1e6), (end - start) / 1e9)


def track_of(results: Sequence[RunResult], names: Sequence[str], styles: Sequence[str]) -> Track:
    """The reference, the fixes and the rejected ones of the first run, and the solution of each, about the first position."""
    first = results[0]
    origin = first.solution.lla[0]
    start = min(int(result.solution.t_ns[0]) for result in results)
    courses = [*_reference_course(first, origin, start), *_fix_courses(first, origin, start)]
    for result, name, style in zip(results, names, styles, strict=True):
        courses.append(_solution_course(result, origin, start, name, style))
    lat, lon = np.degrees(origin[:2]).tolist()
    return Track(lat, lon, tuple(courses))


def _reference_course(result: RunResult, origin: Floats, start: int) -> list[Course]:
    reference, rows = result.timeline.reference, result.solution.t_ns
    if reference is None:
        return []
    at = (reference.t_ns >= rows[0]) & (reference.t_ns <= rows[-1])
    t, where = (reference.t_ns[at] - start) / 1e9, ned_between(origin, reference.lla[at])
    kept = thin_course(t, where[:, 1], where[:, 0])
    return [Course("line", t[kept], where[kept, 1], where[kept, 0], "reference", "reference")]


def _fix_courses(result: RunResult, origin: Floats, start: int) -> list[Course]:
    timeline: Timeline = result.timeline
    fixes = timeline.fixes
    if fixes is None:
        return []
    where, t = ned_between(origin, fixes.lla), (fixes.t_ns - start) / 1e9
    courses = []
    for status in FixStatus:
        rows = np.flatnonzero(fixes.has_position & (fixes.status == status))
        kept = rows[thin_course(t[rows], where[rows, 1], where[rows, 0])]
        name = f"{status.name.lower().replace('_', ' ')} fix"
        courses.append(Course("dots", t[kept], where[kept, 1], where[kept, 0], f"fix{int(status)}", name))
    refused = [series.t_ns[~series.used] for series in result.solution.innovations if series.kind == "position"]
    rows = np.flatnonzero(np.isin(fixes.t_ns, np.concatenate([np.zeros(0, np.int64), *refused])) & fixes.has_position)
    courses.append(Course("crosses", t[rows], where[rows, 1], where[rows, 0], "bad", "rejected fix"))
    return [course for course in courses if len(course.t_s)]


def _solution_course(result: RunResult, origin: Floats, start: int, name: str, style: str) -> Course:
    solution = result.solution
    where, t = ned_between(origin, solution.lla), (solution.t_ns - start) / 1e9
    shades = _shadings(result, solution)
    kept = thin_course(t, where[:, 1], where[:, 0], next(iter(shades.values())).values)
    thin = {key: Shading(shade.values[kept], shade.unit, shade.classes) for key, shade in shades.items()}
    return Course("line", t[kept], where[kept, 1], where[kept, 0], style, name, thin)


def _shadings(result: RunResult, solution: Solution) -> Mapping[str, Shading]:
    sigma = np.hypot(solution.std[:, 0], solution.std[:, 1])
    shades = {}
    if result.evaluation is not None:
        error = result.evaluation.errors["position"].error
        at = np.interp(solution.t_ns, result.evaluation.t_ns, np.hypot(error[:, 0], error[:, 1]), np.nan, np.nan)
        shades["error"] = Shading(at, "m")
        shades["quality by error"] = Shading(grade_of(at), "", GRADES)
    shades["sigma"] = Shading(sigma, "m")
    shades["quality by sigma"] = Shading(grade_of(sigma), "", GRADES)
    shades["speed"] = Shading(np.linalg.norm(solution.vel_n, axis=1), "m/s")
    return shades
