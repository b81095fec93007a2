"""Checks of a timeline before any filtering: each finding is a plain sentence with the likely cause, and what to set."""

from typing import Literal

import numpy as np

from importers.findings import Finding
from importers.preflight.attitudes import check_attitudes
from importers.preflight.motion import check_motion
from importers.preflight.ranges import check_ranges
from navreplay.geodesy.earth import gravity
from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.timeline import GnssFixSeries, ImuSeries, Timeline, Times, Trajectory

__all__ = ["Finding", "preflight"]

_STEADY = 0.05
_RAW = (
    "Record the raw accelerometer output (of a phone 'accelerometer', not 'linear acceleration'); a filter needs gravity in it."
)
_LEVELS = ("error", "warning", "info")
_LEAST_RATE_HZ = 20.0
_GAP_FACTOR = 3.0
_LONG_GAP_S = 0.5
_JUMP_S = 3600.0
_GEOID_BIAS_M = 8.0
_HORIZONTAL = (("forward", "back"), ("right", "left"))


_MAPPING = "messages of another type are described by [[input.message]], which navreplay init drafts"


def preflight(timeline: Timeline) -> tuple[Finding, ...]:
    """All findings about a timeline, errors first, one of a kind."""
    findings: list[Finding] = []
    imu, fixes, reference = timeline.imu, timeline.fixes, timeline.reference
    seen = ", ".join(f"{use.name} ({use.type})" for use in timeline.provenance.channels) or "no channel at all"
    if imu is None:
        # ranges alone suffice for a GNSS-only filter
        level: Literal["warning", "error"] = "error" if timeline.ranges is None else "warning"
        hint = f"Add the file that holds the IMU, or name its channel with input.imu.channel; {_MAPPING}."
        findings.append(Finding(level, "no-imu", f"There is no IMU in the log; it holds {seen}.", hint))
    else:
        in_space = timeline.attitude is not None and timeline.attitude.frame == "earth"
        # a body that flies by the stars may stand on its tail or fall freely
        findings += [*([] if in_space else _check_gravity(imu, fixes)), *_check_gyro(imu), *_check_rate(imu)]
    if timeline.ranges is not None:
        findings += check_ranges(timeline.ranges, timeline.provenance.channels)
    if imu is not None and timeline.attitude is not None:
        findings += check_attitudes(timeline.attitude, imu)
    if fixes is None and timeline.ranges is None and timeline.attitude is not None:
        text = "There are no GNSS fixes in the log: attitudes alone leave position and velocity to the inertial sensors."
        hint = "Set alignment.position_deg_m and alignment.velocity_mps; expect the position to drift."
        findings.append(Finding("info", "no-gnss", text, hint))
    elif fixes is None and timeline.ranges is None:
        hint = f"Add the file that holds the fixes, or name their channel with input.fix.channel; {_MAPPING}."
        findings.append(Finding("error", "no-gnss", f"There are no GNSS fixes in the log; it holds {seen}.", hint))
    elif fixes is not None:
        findings += _check_covariance(fixes)
    if imu is not None and fixes is not None:
        apart = _check_overlap(imu, fixes)
        findings += apart or check_motion(imu, fixes, dict(timeline.provenance.recognised).get("input.imu.axes", ""))
    if reference is not None:
        findings += _check_reference(reference, imu, fixes)
    once: dict[str, Finding] = {}
    for finding in findings:
        once.setdefault(finding.code, finding)
    return tuple(sorted(once.values(), key=lambda finding: _LEVELS.index(finding.level)))


