"""What GNSS fixes tell of motion before any filter runs: speed, course, mean acceleration, standstill."""

import numpy as np

from navreplay.geodesy import earth
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, LogError, Times

__all__ = ["find_initial_standstill", "find_motion", "fix_velocity", "window_fit"]

_STILL_SPEED = 0.4
_STILL_RATE = np.radians(0.6)
_STILL_FORCE = 0.25
_STILL_WINDOW_NS = 500_000_000
_SHORTEST_STANDSTILL_NS = 2_000_000_000
_SIGNIFICANT = 4.5
"""A way of so many standard deviations per axis is noise once in 25 000 fixes."""
_LONGEST_CHORD_S = 10.0
_LONGEST_STEP_S = 3.0
_SLOW_SHARE = 0.5
_TOLD_TOO_LARGE = 3.0
_LEAST_SPEED = 0.2
_UNKNOWN_POSITION_STD = 2.0
_UNKNOWN_VELOCITY_STD = 0.2


def fix_velocity(fixes: GnssFixSeries) -> Floats:
    """(k, 3) NED [m/s]: the receiver's where known, else the way between positions around a fix over its time.

    The way is taken over the shortest span, even on both sides and up to 10 s, in which it is longer than the noise of its ends
    (told, or as the positions scatter, whichever is more); NaN where it never is. A chord has the direction of the arc's
    middle, so turns do no harm.
    """
    velocity = np.full((len(fixes), 3), np.nan)
    rows = np.flatnonzero(fixes.has_position)
    if len(rows) >= 2:
        velocity[rows] = _chords(fixes.t_ns[rows], fixes.lla[rows], _position_std(fixes, rows))
    return np.where(fixes.has_velocity[:, None], fixes.vel_n, velocity)


def _chords(t_ns: Times, lla: Floats, std: Floats) -> Floats:
    """(k, 3) velocities of positions with horizontal standard deviations std (k,) [m] per axis."""
    k = len(t_ns)
    velocity, known = np.full((k, 3), np.nan), np.zeros(k, dtype=np.bool_)
    seconds = (t_ns - t_ns[0]) / 1e9
    for reach in range(1, k):
        first, last = np.maximum(np.arange(k) - reach, 0), np.minimum(np.arange(k) + reach, k - 1)
        span = seconds[last] - seconds[first]
        open_rows = ~known & (span <= (_LONGEST_CHORD_S if reach > 1 else 2 * _LONGEST_STEP_S))
        if not open_rows.any():
            break
        first, last, span = first[open_rows], last[open_rows], span[open_rows]
        way = earth.ned_between(lla[first], lla[last])
        good = np.hypot(way[:, 0], way[:, 1]) > _SIGNIFICANT * np.hypot(std[first], std[last])
        at = np.flatnonzero(open_rows)[good]
        velocity[at], known[at] = way[good] / span[good, None], True
    return velocity


def _position_std(fixes: GnssFixSeries, rows: np.ndarray) -> Floats:
    """(k,) horizontal noise of positions per axis [m]: as told, but no less than they scatter about smooth motion, by their
    third differences, and no more than three times that."""
    variance = np.trace(fixes.cov_pos[rows, :2, :2], axis1=1, axis2=2) / 2
    told = np.sqrt(np.where(np.isfinite(variance), variance, _UNKNOWN_POSITION_STD**2))
    if len(rows) < 12:
        return told
    place = earth.ned_between(np.broadcast_to(fixes.lla[rows[0]], (len(rows), 3)), fixes.lla[rows])
    scatter = 1.4826 * np.median(np.abs(np.diff(place[:, :2], 3, axis=0))) / np.sqrt(20.0)
    return np.clip(told, scatter, _TOLD_TOO_LARGE * max(float(scatter), 1e-4))


def find_motion(fixes: GnssFixSeries, speed: float) -> np.ndarray:
    """(k,) True where the horizontal speed is known to exceed speed [m/s], or half of the usual speed of a vehicle that is
    slower than that throughout."""
    velocity = np.nan_to_num(fix_velocity(fixes))
    speeds = np.hypot(velocity[:, 0], velocity[:, 1])
    if len(speeds) and speeds.max() <= speed and _leaves_its_place(fixes):
        moving = speeds > _LEAST_SPEED
        speed = max(_LEAST_SPEED, _SLOW_SHARE * float(np.median(speeds[moving]))) if moving.any() else speed
    return np.asarray(speeds > speed)


def _leaves_its_place(fixes: GnssFixSeries) -> bool:
    """Whether the positions reach farther than their noise can."""
    rows = np.flatnonzero(fixes.has_position)
    if len(rows) < 2:
        return False
    place = earth.ned_between(np.broadcast_to(fixes.lla[rows[0]], (len(rows), 3)), fixes.lla[rows])[:, :2]
    reach = float(np.linalg.norm(np.ptp(place, axis=0)))
    return reach > 2 * (_SIGNIFICANT + 1) * float(np.median(_position_std(fixes, rows)))


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
