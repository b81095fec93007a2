"""Standstill: when the IMU is as quiet as it is where fixes know the vehicle at rest.

A fixed threshold on inertial noise fits one sensor in one vehicle (Skog, Handel, Nilsson and Rantakokko, Zero-velocity
detection: an algorithm evaluation, IEEE Trans. Biomedical Engineering 57 (2010) 2657, compare four such detectors). A log that
is processed afterwards tells its own: the energy of the IMU's noise over a second, while fixes show rest and while they show
motion. Where the two cannot be kept apart, as with a smooth ride or a running engine, no standstill is claimed.
"""

from typing import NamedTuple

import numpy as np

from navreplay.geodesy import earth
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, Times

__all__ = ["Standstill", "find_standstills"]

_WINDOW_NS = 1_000_000_000
"""Over which the IMU's noise is judged."""
_FEWEST_SAMPLES = 5
_LEAST_VARIANCE = 1e-18
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
    """t_ns (k,): epochs at which the vehicle has stood still for a second. text: how that was decided, or why it was not."""

    t_ns: Times
    text: str


def find_standstills(imu: ImuSeries, fixes: GnssFixSeries, t_ns: Times) -> Standstill:
    """Those of the times t_ns (e,) that end a second of standstill, judged by the IMU alone; fixes calibrate the judgement."""
    spreads, speed = _spreads(imu, fixes.t_ns), _speed(fixes)
    known = np.isfinite(spreads).all(axis=1)
    at_rest, in_motion = spreads[known & (speed < _AT_REST)], spreads[known & (speed > _IN_MOTION)]
    none = np.empty(0, np.int64)
    if not np.isfinite(speed).any():
        text = "the fixes hold neither velocities nor positions precise enough to know rest from: standstill cannot be told"
        return Standstill(none, text)
    if min(len(at_rest), len(in_motion)) < _FEWEST:
        return Standstill(
            none, f"{len(at_rest)} fixes at rest and {len(in_motion)} in motion: too few to tell standstill by the IMU"
        )
    unit = np.median(at_rest, axis=0)
    rest, motion = _energy(at_rest, unit), _energy(in_motion, unit)
    limit = min(float(np.quantile(rest, _MOST_REST)), float(np.quantile(motion, _LEAST_MOTION)) / _MARGIN)
    found = float((rest < limit).mean())
    if found < _LEAST_FOUND:
        return Standstill(none, "the IMU is nearly as quiet in motion as at rest: standstill cannot be told by it")
    still = t_ns[_energy(_spreads(imu, t_ns), unit) < limit]
    text = f"the IMU shows standstill at {len(still)} of {len(t_ns)} epochs; of the fixes at rest it recognises {found:.0%}"
    return Standstill(still, text)


def _speed(fixes: GnssFixSeries) -> Floats:
    """(k,) horizontal [m/s], the receiver's or that of precise positions; NaN where unknown, and where that of a neighbour says
    otherwise of rest or motion."""
    told = np.hypot(fixes.vel_n[:, 0], fixes.vel_n[:, 1])
    speed = np.where(fixes.has_velocity, told, _position_speed(fixes))
    around = _windows(speed)
    agree = (around < _AT_REST).all(axis=1) | (around > _IN_MOTION).all(axis=1)
    return np.where(agree, speed, np.nan)


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


def _energy(spreads: Floats, unit: Floats) -> Floats:
    """(k,) of spreads (k, 2): 2 at the median of rest, infinite where unknown."""
    return np.nan_to_num((spreads / unit) ** 2, nan=np.inf).sum(axis=1)


def _spreads(imu: ImuSeries, t_ns: Times) -> Floats:
    """(k, 2) standard deviations, over three axes together, of angular rate [rad/s] and specific force [m/s^2] in the second
    before each time; NaN where the IMU does not cover it."""
    ends = np.searchsorted(imu.t_ns, t_ns, side="right")
    starts = np.searchsorted(imu.t_ns, t_ns - _WINDOW_NS, side="right")
    count = (ends - starts)[:, None].astype(np.float64)
    columns = []
    for samples in (imu.gyro, imu.accel):
        centred = samples - samples.mean(axis=0)
        total, squares = _running_sum(centred), _running_sum(centred**2)
        mean = (total[ends] - total[starts]) / np.maximum(count, 1)
        variance = (squares[ends] - squares[starts]) / np.maximum(count, 1) - mean**2
        columns.append(np.sqrt(np.maximum(variance.sum(axis=1), _LEAST_VARIANCE)))
    expected = _WINDOW_NS / float(np.median(np.diff(imu.t_ns)))
    whole = (count[:, 0] >= max(_FEWEST_SAMPLES, _LEAST_COVERED * expected)) & (t_ns >= imu.t_ns[0] + _WINDOW_NS)
    return np.where(whole[:, None], np.stack(columns, axis=1), np.nan)


def _running_sum(samples: Floats) -> Floats:
    """(n + 1, 3) sums of the first rows of samples (n, 3)."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(samples, axis=0)])
