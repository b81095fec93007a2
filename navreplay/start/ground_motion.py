"""What GNSS fixes tell of motion before any filter runs: speed, course, mean acceleration, standstill."""

import numpy as np

from navreplay.geodesy import earth
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, LogError

__all__ = ["find_initial_standstill", "find_motion", "fix_velocity", "window_fit"]

_STILL_SPEED = 0.4
_STILL_RATE = np.radians(0.6)
_STILL_FORCE = 0.25
_STILL_WINDOW_NS = 500_000_000
_SHORTEST_STANDSTILL_NS = 2_000_000_000
_SIGNIFICANT = 4.5
"""A way of so many standard deviations per axis is noise once in 25 000 fixes."""
_UNKNOWN_POSITION_STD = 2.0
_UNKNOWN_VELOCITY_STD = 0.2


def fix_velocity(fixes: GnssFixSeries) -> Floats:
    """(k, 3) NED [m/s]: the receiver's where known, else the way since the position before over its time; NaN where that is
    older than 3 s or the way no longer than the noise of its ends."""
    velocity = np.full((len(fixes), 3), np.nan)
    rows = np.flatnonzero(fixes.has_position)
    dt = np.diff(fixes.t_ns[rows]) / 1e9
    way = earth.ned_between(fixes.lla[rows[:-1]], fixes.lla[rows[1:]])
    variance = np.trace(fixes.cov_pos[rows, :2, :2], axis1=1, axis2=2) / 2
    variance = np.where(np.isfinite(variance), variance, _UNKNOWN_POSITION_STD**2)
    good = (dt < 3) & (np.hypot(way[:, 0], way[:, 1]) > _SIGNIFICANT * np.sqrt(variance[1:] + variance[:-1]))
    velocity[rows[1:][good]] = way[good] / dt[good, None]
    return np.where(fixes.has_velocity[:, None], fixes.vel_n, velocity)


def find_motion(fixes: GnssFixSeries, speed: float) -> np.ndarray:
    """(k,) True where the horizontal speed is known to exceed speed [m/s]."""
    velocity = np.nan_to_num(fix_velocity(fixes))
    return np.asarray(np.hypot(velocity[:, 0], velocity[:, 1]) > speed)


def find_initial_standstill(imu: ImuSeries, fixes: GnssFixSeries) -> int:
    """Time until which the vehicle stands still from the IMU's first sample on; that sample's time when it does not.

    Still means: GNSS slow, and half-second means of rate and specific force near those of the beginning. A first speed that a
    push below the limit could not have brought about since was there from the beginning (uniform flight).
    """
    begin = int(imu.t_ns[0])
    edges = np.flatnonzero(np.diff((imu.t_ns - begin) // _STILL_WINDOW_NS, prepend=-1))
    counts = np.diff(np.append(edges, len(imu)))[:, None]
    gyro = np.add.reduceat(imu.gyro, edges) / counts
    accel = np.add.reduceat(imu.accel, edges) / counts
    turning = np.abs(gyro - np.median(gyro[:4], axis=0)).max(axis=1) > _STILL_RATE
    pushed = np.linalg.norm(accel - np.median(accel[:4], axis=0), axis=1) > _STILL_FORCE
    stirred = np.flatnonzero(turning | pushed)
    until = int(imu.t_ns[edges[stirred[0]]]) if len(stirred) else int(imu.t_ns[-1])
    fast = np.flatnonzero(find_motion(fixes, _STILL_SPEED) & (fixes.t_ns >= begin))
    if len(fast) and fixes.t_ns[fast[0]] < until:
        until = int(fixes.t_ns[fast[0]])
        if np.linalg.norm(fix_velocity(fixes)[fast[0], :2]) > _STILL_FORCE * (until - begin) / 1e9:
            return begin
    return until if until - begin >= _SHORTEST_STANDSTILL_NS else begin


def window_fit(
    fixes: GnssFixSeries, first: int, accuracy: float, longest_s: float = 40.0
) -> tuple[np.ndarray, Floats, Floats, float]:
    """Weights that turn the fixes from `first` on into a mean acceleration, over the shortest window that suffices.

    Least squares. Returns rows (k,), weights (k,), the velocity NED at `first` (3,) [m/s] and the standard deviation of the
    acceleration [m/s^2], which aims below accuracy. Velocities give their slope, positions their curvature.
    Raises LogError when there are fewer than three fixes to fit.
    """
    use_velocity = bool(fixes.has_velocity[first])
    known = fixes.has_velocity if use_velocity else fixes.has_position
    rows = np.flatnonzero(known & (np.arange(len(fixes)) >= first))
    t = (fixes.t_ns[rows] - fixes.t_ns[first]) / 1e9
    order = 1 if use_velocity else 2
    noise = _typical_std(fixes.cov_vel if use_velocity else fixes.cov_pos, rows[0], use_velocity)
    count = order + 1
    while count <= len(rows) and t[count - 1] <= longest_s:
        design = t[:count, None] ** np.arange(order + 1)
        solver = np.linalg.pinv(design)
        weights = solver[order] * order
        std = noise * float(np.linalg.norm(weights))
        if std < accuracy:
            break
        count += 1
    else:
        count = min(count - 1, len(rows))
        if count < order + 1:
            raise LogError("alignment: too few fixes in a row to align in motion; give the attitude with alignment.given_deg")
    taken = rows[:count]
    if use_velocity:
        return taken, weights, fixes.vel_n[first].copy(), std
    path = earth.ned_between(fixes.lla[first], fixes.lla[taken])
    return taken, weights, np.asarray(solver[1] @ path), std


def _typical_std(cov: Floats, row: int, is_velocity: bool) -> float:
    variance = float(np.trace(cov[row, :2, :2])) / 2
    default = _UNKNOWN_VELOCITY_STD if is_velocity else _UNKNOWN_POSITION_STD
    return float(np.sqrt(variance)) if np.isfinite(variance) else default
