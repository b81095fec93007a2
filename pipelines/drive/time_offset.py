"""The time offset between IMU and fixes: proposed by the motion that both saw, and tried by the filter before it is believed.

A proposal by turns is off by the receiver's own delay and by where the antenna sits (about 0.1 s), so it is only where the
search begins. What counts is how well the filter then predicts its measurements, on stretches that hold the most motion.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import YawMatch
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.solution import Solution
from navreplay.timeline import GnssFixSeries, ImuSeries, LogError, Timeline

__all__ = ["settle_time_offset", "shift_imu"]

_SURE = 0.6
_DOUBTFUL_S = 0.08
_FARTHEST_S = 3.0
_STRETCH_S = 150.0
_STEP_S = 0.08
_FINEST_S = 0.005
_BETTER = 0.9
"""Of the misfit without an offset: a better one must stay below this share of it."""
_REFUTED = 2.5
"""Misfit that refutes the told noise as well."""
_FLOOR_M = 0.5
_CAP = 25.0
"""Of a normalised square: what an outlier counts at most."""


def settle_time_offset(timeline: Timeline, match: YawMatch, options: FilterOptions) -> tuple[Timeline, tuple[Finding, ...]]:
    """The timeline with the IMU's stamps moved to those of the fixes, where there is a doubt and trying bears it out. match: of
    the turns that both saw."""
    if abs(match.correlation) < _SURE or not _DOUBTFUL_S < abs(match.offset_s) < _FARTHEST_S:
        return timeline, ()
    trial = _Trial(timeline, options)
    untouched = trial.misfit(0.0)
    offset, misfit = _search(trial, match.offset_s)
    if untouched > _REFUTED and not misfit < _BETTER * untouched:  # too sure by far: as all innovations are capped, none tells
        trial = _Trial(_with_floor(timeline), options)
        untouched = trial.misfit(0.0)
        offset, misfit = _search(trial, match.offset_s)
    if not misfit < _BETTER * untouched or abs(offset) < _DOUBTFUL_S / 2:
        return timeline, ()
    text = (
        f"The IMU's stamps are {abs(offset):.2f} s {'late' if offset < 0 else 'early'} against those of the fixes: so "
        f"moved, the "
        f"filter predicts its measurements better (mean square of the normalised innovations {misfit:.2f} instead of "
        f"{untouched:.2f}, tried on {trial.seconds:.0f} s)."
    )
    hint = f"They are moved for this run; set input.imu.time_offset_s = {offset:+.3f} (on top of any you have set) to keep it."
    return shift_imu(timeline, offset), (Finding("warning", "time-offset", text, hint),)


def shift_imu(timeline: Timeline, offset_s: float) -> Timeline:
    """The timeline with offset_s [s] added to the IMU's stamps."""
    assert timeline.imu is not None
    return replace(timeline, imu=replace(timeline.imu, t_ns=timeline.imu.t_ns + round(offset_s * 1e9)))


def _with_floor(timeline: Timeline) -> Timeline:
    """The timeline with positions told no better than half a metre, as stamps that jitter make them."""
    assert timeline.fixes is not None
    cov_pos = timeline.fixes.cov_pos + _FLOOR_M**2 * np.eye(3)
    return replace(timeline, fixes=replace(timeline.fixes, cov_pos=cov_pos))


class _Trial:
    """The filter on the stretch of a timeline with the most motion, at one offset after the other."""

    def __init__(self, timeline: Timeline, options: FilterOptions) -> None:
        self._timeline = _liveliest(timeline)
        self._options = replace(options, output_rate=0.0, smooth=False)
        self._method = build_method("fixed")
        assert self._timeline.imu is not None
        self.seconds = float(self._timeline.imu.t_ns[-1] - self._timeline.imu.t_ns[0]) / 1e9
        self._known: dict[float, float] = {}

    def misfit(self, offset_s: float) -> float:
        """Mean normalised square per component of all innovations, faults capped; infinite where the filter cannot run."""
        key = round(offset_s, 4)
        if key not in self._known:
            try:
                self._known[key] = _misfit(run_filter(shift_imu(self._timeline, key), self._method, self._options))
            except LogError:
                self._known[key] = float("inf")
        return self._known[key]


def _misfit(solution: Solution) -> float:
    squares = [np.minimum(np.square(series.residual / series.std), _CAP).ravel() for series in solution.innovations]
    return float(np.concatenate(squares).mean()) if squares else float("inf")


def _search(trial: _Trial, proposal: float) -> tuple[float, float]:
    """The best offset near the proposal and near zero, and its misfit."""
    best = min(_around(proposal, _STEP_S), key=trial.misfit)
    step = _STEP_S / 2
    while step >= _FINEST_S:
        best = min((best - step, best, best + step), key=trial.misfit)
        step /= 2
    return best, trial.misfit(best)


def _around(proposal: float, step: float) -> Iterable[float]:
    return [proposal + k * step for k in (-2, -1, 0, 1, 2)]


def _liveliest(timeline: Timeline) -> Timeline:
    """The stretch in which the IMU turns most, from its beginning where the log is short."""
    imu, fixes = timeline.imu, timeline.fixes
    assert imu is not None
    assert fixes is not None
    seconds = (imu.t_ns - imu.t_ns[0]) / 1e9
    if seconds[-1] <= _STRETCH_S:
        return timeline
    turned = np.concatenate([[0.0], np.cumsum(np.linalg.norm(imu.gyro[1:], axis=1) * np.diff(seconds))])
    starts = np.arange(0.0, seconds[-1] - _STRETCH_S, _STRETCH_S / 5)
    gained = np.interp(starts + _STRETCH_S, seconds, turned) - np.interp(starts, seconds, turned)
    start = float(starts[int(np.argmax(gained))])
    inside = (seconds >= start) & (seconds < start + _STRETCH_S)
    begin, end = int(imu.t_ns[inside][0]), int(imu.t_ns[inside][-1])
    margin = round(_FARTHEST_S * 1e9)
    rows = (fixes.t_ns >= begin - margin) & (fixes.t_ns <= end + margin)
    parts = fixes.t_ns, fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel, fixes.status
    if not (rows & fixes.has_position).any():
        return timeline
    return replace(
        timeline,
        imu=ImuSeries(imu.t_ns[inside], imu.gyro[inside], imu.accel[inside], imu.increments),
        fixes=GnssFixSeries(*(part[rows] for part in parts)),
        reference=None,
    )
