"""Initial alignment: where the filter starts, at which attitude, with which gyro bias, and how well these are known.

Levelling: Groves (2013), 5.6.1. This is post-processing: heading from GNSS velocity uses the first metres of motion to settle
the heading at the beginning of the standstill before them.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from navreplay.geodesy import earth, rotation
from navreplay.mechanisation.strapdown import NavState, integrate_steps, make_steps
from navreplay.start.ground_motion import find_initial_standstill, find_motion, window_fit
from navreplay.start.heading import Heading, Sources, course_heading, gyrocompass, known_heading, match_course, unknown_heading
from navreplay.timeline import Floats, LogError

__all__ = ["Alignment", "align", "level"]

_GRAVITY = 9.81
_LEAST_LEVEL_STD = np.radians(0.05)
_MOVING_FORCE_STD = 0.2
_VELOCITY_STD_AT_REST = 0.1
_VELOCITY_STD_IN_MOTION = 2.0


class Alignment(NamedTuple):
    """Start of a filter at the fix with index fix, at t_ns.

    q_nb (4,) with cov_att (3, 3) of the rotation vector in n [rad^2], to which, where levelled, the tilt comes that the
    accelerometer biases cause. vel_n (3,) [m/s] with standard deviation vel_std, for a fix without velocity. gyro_bias (3,)
    [rad/s] with standard deviation gyro_bias_std. text says what was done, warnings what to look at. sure: the attitude does
    not rest on a course in motion, on an attitude that another sensor tells, or on nothing.
    """

    t_ns: int
    fix: int
    q_nb: Floats
    cov_att: Floats
    levelled: bool
    vel_n: Floats
    vel_std: float
    gyro_bias: Floats
    gyro_bias_std: float
    text: str
    warnings: tuple[str, ...]
    sure: bool = True


def align(sources: Sources) -> Alignment:
    """Alignment at the first fix with a position inside the IMU's span that the method can start from.

    Raises LogError where no fix lies inside the span, or the log cannot give what the chosen method needs.
    """
    imu, fixes, options = sources.imu, sources.fixes, sources.options
    candidates = np.flatnonzero(fixes.has_position & (fixes.t_ns >= imu.t_ns[0]) & (fixes.t_ns < imu.t_ns[-1]))
    if not len(candidates):
        raise LogError("alignment: no position fix lies inside the IMU's time span; check the time bases and time offsets")
    moving = find_motion(fixes, options.min_speed)
    first = int(candidates[0])
    still_until = find_initial_standstill(imu, fixes)
    if still_until > fixes.t_ns[first]:
        return _align_at_rest(sources, first, still_until, moving)
    needs_course = options.method in ("auto", "course", "gyrocompass") and options.given is None and sources.attitude is None
    if needs_course and moving[candidates].any():
        first = int(candidates[np.argmax(moving[candidates])])
    return _align_in_motion(sources, first)


def level(accel: Floats) -> tuple[float, float]:
    """Roll and pitch [rad] of a body at rest that senses specific force accel (3,)."""
    return float(np.arctan2(-accel[1], -accel[2])), float(np.arctan2(accel[0], np.hypot(accel[1], accel[2])))


def _align_at_rest(sources: Sources, first: int, still_until: int, moving: np.ndarray) -> Alignment:
    imu, noise, options = sources.imu, sources.noise, sources.options
    begin = max(int(imu.t_ns[0]), still_until - int(options.static_window * 1e9))
    still = (imu.t_ns >= begin) & (imu.t_ns < still_until)
    seconds = (still_until - begin) / 1e9
    gyro = imu.gyro[still].mean(axis=0)
    roll, pitch = level(imu.accel[still].mean(axis=0))
    t_ns, lla = int(sources.fixes.t_ns[first]), sources.fixes.lla[first]
    mean_std = float(np.hypot(noise.gyro_noise / np.sqrt(seconds), noise.gyro_bias_walk * np.sqrt(seconds)))
    c_level = rotation.matrix_from_euler(roll, pitch, 0.0)
    # without heading, of the Earth's rotation only the part about the vertical can be told from a bias
    vertical = np.array([0.0, 0.0, earth.EARTH_RATE * -np.sin(lla[0])])
    rough = gyro - c_level.T @ vertical

    heading = known_heading(sources, t_ns)
    if heading is None and options.method in ("auto", "gyrocompass"):
        heading = gyrocompass(sources, gyro, mean_std, roll, pitch, float(lla[0]))
    if heading is None:
        start = replace(NavState.at(lla, np.zeros(3), rotation.quat_from_euler(roll, pitch, 0.0)), gyro_bias=rough)
        drift = float(np.hypot(mean_std, earth.EARTH_RATE)) * (still_until - t_ns) / 1e9
        heading = match_course(sources, start, t_ns, moving, drift)
    bias, bias_std = np.zeros(3), noise.gyro_bias_std
    learnt_std = float(np.hypot(mean_std, earth.EARTH_RATE * np.cos(lla[0]) * min(heading.std, 1.0)))
    if learnt_std < noise.gyro_bias_std:
        c_nb = rotation.matrix_from_euler(roll, pitch, heading.yaw)
        bias, bias_std = gyro - c_nb.T @ earth.earth_rate_n(lla[0]), learnt_std
    q_nb, cov_att, levelled, angles = _attitude(sources, roll, pitch, float(_LEAST_LEVEL_STD), heading)
    return Alignment(
        *(t_ns, first, q_nb, cov_att, levelled, np.zeros(3), _VELOCITY_STD_AT_REST, bias, bias_std),
        f"aligned at rest, levelled over {seconds:.0f} s: {angles}",
        (heading.warning,) if heading.warning else (),
        heading.sure,
    )


def _align_in_motion(sources: Sources, first: int) -> Alignment:
    fixes, options = sources.fixes, sources.options
    t_ns = int(fixes.t_ns[first])
    rows, weights, velocity, force_std = window_fit(fixes, first, _MOVING_FORCE_STD)
    heading = known_heading(sources, t_ns)
    if heading is None:
        fast = np.hypot(velocity[0], velocity[1]) > options.min_speed
        heading = course_heading(velocity, options) if fast else unknown_heading(options)
    roll, pitch = _level_in_motion(sources, first, rows, weights, heading.yaw)
    level_std = float(np.hypot(force_std / _GRAVITY, np.radians(1)))
    q_nb, cov_att, levelled, angles = _attitude(sources, roll, pitch, level_std, heading)
    return Alignment(
        *(t_ns, first, q_nb, cov_att, levelled, velocity, _VELOCITY_STD_IN_MOTION, np.zeros(3), sources.noise.gyro_bias_std),
        f"aligned in motion, levelled against {len(rows)} fixes: {angles}",
        (heading.warning,) if heading.warning else (),
        options.method in ("given", "reference") or options.given is not None,
    )


def _level_in_motion(sources: Sources, first: int, rows: np.ndarray, weights: Floats, yaw: float) -> tuple[float, float]:
    """Roll and pitch at fix `first` that turn the IMU's specific force into GNSS acceleration less gravity.

    The weights that make an acceleration of the fixes are put on the IMU's own velocity or position, integrated in the axes
    that the body has at the first fix, so that turns within the window do no harm.
    """
    fixes = sources.fixes
    t_ns, lla = int(fixes.t_ns[first]), fixes.lla[first]
    rows_in = fixes.t_ns[rows] < sources.imu.t_ns[-1]
    if not rows_in.all():
        raise LogError("alignment: the IMU ends before the vehicle's acceleration is known; give alignment.given_deg")
    steps = make_steps(sources.imu, fixes.t_ns[rows]).after(t_ns)
    states = integrate_steps(steps, NavState.at(lla, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    at = np.searchsorted(steps.t_ns, fixes.t_ns[rows[1:]])
    if fixes.has_velocity[first]:
        own = np.concatenate([np.zeros((1, 3)), states[at, 3:6]])
        seen = weights @ fixes.vel_n[rows]
    else:
        own = np.concatenate([np.zeros((1, 3)), earth.ned_between(lla, states[at, 0:3])])
        seen = weights @ earth.ned_between(lla, fixes.lla[rows])
    force = weights @ own - earth.gravity_n(lla[0], lla[2])
    roll, pitch = level(force)
    for _ in range(10):
        push = rotation.matrix_from_euler(roll, pitch, yaw).T @ seen
        roll, pitch = level(force - push)
    return roll, pitch


def _attitude(
    sources: Sources, roll: float, pitch: float, level_std: float, heading: Heading
) -> tuple[Floats, Floats, bool, str]:
    options = sources.options
    stds = np.array([level_std, level_std, heading.std])
    levelled = options.given is None or options.method not in ("auto", "given")
    if options.given is not None and not levelled:
        (roll, pitch, _), stds = options.given, np.array(options.given_std)
    # tilts of a nearly level body: roll and pitch errors turn with yaw
    c = rotation.matrix_from_euler(0.0, 0.0, heading.yaw)
    degrees = np.degrees([roll, pitch, heading.yaw % (2 * np.pi), heading.std])
    text = "roll {:.2f}, pitch {:.2f}, heading {:.2f} deg (standard deviation {:.2f}) from ".format(*degrees)
    q_nb = rotation.quat_from_euler(roll, pitch, heading.yaw)
    return q_nb, c @ np.diag(stds**2) @ c.T, levelled, text + heading.source
