"""Standstill: when the IMU is as quiet and as steady, before and behind, as it is where fixes know the vehicle at rest.

A fixed threshold on inertial noise fits one sensor in one vehicle (Skog, Handel, Nilsson and Rantakokko, Zero-velocity
detection: an algorithm evaluation, IEEE Trans. Biomedical Engineering 57 (2010) 2657, compare four such detectors). A log that
is processed afterwards tells its own: the IMU's noise over the second before and the second behind, how its means change from
one to the other (a car that rolls off or brakes softly is quiet, but not steady) and how far its angular rate is from that of
other stops (so is one in a smooth bend), while fixes show rest and while they show motion. Where the two cannot be kept apart,
as with a smooth ride or a running engine, no standstill is claimed; nor is one where fixes around it know motion.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy import earth
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, Times

__all__ = ["Standstill", "find_standstills"]

_WINDOW_NS = 1_000_000_000
"""Over which the IMU's noise is judged."""
_FEWEST_SAMPLES = 5
_LEAST_SPREAD = 1e-9
"""Of a simulated sensor without noise."""
_LEAST_COVERED = 0.9
"""Of the samples that a second of standstill should hold."""
_AT_REST = 0.2
"""Horizontal speed [m/s] below which fixes are known at rest."""
_IN_MOTION = 0.5
"""Speed [m/s] above which they are known in motion."""
_SPEED_STD = 0.05
"""Of a speed that positions tell [m/s], at most."""
_LONGEST_S = 10.0
_LEAST_LEVER = 1e-6
"""Of five times against their mean, squared and summed up [s^2]: less is no time at all."""
_FEWEST = 20
"""Fixes of either sort without which nothing is decided."""
_LEAST_FOUND = 0.25
"""Share of the fixes at rest that the IMU must recognise, or it is not asked."""
_MOST_REST = 0.95
"""No louder is standstill than this share of the seconds known at rest."""
_LEAST_MOTION = 0.001
_MARGIN = 2.0
"""Nor louder than the quietest thousandth of the seconds known in motion over this ratio of variances."""


class Standstill(NamedTuple):
    """t_ns (k,): epochs a second or more within a stop. text: how that was decided, or why it was not."""

    t_ns: Times
    text: str


def find_standstills(imu: ImuSeries, fixes: GnssFixSeries, t_ns: Times) -> Standstill:
    """Those of the times t_ns (e,) with a second of standstill on either side, judged by the IMU; fixes calibrate the judgement
    and contradict it."""
    quietness, speed = _quietness(imu, fixes.t_ns), _speed(fixes)
    known = np.isfinite(quietness).all(axis=1)
    still, moving = known & (speed < _AT_REST), known & (speed > _IN_MOTION)
    none = np.empty(0, np.int64)
    if not np.isfinite(speed).any():
        text = "the fixes hold neither velocities nor positions precise enough to know rest from: standstill cannot be told"
        return Standstill(none, text)
    if min(still.sum(), moving.sum()) < _FEWEST:
        return Standstill(
            none, f"{still.sum()} fixes at rest and {moving.sum()} in motion: too few to tell standstill by the IMU"
        )
    scale = _Scale.of(quietness[still])
    rest, motion = scale.energy(quietness[still]), scale.energy(quietness[moving])
    limit = min(float(np.quantile(rest, _MOST_REST)), float(np.quantile(motion, _LEAST_MOTION)) / _MARGIN)
    found = float((rest < limit).mean())
    if found < _LEAST_FOUND:
        return Standstill(none, "the IMU is nearly as quiet in motion as at rest: standstill cannot be told by it")
    standing = t_ns[(scale.energy(_quietness(imu, t_ns)) < limit) & ~_seen_moving(t_ns, fixes.t_ns[speed > _IN_MOTION])]
    text = f"the IMU shows standstill at {len(standing)} of {len(t_ns)} epochs; of the fixes at rest it recognises {found:.0%}"
    return Standstill(standing, text)


class _Scale(NamedTuple):
    """rate (3,) [rad/s]: the gyro's mean at rest. unit (5,): medians at rest of what `energy` sums up."""

    rate: Floats
    unit: Floats

    @classmethod
    def of(cls, at_rest: Floats) -> "_Scale":
        """Of rows (k, 7) of `_quietness` at rest."""
        rate = np.median(at_rest[:, 4:], axis=0)
        return cls(rate, np.maximum(np.median(_sizes(at_rest, rate), axis=0), _LEAST_SPREAD))

    def energy(self, rows: Floats) -> Floats:
        """(k,) of rows (k, 7) of `_quietness`: 5 at the median of rest, infinite where unknown."""
        return np.nan_to_num((_sizes(rows, self.rate) / self.unit) ** 2, nan=np.inf).sum(axis=1)


