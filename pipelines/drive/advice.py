"""The one setting most likely to help a run: settings tried on a stretch of it, judged by fixes that the filter did not see.

Of the stretch in which the measurements contradicted the filter most, the fixes of 10 s in every 30 s are withheld, and a
forward pass predicts them. A setting is told only where its predictions are clearly closer. The stretch is as long as all
trials together may take: about the run itself, at least 90 s each.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from navreplay.evaluation.metrics import interpolate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.earth import move_lla, ned_between
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.options import GRADES
from navreplay.solution import Solution
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, LogError, Timeline, Times
from pipelines.config.spec import Config, apply_sets, validate
from pipelines.drive.estimated import estimated_config
from pipelines.drive.set_up import options_of
from pipelines.drive.time_offset import shift_imu

__all__ = ["Advice", "advise"]

_SHORTEST_S, _LONGEST_S = 90.0, 180.0
_PERIOD_NS, _HELD_NS = 30_000_000_000, 10_000_000_000
_LEAST_HELD = 20
_SHARE = 68
"""Percentile of the distances that is compared: a few outliers among the fixes do not move it."""
_BETTER = 0.85
_OFFSETS_S = (-0.2, -0.1, 0.1, 0.2)
_LEVER_M = 0.1
"""A lever arm that the fixes show is tried from this length on."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What trying found. setting: KEY=VALUE of the best one, empty where none was clearly better. told, found: 68 % of the
    withheld fixes lay within this horizontal distance [m] of what was predicted, as configured and with the setting. tried:
    number of settings; seconds: length of the stretch; held: fixes withheld in it."""

    setting: str
    told: float
    found: float
    tried: int
    seconds: float
    held: int


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A setting as typed, and what it is beside a change of the configuration: a shift of the IMU's stamps [s], a lever arm."""

    setting: str
    shift_s: float = 0.0
    lever_b: tuple[float, float, float] | None = None


def advise(timeline: Timeline, config: Config, forward: float, solution: Solution) -> Advice | None:
    """What would have helped. timeline: what the filter saw. forward: see `options_of`. solution: of the IMU. None where
    nothing can be tried: without IMU or fixes, by ranges, or where the stretch is too short."""
    if timeline.imu is None or timeline.fixes is None or timeline.ranges is not None:
        return None
    if solution.estimated:
        config = estimated_config(config, solution)  # what the run was made with, to begin from
    candidates = tuple(_candidates(timeline, config, solution))
    stretch = _worst_stretch(timeline, solution, len(candidates) + 1)
    if stretch is None:
        return None
    trial = _Trial(stretch, config, forward)
    told = trial.distance(_Candidate(""))
    if not np.isfinite(told):
        return None
    distances = [trial.distance(candidate) for candidate in candidates]
    best = int(np.argmin(distances))
    better = distances[best] < _BETTER * told
    setting = candidates[best].setting if better else ""
    return Advice(setting, told, distances[best], len(candidates), trial.seconds, trial.held)


def _candidates(timeline: Timeline, config: Config, solution: Solution) -> Iterator[_Candidate]:
    assert timeline.fixes is not None
    gnss = config.gnss
    for factor in (0.3, 3.0, 10.0):
        yield _Candidate(f"gnss.position_noise_scale={gnss.position_noise_scale * factor:.3g}")
    if np.isfinite(timeline.fixes.vel_n).any() and config.filter.use_velocity:
        yield _Candidate(f"gnss.velocity_noise_scale={gnss.velocity_noise_scale * 3:.3g}")
        yield _Candidate(f"gnss.velocity_std_floor_mps={max(0.1, 3 * gnss.velocity_std_floor_mps):.3g}")
        yield _Candidate("filter.use_velocity=false")
    yield from (_Candidate(f"imu.grade={grade}") for grade in _neighbours(config.imu.grade))
    if not config.vehicle.options().zero_velocity:
        yield _Candidate("vehicle.zero_velocity=true")
    if config.vehicle.kind == "unknown":
        yield _Candidate("vehicle.kind=car")
    for shift in _OFFSETS_S:
        yield _Candidate(f"input.imu.time_offset_s={config.input.imu.time_offset_s + shift:+.3g}", shift)
    lever = timeline.fix_lever_b + _arm_left(timeline, solution)
    if np.linalg.norm(lever - timeline.fix_lever_b) > _LEVER_M:
        parts = tuple(round(part, 2) for part in lever.tolist())
        yield _Candidate(f"input.fix.lever_arm_m={list(parts)}", lever_b=parts)


def _neighbours(grade: str) -> tuple[str, ...]:
    grades = tuple(GRADES)
    at = grades.index(grade)
    return grades[max(at - 1, 0) : at] + grades[at + 1 : at + 2]


