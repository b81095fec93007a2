"""An IMU whose clock counts from power-on beside fixes with a date: set to their time by the turns that both saw.

Over all times at which the two could lie beside each other the yaw rate is correlated with the course rate. One clear peak is a
match; laps, which give several, are none.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from importers.findings import Finding
from importers.rows.clock import NOMINAL_NS, is_nominal
from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import wrap_angle
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries

__all__ = ["set_to_fixes"]

_STEP_S = 0.2
_SMOOTH_S = 1.0
_SLOWEST = 1.0
_LEAST_SECONDS = 30.0
_LEAST_SHARE = 0.6
_SURE = 0.7
_AMBIGUOUS = 0.8
_APART_S = 5.0
_MOST_CELLS = 2_000_000


def set_to_fixes(imu: ImuSeries, fixes: GnssFixSeries) -> tuple[ImuSeries, Finding] | None:
    """The IMU with stamps in the time of the fixes, and what was found; None where its stamps have a date, or no match is
    clear."""
    if not is_nominal(imu.t_ns) or is_nominal(fixes.t_ns):
        return None
    spans = [float(series.t_ns[-1] - series.t_ns[0]) / 1e9 for series in (imu, fixes)]
    if min(spans) < _LEAST_SECONDS or max(spans) / _STEP_S > _MOST_CELLS:
        return None
    turns = _yaw_rate(imu)
    course, moving = _course_rate(fixes)
    lag, best, second = _match(turns, course, moving)
    if best < _SURE or second > _AMBIGUOUS * best:
        return None
    shift = int(fixes.t_ns[0]) - int(imu.t_ns[0]) + round(lag * _STEP_S * 1e9)
    text = (
        f"The IMU's stamps count from power-on. Its turns fit the course of the fixes at one time only (correlation "
        f"{best:.2f}, elsewhere {second:.2f} at most): they are moved there."
    )
    hint = f"Set input.imu.time_offset_s = {(shift + NOMINAL_NS) / 1e9:.2f} to keep it; it is right to about 0.2 s."
    return replace(imu, t_ns=imu.t_ns + shift), Finding("warning", "undated-imu", text, hint)


def _yaw_rate(imu: ImuSeries) -> Floats:
    """Rate about the vertical on an even grid [rad/s], smoothed."""
    force = np.median(imu.accel, axis=0)
    rate = imu.gyro @ (-force / max(float(np.linalg.norm(force)), 1e-9))
    seconds = (imu.t_ns - imu.t_ns[0]) / 1e9
    total = np.concatenate([[0.0], np.cumsum(np.diff(seconds) * (rate[1:] + rate[:-1]) / 2)])
    grid = np.arange(0.0, seconds[-1], _STEP_S)
    half = _SMOOTH_S / 2
    return np.asarray((np.interp(grid + half, seconds, total) - np.interp(grid - half, seconds, total)) / _SMOOTH_S)


def _course_rate(fixes: GnssFixSeries) -> tuple[Floats, NDArray[np.bool_]]:
    """The same of the course, and where the vehicle is fast enough to have one."""
    if fixes.has_velocity.mean() > 0.5:
        t_ns, vel = fixes.t_ns[fixes.has_velocity], fixes.vel_n[fixes.has_velocity]
    else:
        t_all, lla = fixes.t_ns[fixes.has_position], fixes.lla[fixes.has_position]
        whole = np.unique((t_all - t_all[0]) // 10**9, return_index=True)[1]
        vel = ned_between(lla[whole][:-1], lla[whole][1:]) / (np.diff(t_all[whole])[:, None] / 1e9)
        t_ns = (t_all[whole][:-1] + t_all[whole][1:]) // 2
    seconds = (t_ns - fixes.t_ns[0]) / 1e9
    grid = np.arange(0.0, float(fixes.t_ns[-1] - fixes.t_ns[0]) / 1e9, _STEP_S)
    half = _SMOOTH_S / 2
    ends = [np.column_stack([np.interp(grid + at, seconds, vel[:, i]) for i in (0, 1)]) for at in (-half, half)]
    courses = [np.arctan2(end[:, 1], end[:, 0]) for end in ends]
    fast = np.minimum(*(np.hypot(*end.T) for end in ends)) > _SLOWEST
    rate = np.asarray(wrap_angle(courses[1] - courses[0]) / _SMOOTH_S)
    return np.where(fast, rate, 0.0), fast


def _match(turns: Floats, course: Floats, moving: NDArray[np.bool_]) -> tuple[int, float, float]:
    """Cells that the turns begin behind the course's first, the correlation there, and the best at least 5 s elsewhere."""
    from scipy.signal import fftconvolve  # slow to load, and hardly any log needs it

    known = np.ones(len(turns))
    together = fftconvolve(moving.astype(np.float64), known[::-1])
    product = fftconvolve(course, turns[::-1])
    power = fftconvolve(moving.astype(np.float64), turns[::-1] ** 2) * fftconvolve(course**2, known[::-1])
    enough = together > _LEAST_SHARE * together.max()
    correlation = np.where(enough, product / np.sqrt(np.maximum(power, 1e-12)), -1.0)
    peak = int(np.argmax(correlation))
    apart = np.abs(np.arange(len(correlation)) - peak) * _STEP_S > _APART_S
    second = float(correlation[apart].max()) if apart.any() else 0.0
    return peak - (len(turns) - 1), float(correlation[peak]), max(second, 0.0)
