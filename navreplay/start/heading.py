"""Initial heading: told, from another sensor, from a gyrocompass, or from GNSS velocity."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.geodesy import earth, rotation
from navreplay.measurements.attitudes import attitude_nb
from navreplay.mechanisation.strapdown import NavState, integrate_steps, make_steps
from navreplay.options import AlignmentOptions, ImuNoise
from navreplay.start.ground_motion import fix_velocity
from navreplay.timeline import AttitudeSeries, Floats, GnssFixSeries, ImuSeries, LogError, Times, Trajectory

__all__ = ["Heading", "Sources", "course_heading", "gyrocompass", "known_heading", "match_course", "unknown_heading"]

_SETTING_OFF_NS = 10_000_000_000
_NEAR_NS = 2_000_000_000


class Heading(NamedTuple):
    """yaw [rad], its standard deviation [rad], where it came from, a warning or an empty string, and whether nothing else need
    be tried."""

    yaw: float
    std: float
    source: str
    warning: str = ""
    sure: bool = True


@dataclass(frozen=True, eq=False, slots=True)
class Sources:
    """What an alignment may draw on."""

    imu: ImuSeries
    fixes: GnssFixSeries
    attitude: AttitudeSeries | None
    reference: Trajectory | None
    noise: ImuNoise
    options: AlignmentOptions


def known_heading(sources: Sources, t_ns: int) -> Heading | None:
    """Heading at t_ns that needs no motion, from configuration, reference or attitude channel; None if none applies.

    Raises LogError when the chosen method lacks its input.
    """
    options, told_std = sources.options, sources.options.given_std[2]
    if options.method == "given" or (options.method == "auto" and options.given is not None):
        if options.given is None:
            raise LogError("alignment: method is 'given' without angles; set alignment.given_deg = [roll, pitch, yaw]")
        return Heading(options.given[2], told_std, "the configuration")
    if options.method == "reference":
        reference = sources.reference
        known = np.zeros(0, dtype=bool) if reference is None else np.isfinite(reference.q_nb).all(axis=1)
        if reference is None or not known.any():
            raise LogError("alignment: method is 'reference', but the reference holds no attitude; choose another")
        row = _nearest(t_ns, reference.t_ns[known])
        return Heading(float(rotation.euler_from_quat(reference.q_nb[known][row])[2]), told_std, "the reference")
    attitude = sources.attitude
    if attitude is None and options.method == "attitude":
        raise LogError("alignment: method is 'attitude', but the log holds no attitude; set input.attitude.channel")
    if attitude is None or options.method not in ("auto", "attitude"):
        return None
    row = _nearest(t_ns, attitude.t_ns)
    nearest_fix = int(
        np.argmin(np.where(sources.fixes.has_position, np.abs(sources.fixes.t_ns - t_ns), np.iinfo(np.int64).max))
    )
    q_nb, c_nf = attitude_nb(attitude, row, sources.fixes.lla[nearest_fix])
    variance = float(c_nf[2] @ attitude.cov[row] @ c_nf[2])
    std = float(np.sqrt(variance)) if np.isfinite(variance) else told_std
    return Heading(float(rotation.euler_from_quat(q_nb)[2]), std, "the attitude channel", sure=False)


def _nearest(t_ns: int, times: Times) -> int:
    nearest = int(np.argmin(np.abs(times - t_ns)))
    if abs(int(times[nearest]) - t_ns) > _NEAR_NS:
        raise LogError("alignment: no attitude within 2 s of the first fix; choose another alignment.method")
    return nearest


def gyrocompass(sources: Sources, gyro: Floats, gyro_std: float, roll: float, pitch: float, lat: float) -> Heading | None:
    """Heading from the mean rate gyro (3,) [rad/s] of a standstill, known to gyro_std beside its bias; None if too uncertain.

    Groves (2013), 5.6.2. Raises LogError when a gyrocompass was demanded of gyros that cannot give it.
    """
    std = float(np.hypot(sources.noise.gyro_bias_std, gyro_std) / (earth.EARTH_RATE * np.cos(lat)))
    if std > sources.options.max_gyrocompass_std:
        if sources.options.method == "gyrocompass":
            raise LogError(
                f"alignment: a gyrocompass with these gyros would err by {np.degrees(std):.3g} deg; set alignment.method = "
                "'course', or tell the gyro's real bias in [imu]"
            )
        return None
    rate = rotation.matrix_from_euler(roll, pitch, 0.0) @ gyro
    return Heading(float(np.arctan2(-rate[1], rate[0])), std, "the gyrocompass")


def match_course(sources: Sources, start: NavState, t_ns: int, moving: np.ndarray, drift: float) -> Heading:
    """Heading at t_ns, at rest: course over ground against yaw integrated from start (yaw zero), as motion begins.

    moving (k,): fixes that have a course. drift [rad]: what the gyros may have turned falsely by then. The velocity
    integrated from rest, against the GNSS velocity, shows whether the vehicle set off backwards, or that the sensor's axes
    point elsewhere than the configuration says.
    """
    imu, fixes, options = sources.imu, sources.fixes, sources.options
    epochs = np.flatnonzero(moving & (fixes.t_ns > t_ns) & (fixes.t_ns < imu.t_ns[-1]))
    if not len(epochs):
        return unknown_heading(options)
    epochs = epochs[fixes.t_ns[epochs] <= fixes.t_ns[epochs[0]] + _SETTING_OFF_NS]
    at_rest = max(t_ns, int(fixes.t_ns[epochs[0]]) - _SETTING_OFF_NS)
    last = int(np.searchsorted(imu.t_ns, fixes.t_ns[epochs[-1]])) + 1
    imu = ImuSeries(imu.t_ns[:last], imu.gyro[:last], imu.accel[:last], imu.increments)
    steps = make_steps(imu, np.append(fixes.t_ns[epochs], [t_ns, at_rest])).after(t_ns)
    x = integrate_steps(steps, start)
    index = np.searchsorted(steps.t_ns, fixes.t_ns[epochs])
    base = int(np.searchsorted(steps.t_ns, at_rest))
    velocity = fix_velocity(fixes)[epochs]
    gnss = velocity[:, 0] + 1j * velocity[:, 1]
    yaw = rotation.euler_from_quat(x[index, 6:10])[:, 2]
    mean = complex(np.average(gnss / np.abs(gnss) * np.exp(-1j * yaw), weights=np.abs(gnss)))
    scatter = float(np.sqrt(max(0.0, -2 * np.log(min(1.0, abs(mean))))))
    std = float(np.sqrt(options.course_std**2 + drift**2 + scatter**2))
    inertial = (x[index, 3] - x[base, 3]) + 1j * (x[index, 4] - x[base, 4])
    return _judge(float(np.angle(mean)) - options.forward, float(np.angle(np.sum(gnss * np.conj(inertial)))), std)


def _judge(course: float, matched: float, std: float) -> Heading:
    off = abs(float(rotation.wrap_angle(matched - course)))
    if off > np.radians(135):
        return Heading(course + np.pi, std, "the course over ground, setting off backwards")
    if off > np.radians(40):
        away = np.degrees(float(rotation.wrap_angle(course - matched)))
        warning = (
            f"the direction of travel lies {away:.0f} deg to the right of the IMU's x axis, as the first acceleration shows; "
            "check input.imu.axes and input.imu.mounting_deg"
        )
        return Heading(matched, max(std, float(np.radians(15))), "the first acceleration", warning)
    return Heading(course, std, "the course over ground")


def course_heading(velocity: Floats, options: AlignmentOptions) -> Heading:
    """Heading of a vehicle that moves with velocity (3,) NED [m/s]."""
    yaw = float(np.arctan2(velocity[1], velocity[0])) - options.forward
    return Heading(yaw, max(options.course_std, float(np.radians(5))), "the course over ground")


def unknown_heading(options: AlignmentOptions) -> Heading:
    """North, with the standard deviation of a uniform angle and a warning. Raises LogError if another method was demanded."""
    if options.method not in ("auto", "course"):
        raise LogError(f"alignment: method '{options.method}' found no heading; choose another alignment.method")
    warning = (
        "heading is unknown: no motion of the fixes stands out of their noise; give it with alignment.given_deg, or take a "
        "log that goes on until the vehicle moves"
    )
    return Heading(0.0, float(np.pi / np.sqrt(3)), "nowhere (unknown)", warning)
