"""Initial alignment: levelling from specific force; heading given, from another sensor, from a gyrocompass or from GNSS velocity.

Levelling and gyrocompassing: Groves (2013), 5.6.1 and 5.6.2. This is post-processing: heading from GNSS velocity uses the
first metres of motion to settle the heading at the beginning of the standstill before them.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navreplay import earth, rotation
from navreplay.options import AlignmentOptions, ImuNoise
from navreplay.strapdown import NavState, integrate_steps, make_steps
from navreplay.timeline import AttitudeSeries, Floats, GnssFixSeries, ImuSeries, LogError, Times, Trajectory

__all__ = ["Alignment", "Heading", "align", "find_standstill", "level"]

_GRAVITY = 9.81
_STILL_SPEED = 0.4
_STILL_RATE = np.radians(0.6)
_STILL_FORCE = 0.25
_STILL_WINDOW_NS = 500_000_000
_SHORTEST_STANDSTILL_NS = 2_000_000_000
_MOTION_NS = 10_000_000_000
_MOVING_LEVEL_STD = np.radians(4)


class Alignment(NamedTuple):
    """Where the filter starts: at the fix with index fix, at t_ns. q_nb (4,). cov_att (3, 3) of the rotation vector in n
    [rad^2]. gyro_bias (3,) [rad/s] with standard deviation gyro_bias_std. text: what was done; warnings:
    sentences. vel_n (3,) [m/s] and cov_vel (3, 3): for a fix without velocity."""

    t_ns: int
    fix: int
    q_nb: Floats
    cov_att: Floats
    gyro_bias: Floats
    gyro_bias_std: float
    text: str
    warnings: tuple[str, ...]
    vel_n: Floats
    cov_vel: Floats


class Heading(NamedTuple):
    """yaw [rad], its standard deviation [rad], where it came from, and a warning or an empty string."""

    yaw: float
    std: float
    source: str
    warning: str = ""


def align(
    imu: ImuSeries,
    fixes: GnssFixSeries,
    attitude: AttitudeSeries | None,
    reference: Trajectory | None,
    noise: ImuNoise,
    options: AlignmentOptions,
) -> Alignment:
    """Initial attitude and gyro bias at the first fix with a position inside the IMU's span that the method can start from.

    Raises LogError where no fix lies inside the span, or the log cannot give what the chosen method needs.
    """
    candidates = np.flatnonzero(fixes.has_position & (fixes.t_ns >= imu.t_ns[0]) & (fixes.t_ns < imu.t_ns[-1]))
    if not len(candidates):
        raise LogError("alignment: no position fix lies inside the IMU's time span; check the time bases and time offsets")
    moving = _find_motion(fixes, options.min_speed)
    first = int(candidates[0])
    still_until = find_standstill(imu, fixes)
    if still_until > fixes.t_ns[first]:
        return _align_at_rest(imu, fixes, attitude, reference, noise, options, first, still_until, moving)
    starts = candidates[moving[candidates]]
    fixed_heading = options.method in ("given", "attitude", "reference") or options.given is not None
    if fixed_heading or not len(starts):
        return _align_in_motion(imu, fixes, attitude, reference, noise, options, first, has_course=False)
    return _align_in_motion(imu, fixes, attitude, reference, noise, options, int(starts[0]), has_course=True)


def level(accel: Floats) -> tuple[float, float]:
    """Roll and pitch [rad] of a body at rest that senses specific force accel (3,)."""
    return float(np.arctan2(-accel[1], -accel[2])), float(np.arctan2(accel[0], np.hypot(accel[1], accel[2])))


def find_standstill(imu: ImuSeries, fixes: GnssFixSeries) -> int:
    """Time until which the vehicle stands still from the IMU's first sample on; that sample's time when it does not.

    Still means: GNSS slow, and half-second means of rate and specific force near those of the beginning.
    """
    begin = int(imu.t_ns[0])
    window = (imu.t_ns - begin) // _STILL_WINDOW_NS
    edges = np.flatnonzero(np.diff(window, prepend=-1))
    counts = np.diff(np.append(edges, len(imu)))[:, None]
    gyro = np.add.reduceat(imu.gyro, edges) / counts
    accel = np.add.reduceat(imu.accel, edges) / counts
    calm = np.median(gyro[:4], axis=0), np.median(accel[:4], axis=0)
    turning = np.abs(gyro - calm[0]).max(axis=1) > _STILL_RATE
    pushed = np.linalg.norm(accel - calm[1], axis=1) > _STILL_FORCE
    stirred = np.flatnonzero(turning | pushed)
    last = len(edges) if not len(stirred) else int(stirred[0])
    until = int(imu.t_ns[-1]) if last == len(edges) else int(imu.t_ns[edges[last]])
    fast = fixes.t_ns[_find_motion(fixes, _STILL_SPEED)]
    fast = fast[fast >= begin]
    if len(fast):
        until = min(until, int(fast[0]))
    return until if until - begin >= _SHORTEST_STANDSTILL_NS else begin


def _speed(fixes: GnssFixSeries) -> Floats:
    """(k,) [m/s], of velocity where known, else of the way since the fix before; NaN where neither is known."""
    speed = np.hypot(fixes.vel_n[:, 0], fixes.vel_n[:, 1])
    unknown = np.flatnonzero(np.isnan(speed[1:])) + 1
    if len(unknown):
        course = _position_velocity(fixes)
        speed[unknown] = np.hypot(course[unknown, 0], course[unknown, 1])
    return np.asarray(speed)


def _position_velocity(fixes: GnssFixSeries) -> Floats:
    """(k, 3) mean velocity since the position before, NaN where there is none within 3 s or the way is within its noise."""
    velocity = np.full((len(fixes), 3), np.nan)
    rows = np.flatnonzero(fixes.has_position)
    dt = np.diff(fixes.t_ns[rows]) / 1e9
    way = earth.ned_between(fixes.lla[rows[:-1]], fixes.lla[rows[1:]])
    variance = np.nan_to_num(np.trace(fixes.cov_pos[rows[1:], :2, :2], axis1=1, axis2=2), nan=4.0)
    good = (dt < 3) & (np.hypot(way[:, 0], way[:, 1]) > 3 * np.sqrt(variance))
    velocity[rows[1:][good]] = way[good] / dt[good, None]
    return velocity


def _find_motion(fixes: GnssFixSeries, speed: float) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.asarray(_speed(fixes) > speed)


def _align_at_rest(
    imu: ImuSeries,
    fixes: GnssFixSeries,
    attitude: AttitudeSeries | None,
    reference: Trajectory | None,
    noise: ImuNoise,
    options: AlignmentOptions,
    first: int,
    still_until: int,
    moving: np.ndarray,
) -> Alignment:
    begin = max(int(imu.t_ns[0]), still_until - int(options.static_window * 1e9))
    still = (imu.t_ns >= begin) & (imu.t_ns < still_until)
    seconds = (still_until - begin) / 1e9
    gyro, accel = imu.gyro[still].mean(axis=0), imu.accel[still].mean(axis=0)
    roll, pitch = level(accel)
    level_std = float(np.hypot(noise.accel_bias_std / _GRAVITY, np.radians(0.05)))
    lla = fixes.lla[first]
    t_ns = int(fixes.t_ns[first])
    static_std = float(np.hypot(noise.gyro_noise / np.sqrt(seconds), noise.gyro_bias_walk * np.sqrt(seconds)))
    # until heading is known the Earth's rotation cannot be told from a bias
    learnt_std = float(np.hypot(static_std, earth.EARTH_RATE))
    learns = learnt_std < noise.gyro_bias_std
    bias = gyro if learns else np.zeros(3)
    bias_std = learnt_std if learns else noise.gyro_bias_std

    heading = _known_heading(t_ns, attitude, reference, options)
    if heading is None and options.method in ("auto", "gyrocompass"):
        heading = _gyrocompass(gyro, roll, pitch, float(lla[0]), noise, static_std, options)
    if heading is None:
        q_level = rotation.quat_from_euler(roll, pitch, 0.0)
        drift = bias_std * max(0.0, (still_until - t_ns) / 1e9)
        heading = _match_course(imu, fixes, moving, NavState.at(lla, np.zeros(3), q_level), bias, t_ns, options, drift)
    if options.method == "given" and options.given is not None:
        roll, pitch = options.given[:2]
        stds = np.array(options.given_std)
    else:
        stds = np.array([level_std, level_std, heading.std])
    text = (
        f"aligned at rest: levelled over {seconds:.0f} s (roll {np.degrees(roll):.2f} deg, pitch {np.degrees(pitch):.2f} deg), "
        f"heading {np.degrees(heading.yaw) % 360:.2f} deg from {heading.source}, standard deviation {np.degrees(heading.std):.2f} deg"
    )
    warnings = (heading.warning,) if heading.warning else ()
    q_nb = rotation.quat_from_euler(roll, pitch, heading.yaw)
    return Alignment(
        t_ns, first, q_nb, _tilt_covariance(stds, heading.yaw), bias, bias_std, text, warnings, np.zeros(3), np.eye(3) * 0.1**2
    )


def _align_in_motion(
    imu: ImuSeries,
    fixes: GnssFixSeries,
    attitude: AttitudeSeries | None,
    reference: Trajectory | None,
    noise: ImuNoise,
    options: AlignmentOptions,
    first: int,
    has_course: bool,
) -> Alignment:
    t_ns = int(fixes.t_ns[first])
    heading = _known_heading(t_ns, attitude, reference, options)
    if heading is None and has_course:
        velocity = _velocity(fixes)[first]
        yaw = float(np.arctan2(velocity[1], velocity[0]))
        heading = Heading(yaw, max(options.course_std, np.radians(5)), "the course over ground")
    if heading is None:
        heading = _unknown_heading(options)
    near = np.abs(imu.t_ns - t_ns) < 1_000_000_000
    accel = imu.accel[near].mean(axis=0)
    push = _mean_acceleration(fixes, t_ns)
    # what is left of specific force without the vehicle's own acceleration is gravity; both in axes turned by yaw
    c_yaw = rotation.matrix_from_euler(0.0, 0.0, heading.yaw)
    roll, pitch = level(accel - c_yaw.T @ push)
    stds = np.array([_MOVING_LEVEL_STD, _MOVING_LEVEL_STD, heading.std])
    if options.method == "given" and options.given is not None:
        roll, pitch = options.given[:2]
        stds = np.array(options.given_std)
    text = (
        f"aligned in motion: roll {np.degrees(roll):.1f} deg, pitch {np.degrees(pitch):.1f} deg from specific force less GNSS "
        f"acceleration, heading {np.degrees(heading.yaw) % 360:.1f} deg from {heading.source}, "
        f"standard deviation {np.degrees(heading.std):.1f} deg"
    )
    warnings = (heading.warning,) if heading.warning else ()
    q_nb = rotation.quat_from_euler(roll, pitch, heading.yaw)
    cov = _tilt_covariance(stds, heading.yaw)
    velocity = _velocity(fixes)[first]
    known = np.isfinite(velocity).all()
    vel_n, std = (velocity, 1.0) if known else (np.zeros(3), 20.0)
    return Alignment(t_ns, first, q_nb, cov, np.zeros(3), noise.gyro_bias_std, text, warnings, vel_n, np.eye(3) * std**2)


def _tilt_covariance(stds: Floats, yaw: float) -> Floats:
    """(3, 3) of the rotation vector in n from standard deviations of roll, pitch, yaw (small tilts: roll and pitch turn with yaw)."""
    c = rotation.matrix_from_euler(0.0, 0.0, yaw)
    return np.asarray(c @ np.diag(stds**2) @ c.T)


def _known_heading(
    t_ns: int, attitude: AttitudeSeries | None, reference: Trajectory | None, options: AlignmentOptions
) -> Heading | None:
    if options.method == "given" or (options.method == "auto" and options.given is not None):
        if options.given is None:
            raise LogError(
                "alignment: method is 'given', but no angles are given; set alignment.given_deg = [roll, pitch, yaw]"
            )
        return Heading(options.given[2], options.given_std[2], "the configuration")
    if options.method == "reference":
        if reference is None or not np.isfinite(reference.q_nb).all(axis=1).any():
            raise LogError(
                "alignment: method is 'reference', but the reference holds no attitude; choose another alignment.method"
            )
        known = np.isfinite(reference.q_nb).all(axis=1)
        return Heading(_nearest_yaw(t_ns, reference.t_ns[known], reference.q_nb[known]), options.given_std[2], "the reference")
    if options.method == "attitude" and attitude is None:
        raise LogError("alignment: method is 'attitude', but the log holds no attitude channel; set input.attitude.channel")
    if attitude is not None and options.method in ("auto", "attitude"):
        nearest = int(np.argmin(np.abs(attitude.t_ns - t_ns)))
        told = attitude.cov[nearest, 2, 2]
        std = float(np.sqrt(told)) if np.isfinite(told) else options.given_std[2]
        return Heading(_nearest_yaw(t_ns, attitude.t_ns, attitude.q_nb), std, "the attitude channel")
    return None


def _nearest_yaw(t_ns: int, times: Times, q_nb: Floats) -> float:
    nearest = int(np.argmin(np.abs(times - t_ns)))
    if abs(int(times[nearest]) - t_ns) > 2_000_000_000:
        raise LogError("alignment: no attitude within 2 s of the first fix; choose another alignment.method")
    return float(rotation.euler_from_quat(q_nb[nearest])[2])


def _gyrocompass(
    gyro: Floats, roll: float, pitch: float, lat: float, noise: ImuNoise, static_std: float, options: AlignmentOptions
) -> Heading | None:
    horizontal = earth.EARTH_RATE * np.cos(lat)
    std = float(np.hypot(noise.gyro_bias_std, static_std) / horizontal)
    if std > options.max_gyrocompass_std:
        if options.method == "gyrocompass":
            raise LogError(
                f"alignment: a gyrocompass with these gyros would err by {np.degrees(std):.0f} deg; take alignment.method = 'course', "
                "or tell the gyro's real bias in [imu]"
            )
        return None
    rate = rotation.matrix_from_euler(roll, pitch, 0.0) @ gyro
    return Heading(float(np.arctan2(-rate[1], rate[0])), std, "the gyrocompass")


def _match_course(
    imu: ImuSeries,
    fixes: GnssFixSeries,
    moving: np.ndarray,
    start: NavState,
    gyro_bias: Floats,
    t_ns: int,
    options: AlignmentOptions,
    drift: float,
) -> Heading:
    """Heading at t_ns: course over ground against yaw integrated from a start with yaw zero, over the first seconds of motion.

    The velocity integrated from rest in that frame, against the GNSS velocity, shows whether the vehicle set off backwards or
    its sensor axes point elsewhere than the configuration says.
    """
    epochs = np.flatnonzero(moving & (fixes.t_ns > t_ns) & (fixes.t_ns < imu.t_ns[-1]))
    if not len(epochs):
        return _unknown_heading(options)
    epochs = epochs[fixes.t_ns[epochs] <= fixes.t_ns[epochs[0]] + _MOTION_NS]
    set_off = max(t_ns, int(fixes.t_ns[epochs[0]]) - _MOTION_NS)
    steps = make_steps(imu, np.append(fixes.t_ns[epochs], [t_ns, set_off])).after(t_ns)
    x = integrate_steps(steps, replace(start, gyro_bias=gyro_bias))
    index = np.searchsorted(steps.t_ns, fixes.t_ns[epochs])
    base = np.searchsorted(steps.t_ns, set_off)
    velocity = _velocity(fixes)[epochs]
    gnss = velocity[:, 0] + 1j * velocity[:, 1]
    relative_yaw = rotation.euler_from_quat(x[index, 6:10])[:, 2]
    candidates = gnss / np.abs(gnss) * np.exp(-1j * relative_yaw)
    mean = np.average(candidates, weights=np.abs(gnss))
    scatter = float(np.sqrt(max(0.0, -2 * np.log(min(1.0, abs(mean))))))
    std = float(np.sqrt(options.course_std**2 + drift**2 + scatter**2))
    inertial = (x[index, 3] - x[base, 3]) + 1j * (x[index, 4] - x[base, 4])
    matched = np.sum(gnss * np.conj(inertial))
    return _judge_match(mean, matched, std)


def _judge_match(course: complex, matched: complex, std: float) -> Heading:
    yaw = float(np.angle(course))
    off = float(rotation.wrap_angle(np.angle(matched) - yaw))
    if abs(off) > np.radians(135):
        return Heading(yaw + np.pi, std, "the course over ground, setting off backwards")
    if abs(off) > np.radians(40):
        warning = (
            f"the IMU's x axis points {np.degrees(-off):.0f} deg away from the direction of travel, as the first acceleration shows; "
            "check input.imu.axes and input.imu.mounting_deg"
        )
        return Heading(float(np.angle(matched)), max(std, np.radians(15)), "the first acceleration", warning)
    return Heading(yaw, std, "the course over ground")


def _unknown_heading(options: AlignmentOptions) -> Heading:
    if options.method not in ("auto", "course"):
        raise LogError(f"alignment: method '{options.method}' found no heading; choose another alignment.method")
    warning = (
        f"heading is unknown: the GNSS speed never exceeds {options.min_speed:g} m/s; give it with alignment.given_deg, or lower "
        "alignment.min_speed_mps"
    )
    return Heading(0.0, np.pi / np.sqrt(3), "nowhere (unknown)", warning)


def _velocity(fixes: GnssFixSeries) -> Floats:
    return np.where(fixes.has_velocity[:, None], fixes.vel_n, _position_velocity(fixes))


def _mean_acceleration(fixes: GnssFixSeries, t_ns: int) -> Floats:
    velocity = _velocity(fixes)
    near = np.flatnonzero(np.isfinite(velocity).all(axis=1) & (np.abs(fixes.t_ns - t_ns) <= 1_500_000_000))
    if len(near) < 2:
        return np.zeros(3)
    seconds = (fixes.t_ns[near[-1]] - fixes.t_ns[near[0]]) / 1e9
    return np.asarray((velocity[near[-1]] - velocity[near[0]]) / seconds)
