"""Comparing the motion an IMU feels with the motion a GNSS receiver sees: time offset, sign and unit of the yaw rate, forward
axis. All of it needs a drive with turns or changes of speed; without them the functions return None."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import wrap_angle
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, Times

__all__ = ["ForwardMatch", "YawMatch", "match_forward", "match_yaw"]

_GRID_S = 0.02
_LONGEST_S = 172_800.0
_LONGEST_LAG_S = 25.0
_SHORT_LAG_S = 3.0
_MIN_SPEED = 2.0
_MIN_INTERVALS = 30
_MIN_TURNING = 0.02
_MIN_ACCELERATION = 0.2
_MOST_INTERVALS = 3000
_SHORTEST_INTERVAL_NS = 10**9
_JITTER_NS = 5 * 10**7
_LONGEST_INTERVAL_S = 2.5
_FARTHER_S = (2.0, 4.0)
_CLEAR = 0.6
_FASTEST_TURN = 1.0
_OUTLIER = 5.0
_AMBIGUOUS = 0.1
"""Of correlation that a lag may lack and still be as good as another."""
_HARDEST_BRAKING = 12.0


@dataclass(frozen=True, slots=True)
class YawMatch:
    """offset_s: to be added to the IMU's stamps to agree with GNSS; std_s: its standard deviation as the noise has it. On top
    come the receiver's own delay, and d / speed where the antenna is d behind the IMU: together about 0.1 s. correlation: of
    course rate with yaw rate there, -1 to 1. slope: course rate per yaw rate."""

    offset_s: float
    std_s: float
    correlation: float
    slope: float


@dataclass(frozen=True, slots=True)
class ForwardMatch:
    """angle: from the body's x axis, positive to the right, to where accelerations of the vehicle show [rad].
    correlation: of these with the changes of GNSS speed."""

    angle: float
    correlation: float


@dataclass(frozen=True, eq=False, slots=True)
class _Motion:
    """Intervals between fixes: start_s, end_s (k,) since the first IMU sample, course rate [rad/s] and forward acceleration."""

    start_s: Floats
    end_s: Floats
    course_rate: Floats
    acceleration: Floats


def match_yaw(imu: ImuSeries, fixes: GnssFixSeries) -> YawMatch | None:
    """Correlates the yaw rate (about the vertical, whatever way the IMU is mounted) with the course rate over all time
    offsets up to 25 s, or up to 3 s where the log is short."""
    turn = _grid_integral(imu, imu.gyro @ -_up(imu))
    best = _match(_gnss_motion(imu, fixes), turn)
    if fixes.has_velocity.sum() >= _MIN_INTERVALS:
        return best
    for every_s in _FARTHER_S:  # the course of positions near each other is mostly noise
        if best is not None and abs(best.correlation) >= _CLEAR:
            break
        other = _match(_gnss_motion(imu, fixes, every_s), turn)
        if other is not None and (best is None or abs(other.correlation) > abs(best.correlation)):
            best = other
    return best


def _match(motion: _Motion, turn: Floats) -> YawMatch | None:
    for limit in (_LONGEST_LAG_S, _SHORT_LAG_S):
        inside = (motion.start_s > limit) & (motion.end_s < (len(turn) - 1) * _GRID_S - limit)
        rate = motion.course_rate[inside]
        if inside.sum() >= _MIN_INTERVALS and np.sqrt(np.mean(rate**2)) >= _MIN_TURNING:
            return _best_lag(turn, motion.start_s[inside], motion.end_s[inside], rate, limit)
    return None


def match_forward(imu: ImuSeries, fixes: GnssFixSeries, offset_s: float) -> ForwardMatch | None:
    """The direction in the body's x-y plane in which changes of GNSS speed are felt."""
    motion = _gnss_motion(imu, fixes)
    sums = np.column_stack([_grid_integral(imu, imu.accel[:, axis]) for axis in (0, 1)])
    inside = (motion.start_s - offset_s > 0) & (motion.end_s - offset_s < (len(sums) - 1) * _GRID_S)
    wanted = motion.acceleration[inside]
    if inside.sum() < _MIN_INTERVALS or np.sqrt(np.mean(wanted**2)) < _MIN_ACCELERATION:
        return None
    felt = np.column_stack([_mean_rate(sums[:, axis], motion.start_s[inside] - offset_s, motion.end_s[inside] - offset_s)
                            for axis in (0, 1)])  # fmt: skip
    felt, wanted = felt - felt.mean(axis=0), wanted - wanted.mean()
    gain = felt.T @ wanted / (wanted @ wanted)
    along = felt @ gain / np.linalg.norm(gain)
    return ForwardMatch(float(np.arctan2(gain[1], gain[0])), float(np.corrcoef(along, wanted)[0, 1]))


def _up(imu: ImuSeries) -> Floats:
    """Unit vector of the usual specific force, which points up."""
    force = np.median(imu.accel, axis=0)
    return np.asarray(force / max(float(np.linalg.norm(force)), 1e-9))


def _grid_integral(imu: ImuSeries, signal: Floats) -> Floats:
    """Integral of a signal (n,) over time, on an even grid from the first sample on; not beyond two days, for one wrong
    stamp may lie years ahead."""
    seconds = (imu.t_ns - imu.t_ns[0]) / 1e9
    steps = np.diff(seconds) * (signal[1:] if imu.increments else (signal[1:] + signal[:-1]) / 2)
    total = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(np.interp(np.arange(0.0, min(seconds[-1], _LONGEST_S) + _GRID_S, _GRID_S), seconds, total))