def _antenna(solution: Solution, t_ns: Times, lever_b: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """Where the solution is valid, positions (k, 3) of the antenna, and C_nb (k, 3, 3)."""
    at = interpolate(solution, t_ns, max_step_s=inf)
    turn = matrix_from_quat(at.q_nb)
    return at.valid, move_lla(at.lla, turn @ lever_b), turn


def _arm_left(timeline: Timeline, solution: Solution) -> Floats:
    """(3,) [m] by which the fixes lie off the antenna on the mean, in body axes; a drive to all sides keeps nothing else."""
    fixes = timeline.fixes
    assert fixes is not None
    valid, antenna, turn = _antenna(solution, fixes.t_ns, timeline.fix_lever_b)
    good = valid & fixes.has_position
    if not good.any():
        return np.zeros(3)
    off = ned_between(antenna[good], fixes.lla[good])
    return np.asarray(np.median(np.einsum("kji,kj->ki", turn[good], off), axis=0))


def _worst_stretch(timeline: Timeline, solution: Solution, trials: int) -> Timeline | None:
    """The stretch whose innovations are the largest, faults capped; None where the log is shorter than any."""
    imu = timeline.imu
    assert imu is not None
    span_s = float(imu.t_ns[-1] - imu.t_ns[0]) / 1e9
    length_ns = round(min(max(span_s / trials, _SHORTEST_S), _LONGEST_S, span_s) * 1e9)
    starts = np.arange(imu.t_ns[0], imu.t_ns[-1] - length_ns + 1, max(length_ns // 4, 1))
    trouble = [_trouble(solution, int(start), int(start) + length_ns) for start in starts]
    start = int(starts[int(np.argmax(trouble))]) if len(starts) else int(imu.t_ns[0])
    return _cut(timeline, start, start + length_ns)


def _trouble(solution: Solution, start_ns: int, end_ns: int) -> float:
    """Mean normalised square per component of the innovations in a stretch, each counted up to 25."""
    squares = [
        np.minimum(np.square(series.residual / series.std)[(series.t_ns >= start_ns) & (series.t_ns < end_ns)], 25).ravel()
        for series in solution.innovations
    ]
    known = np.concatenate(squares) if squares else np.empty(0)
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else 0.0


def _cut(timeline: Timeline, start_ns: int, end_ns: int) -> Timeline | None:
    imu, fixes = timeline.imu, timeline.fixes
    assert imu is not None
    assert fixes is not None
    inside = (imu.t_ns >= start_ns) & (imu.t_ns <= end_ns)
    rows = (fixes.t_ns >= start_ns) & (fixes.t_ns <= end_ns)
    if inside.sum() < 2 or (rows & fixes.has_position).sum() < 2 * _LEAST_HELD:
        return None
    cut = ImuSeries(imu.t_ns[inside], imu.gyro[inside], imu.accel[inside], imu.increments)
    return replace(timeline, imu=cut, fixes=_take(fixes, rows), attitude=timeline.attitude, reference=None)


def _take(fixes: GnssFixSeries, rows: NDArray[np.bool_]) -> GnssFixSeries:
    parts = fixes.t_ns, fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel, fixes.status
    return GnssFixSeries(*(part[rows] for part in parts))


class _Trial:
    """A stretch of which a third of the fixes is withheld, and how well they are predicted with a setting."""

    def __init__(self, stretch: Timeline, config: Config, forward: float) -> None:
        imu, fixes = stretch.imu, stretch.fixes
        assert imu is not None
        assert fixes is not None
        self.seconds = float(imu.t_ns[-1] - imu.t_ns[0]) / 1e9
        away = (fixes.t_ns - imu.t_ns[0]) % _PERIOD_NS >= _PERIOD_NS - _HELD_NS
        self._held = _take(fixes, away & fixes.has_position) if (away & fixes.has_position).any() else None
        self._stretch = replace(stretch, fixes=_take(fixes, ~away)) if (~away & fixes.has_position).any() else stretch
        self.held = 0 if self._held is None else len(self._held)
        self._config, self._forward = config, forward
        self._method = build_method("fixed")

    def distance(self, candidate: _Candidate) -> float:
        """68 % of the withheld fixes lie within it [m]; infinite where the filter cannot run."""
        if self.held < _LEAST_HELD:
            return inf
        config = self._config
        if candidate.setting and candidate.lever_b is None and not candidate.shift_s:
            config = validate(apply_sets(config.model_dump(mode="json", exclude_none=True), [candidate.setting]), "advice")
        timeline = shift_imu(self._stretch, candidate.shift_s)
        if candidate.lever_b is not None:
            timeline = replace(timeline, fix_lever_b=np.array(candidate.lever_b))
        options = replace(options_of(config, self._forward), output_rate=2.0, smooth=False)
        try:
            solution = run_filter(timeline, self._method, options)
            return self._distance(solution, timeline.fix_lever_b)
        except LogError:
            return inf

    def _distance(self, solution: Solution, lever_b: Floats) -> float:
        assert self._held is not None
        valid, antenna, _ = _antenna(solution, self._held.t_ns, lever_b)
        if valid.sum() < self.held / 2:
            return inf
        off = ned_between(antenna[valid], self._held.lla[valid])
        return float(np.percentile(np.linalg.norm(off[:, :2], axis=1), _SHARE))