def _sizes(rows: Floats, rate: Floats) -> Floats:
    """(k, 5) of rows (k, 7) of `_quietness`: the four sizes, and how far the mean angular rate is from rate (3,)."""
    return np.column_stack([rows[:, :4], np.linalg.norm(rows[:, 4:] - rate, axis=1)])


def _seen_moving(t_ns: Times, moving_ns: Times) -> NDArray[np.bool_]:
    """(e,) times within a second of which a fix knows motion."""
    ends = np.searchsorted(moving_ns, t_ns + _WINDOW_NS, side="right")
    return np.asarray(ends > np.searchsorted(moving_ns, t_ns - _WINDOW_NS))


def _speed(fixes: GnssFixSeries) -> Floats:
    """(k,) horizontal [m/s], the receiver's or that of precise positions; NaN where unknown, and where that of a neighbour says
    otherwise of rest or motion."""
    told = np.hypot(fixes.vel_n[:, 0], fixes.vel_n[:, 1])
    speed = np.where(fixes.has_velocity, told, _position_speed(fixes))
    rows = np.flatnonzero(np.isfinite(speed))
    if not len(rows):
        return speed
    around = _windows(speed[rows])
    agree = (around < _AT_REST).all(axis=1) | (around > _IN_MOTION).all(axis=1)
    sure = np.full_like(speed, np.nan)
    sure[rows[agree]] = speed[rows[agree]]
    return sure


def _position_speed(fixes: GnssFixSeries) -> Floats:
    """(k,) horizontal [m/s], slopes of five positions each by least squares; NaN where these are not told to be precise enough
    for it, or lie further apart than a few seconds."""
    t_s = (fixes.t_ns - fixes.t_ns[0]) / 1e9
    known = np.flatnonzero(fixes.has_position)
    way = np.full((len(fixes), 2), np.nan)
    way[known] = earth.ned_between(fixes.lla[known[:1]], fixes.lla[known])[:, :2]
    times = _windows(t_s)
    arms = times - times.mean(axis=1, keepdims=True)
    lever = np.maximum((arms**2).sum(axis=1), _LEAST_LEVER)
    slopes = np.stack([(arms * _windows(axis)).sum(axis=1) for axis in way.T]) / lever
    std = np.sqrt(np.trace(fixes.cov_pos[:, :2, :2], axis1=1, axis2=2) / 2 / lever)
    good = (std < _SPEED_STD) & (np.ptp(times, axis=1) < _LONGEST_S)
    return np.where(good, np.hypot(*slopes), np.nan)


def _windows(values: Floats) -> Floats:
    """(k, 5) each of values (k,) with two neighbours on either side, the ends repeated."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, 2, mode="edge"), 5)


def _quietness(imu: ImuSeries, t_ns: Times) -> Floats:
    """(k, 7) of the second before and that behind each time: larger standard deviation, over three axes together, of angular
    rate [rad/s] and of specific force [m/s^2]; change of the mean of either; mean angular rate of both seconds. NaN where the
    IMU does not cover them."""
    edges = [np.searchsorted(imu.t_ns, t_ns + shift, side="right") for shift in (-_WINDOW_NS, 0, _WINDOW_NS)]
    spreads, changes, means = [], [], []
    for samples in (imu.gyro, imu.accel):
        centre = samples.mean(axis=0)
        before, behind = (_moments(samples - centre, *pair) for pair in (edges[:2], edges[1:]))
        spreads.append(np.sqrt(np.maximum(before[1], behind[1])))
        changes.append(np.linalg.norm(behind[0] - before[0], axis=1))
        means.append((before[0] + behind[0]) / 2 + centre)
    expected = _WINDOW_NS / float(np.median(np.diff(imu.t_ns)))
    fewest = np.minimum(edges[1] - edges[0], edges[2] - edges[1])
    inside = (t_ns >= imu.t_ns[0] + _WINDOW_NS) & (t_ns <= imu.t_ns[-1] - _WINDOW_NS)
    whole = inside & (fewest >= max(_FEWEST_SAMPLES, _LEAST_COVERED * expected))
    return np.where(whole[:, None], np.column_stack([*spreads, *changes, means[0]]), np.nan)


def _moments(samples: Floats, starts: np.ndarray, ends: np.ndarray) -> tuple[Floats, Floats]:
    """Means (k, 3) of samples (n, 3) from starts to ends (k,), and their variances (k,), summed over the axes."""
    count = np.maximum(ends - starts, 1)[:, None].astype(np.float64)
    total, squares = _running_sum(samples), _running_sum(samples**2)
    mean = (total[ends] - total[starts]) / count
    variance = (squares[ends] - squares[starts]) / count - mean**2
    return mean, np.maximum(variance.sum(axis=1), 0.0)


def _running_sum(samples: Floats) -> Floats:
    """(n + 1, 3) sums of the first rows of samples (n, 3)."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(samples, axis=0)])