def _gnss_motion(imu: ImuSeries, fixes: GnssFixSeries, every_s: float = 0.0) -> _Motion:
    """Course and speed of consecutive fixes; from the positions where the log holds no velocities, at least every_s apart."""
    if fixes.has_velocity.sum() >= _MIN_INTERVALS:
        t_ns, vel = fixes.t_ns[fixes.has_velocity], fixes.vel_n[fixes.has_velocity]
    else:
        t_ns, lla = fixes.t_ns[fixes.has_position], fixes.lla[fixes.has_position]
        apart = _thin(t_ns, round(every_s * 1e9)) if every_s else slice(None)
        t_ns, lla = t_ns[apart], lla[apart]
        step = np.diff(t_ns)[:, None] / 1e9
        vel = ned_between(lla[:-1], lla[1:]) / step
        t_ns = (t_ns[:-1] + t_ns[1:]) // 2
    chosen = _thin(t_ns, _SHORTEST_INTERVAL_NS)
    seconds, vel = (t_ns[chosen] - imu.t_ns[0]) / 1e9, vel[chosen]
    speed, course = np.hypot(vel[:, 0], vel[:, 1]), np.arctan2(vel[:, 1], vel[:, 0])
    length = np.diff(seconds)
    rate, acceleration = wrap_angle(np.diff(course)) / length, np.diff(speed) / length
    fast = (np.minimum(speed[:-1], speed[1:]) > _MIN_SPEED) & (length < max(_LONGEST_INTERVAL_S, 1.5 * every_s))
    sane = (np.abs(rate) < _FASTEST_TURN) & (np.abs(acceleration) < _HARDEST_BRAKING)
    chosen = np.flatnonzero(fast & sane)
    if len(chosen) > _MOST_INTERVALS:
        chosen = chosen[np.sort(np.argsort(-np.abs(rate[chosen]))[:_MOST_INTERVALS])]
    return _Motion(seconds[:-1][chosen], seconds[1:][chosen], rate[chosen], acceleration[chosen])


def _thin(t_ns: Times, interval_ns: int) -> NDArray[np.intp]:
    """Indices of the first time in every interval: differences over shorter ones are mostly noise."""
    if len(t_ns) == 0:
        return np.empty(0, dtype=np.intp)
    return np.unique((t_ns - t_ns[0] + _JITTER_NS) // interval_ns, return_index=True)[1]


def _mean_rate(total: Floats, start_s: Floats, end_s: Floats) -> Floats:
    """Mean of a signal over intervals, from its integral on the grid."""
    return np.asarray((_at(total, end_s / _GRID_S) - _at(total, start_s / _GRID_S)) / (end_s - start_s))


def _at(total: Floats, place: Floats) -> Floats:
    """Values between those of a grid, at places (k,) counted in its steps; held beyond its ends."""
    below = np.clip(np.floor(place), 0, max(len(total) - 2, 0)).astype(np.intp)
    above = np.minimum(below + 1, len(total) - 1)
    return np.asarray(total[below] + np.clip(place - below, 0.0, 1.0) * (total[above] - total[below]))


def _best_lag(turn: Floats, start_s: Floats, end_s: Floats, rate: Floats, limit: float) -> YawMatch:
    """Coarse search, then a fine one without the intervals whose course the receiver evidently had wrong."""
    best = _coarse_lag(turn, start_s, end_s, rate, limit)
    _, slope = _fit(_mean_rate(turn, start_s - best, end_s - best), rate)
    misfit = rate - slope * _mean_rate(turn, start_s - best, end_s - best)
    misfit = np.abs(misfit - np.median(misfit))
    good = misfit < _OUTLIER * 1.4826 * np.median(misfit) + 1e-9
    start_s, end_s, rate = start_s[good], end_s[good], rate[good]
    best = _search(turn, start_s, end_s, rate, np.arange(best - 0.4, best + 0.401, 0.02))
    felt = _mean_rate(turn, start_s - best, end_s - best)
    change = (_mean_rate(turn, start_s - best + 0.1, end_s - best + 0.1) - felt) / 0.1
    r, slope = _fit(felt, rate)
    std = float(np.std(rate - slope * felt)) / max(abs(slope) * float(np.sqrt(np.sum(change**2))), 1e-12)
    return YawMatch(best, std, r, slope)


def _coarse_lag(turn: Floats, start_s: Floats, end_s: Floats, rate: Floats, limit: float) -> float:
    """The lag of greatest correlation; a near one where a far one explains hardly more: laps repeat themselves, and a lag of a
    lap is no evidence of an offset."""
    far = _search(turn, start_s, end_s, rate, np.arange(-limit, limit + 0.1, 0.2))
    if abs(far) <= _SHORT_LAG_S:
        return far
    near = _search(turn, start_s, end_s, rate, np.arange(-_SHORT_LAG_S, _SHORT_LAG_S + 0.1, 0.2))
    at_far, at_near = (_fit(_mean_rate(turn, start_s - lag, end_s - lag), rate)[0] for lag in (far, near))
    same_way = at_far * at_near > 0
    return near if same_way and 1 - abs(at_near) < max(_AMBIGUOUS, 3 * (1 - abs(at_far))) else far


def _search(turn: Floats, start_s: Floats, end_s: Floats, rate: Floats, lags: Floats) -> float:
    fits = [abs(_fit(_mean_rate(turn, start_s - lag, end_s - lag), rate)[0]) for lag in lags]
    return float(lags[int(np.argmax(fits))])


def _fit(felt: Floats, rate: Floats) -> tuple[float, float]:
    """Correlation, and slope of rate over felt; zeros where either stands still."""
    felt, rate = felt - felt.mean(), rate - rate.mean()
    power = float(felt @ felt)
    if power == 0 or not rate.any():
        return 0.0, 0.0
    product = float(felt @ rate)
    return product / float(np.sqrt(power * float(rate @ rate))), product / power