def _check_gravity(imu: ImuSeries, fixes: GnssFixSeries | None) -> list[Finding]:
    force = np.median(imu.accel, axis=0)
    size = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    expected = _local_gravity(fixes)
    if np.linalg.norm(force) < _STEADY * expected and size < 0.5 * expected:
        text = (
            f"The specific force is usually {size:.2f} m/s^2 and points everywhere, with a median of only "
            f"{np.linalg.norm(force):.2f} m/s^2: gravity has been removed from the accelerations."
        )
        return [Finding("error", "no-gravity", text, _RAW)]
    if abs(size - 1) < 0.15:
        text = f"The specific force is usually {size:.3f}, not {expected:.2f} m/s^2: the accelerometers seem to be in g."
        return [Finding("error", "accel-unit", text, "Set input.imu.accel_unit = 'g'.")]
    if size < 0.2 * expected:
        text = (
            f"The specific force is usually only {size:.2f} m/s^2: gravity seems to have been removed from the accelerations."
        )
        return [Finding("error", "no-gravity", text, _RAW)]
    if abs(size / expected - 1) > 0.3:
        text = (
            f"The specific force is usually {size:.4g} m/s^2 where gravity is {expected:.2f}: its unit is probably another one."
        )
        return [Finding("error", "accel-unit", text, "Set input.imu.accel_unit, or scale the column to m/s^2.")]
    found = []
    if abs(size / expected - 1) > 0.03:
        text = (
            f"The specific force is usually {size:.3f} m/s^2 where gravity is {expected:.3f} "
            f"({100 * (size / expected - 1):+.1f} %): a scale error, a large bias, or vibration."
        )
        hint = "Nothing need be set; expect larger accelerometer biases than usual."
        found.append(Finding("warning", "gravity-size", text, hint))
    return found + _check_direction(force / max(float(np.linalg.norm(force)), 1e-9))


def _check_direction(up: np.ndarray) -> list[Finding]:
    """up: unit vector of the specific force in body axes; (0, 0, -1) when level."""
    if up[2] > 0.7:
        text = (
            "The specific force points along +z of the body: the IMU is upside down, or its axes are forward-left-up and were "
            "taken for forward-right-down."
        )
        return [Finding("error", "upside-down", text, "Set input.imu.axes = 'flu' (or 'frd' where 'flu' was assumed).")]
    for axis in (0, 1):
        if abs(up[axis]) > 0.7:
            taken = _HORIZONTAL[axis][int(up[axis] < 0)]
            text = (
                f"Gravity lies on a horizontal axis: what is taken for {taken} is up by the specific force, so the IMU is "
                "mounted on its side."
            )
            hint = f"Set input.imu.axes: the sensor axis taken for '{taken[0]}' is 'u'; look at the mounting for the other two."
            return [Finding("error", "gravity-horizontal", text, hint)]
    tilt = float(np.degrees(np.arccos(np.clip(-up[2], -1, 1))))
    if tilt > 15:
        text = f"The IMU is usually tilted by {tilt:.0f} degrees against level: it is probably mounted askew."
        return [Finding("warning", "tilted", text, "Set input.imu.mounting_deg to its roll, pitch and yaw in the vehicle.")]
    return []


def _local_gravity(fixes: GnssFixSeries | None) -> float:
    if fixes is None or not fixes.has_position.any():
        return 9.80665
    lla = fixes.lla[fixes.has_position][0]
    return float(gravity(lla[0], lla[2]))


def _check_gyro(imu: ImuSeries) -> list[Finding]:
    rate = np.linalg.norm(imu.gyro, axis=1)
    middle, peak = float(np.median(rate)), float(np.quantile(rate, 0.999))
    if middle < 1.0 and peak < 20.0:
        return []
    text = f"The angular rate has a median of {middle:.2f} and a peak of {peak:.1f} rad/s: it seems to be in deg/s."
    return [Finding("error", "gyro-unit", text, "Set input.imu.gyro_unit = 'deg/s'.")]


def _check_rate(imu: ImuSeries) -> list[Finding]:
    if len(imu) < 3:
        return [Finding("error", "short-imu", f"The IMU has only {len(imu)} samples.", "Use a longer log.")]
    interval = np.diff(imu.t_ns) / 1e9
    nominal = float(np.median(interval))
    found = []
    if 1 / nominal < _LEAST_RATE_HZ:
        text = f"The IMU runs at only {1 / nominal:.1f} Hz: turns and vibration between its samples are lost."
        found.append(Finding("warning", "imu-rate", text, "Record it at 50 Hz or more."))
    gaps = np.flatnonzero(interval > _GAP_FACTOR * nominal)
    if len(gaps) == 0:
        return found
    at = int(gaps[np.argmax(interval[gaps])])
    longest = float(interval[at])
    if longest > _JUMP_S:
        text = f"The IMU's time jumps by {longest / 3600:.2f} h at {_utc(imu.t_ns[at])}: its clock was probably set there."
        return [
            *found,
            Finding("warning", "time-jump", text, "Cut the log there, or use the recorder's time: input.imu.stamp = 'log'."),
        ]
    times = f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}"
    text = (
        f"The IMU has {times} of more than {_GAP_FACTOR * nominal:.3g} s, the longest {longest:.3g} s at {_utc(imu.t_ns[at])}."
    )
    hint = "Short gaps are bridged; what becomes of long ones is set with the gap options of the filter."
    return [*found, Finding("warning" if longest > _LONG_GAP_S else "info", "imu-gaps", text, hint)]


def _check_covariance(fixes: GnssFixSeries) -> list[Finding]:
    n = int(fixes.has_position.sum())
    unknown = int((fixes.has_position & np.isnan(fixes.cov_pos[:, 0, 0])).sum())
    if unknown == 0:
        return []
    text = f"{unknown} of {n} fixes do not tell their accuracy (a covariance of zero means unknown)."
    hint = (
        "The accuracy usual for their status is assumed; set the default standard deviations of the filter if you know better."
    )
    return [Finding("warning" if unknown == n else "info", "unknown-covariance", text, hint)]


def _check_overlap(imu: ImuSeries, fixes: GnssFixSeries) -> list[Finding]:
    inside = (fixes.t_ns >= imu.t_ns[0]) & (fixes.t_ns <= imu.t_ns[-1])
    if inside.mean() > 0.5:
        return []
    spans = f"IMU {_span(imu.t_ns)}, GNSS {_span(fixes.t_ns)}"
    hint = "Check that the files belong together; set input.imu.time_base, input.fix.time_base or input.imu.time_offset_s."
    if inside.any():
        text = f"Only {int(inside.sum())} of {len(fixes)} fixes lie within the time of the IMU ({spans})."
        return [Finding("warning", "little-overlap", text, hint)]
    apart = (int(fixes.t_ns[0]) - int(imu.t_ns[0])) / 1e9
    text = f"IMU and GNSS do not overlap in time; they begin {apart:.6g} s apart ({spans}): other drives, or other time bases."
    return [Finding("error", "no-overlap", text, hint)]


def _check_reference(reference: Trajectory, imu: ImuSeries | None, fixes: GnssFixSeries | None) -> list[Finding]:
    series = imu if imu is not None else fixes
    if series is None:
        return []
    inside = (reference.t_ns >= series.t_ns[0]) & (reference.t_ns <= series.t_ns[-1])
    spans = f"reference {_span(reference.t_ns)}, log {_span(series.t_ns)}"
    hint = "Check that it belongs to this log; set input.reference.time_base or input.reference.time_offset_s."
    if not inside.any():
        text = f"The reference does not overlap the log in time ({spans}): another drive, or another time base."
        return [Finding("error", "no-reference-overlap", text, hint)]
    found = []
    covered = (series.t_ns >= reference.t_ns[0]) & (series.t_ns <= reference.t_ns[-1])
    if covered.mean() < 0.5:
        text = f"The reference covers only {100 * covered.mean():.0f} % of the log ({spans})."
        found.append(Finding("warning", "little-reference", text, hint))
    return found + ([] if fixes is None else _check_heights(reference, fixes))


def _check_heights(reference: Trajectory, fixes: GnssFixSeries) -> list[Finding]:
    chosen = fixes.has_position & (fixes.t_ns >= reference.t_ns[0]) & (fixes.t_ns <= reference.t_ns[-1])
    if chosen.sum() < 5:
        return []
    origin = reference.t_ns[0]
    height = np.interp((fixes.t_ns[chosen] - origin) / 1e9, (reference.t_ns - origin) / 1e9, reference.lla[:, 2])
    difference = fixes.lla[chosen, 2] - height
    bias = float(np.median(difference))
    scatter = float(np.median(np.abs(difference - bias)))
    if abs(bias) < _GEOID_BIAS_M or scatter > abs(bias) / 3:
        return []
    text = f"The fixes are {bias:+.1f} m above the reference throughout: one of the two is probably above mean sea level."
    hint = "Set input.fix.height = 'msl' and input.fix.geoid_separation_m, or convert the reference to ellipsoidal heights."
    return [Finding("warning", "geoid-height", text, hint)]


def _span(t_ns: Times) -> str:
    return f"{_utc(t_ns[0])} to {_utc(t_ns[-1])}"


def _utc(t_ns: np.int64) -> str:
    return str(utc_from_gps(np.array([t_ns]))[0].astype("datetime64[ns]").astype("datetime64[ms]")) + "Z"
