"""Findings from the motion that IMU and GNSS both saw: time offset, leap seconds, unit and sign of the yaw rate, forward
axis."""

from dataclasses import replace

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import YawMatch, match_forward, match_yaw
from navreplay.timeline import GnssFixSeries, ImuSeries

__all__ = ["check_motion"]

_SURE = 0.6
_TOLD_S = 0.15
_STEPS_S = {18.0: "UTC and GPS time", 37.0: "UTC and TAI", 19.0: "GPS time and TAI"}
_LEAST_SECONDS = 20
_AGAINST = 0.5
_OPPOSITE = {"r": "l", "l": "r", "u": "d", "d": "u"}
_ASKEW = np.radians(25.0)


def check_motion(imu: ImuSeries, fixes: GnssFixSeries, axes: str = "") -> list[Finding]:
    """Findings about an IMU and fixes that overlap in time. axes: of the IMU where they were recognised, for proposals."""
    match = match_yaw(imu, fixes)
    if match is None or abs(match.correlation) < _SURE:
        seen = "too few turns" if match is None else f"yaw rate and course agree only to {abs(match.correlation):.2f}"
        text = f"The time offset between IMU and GNSS cannot be estimated from this log ({seen})."
        return [Finding("info", "time-offset", text, "")]
    wrong = _check_mirrored(imu, fixes) if match.slope < 0 and not _turns_against_forces(imu) else []
    wrong = wrong or _check_yaw(match, axes)
    return [_check_offset(match), *(wrong or _check_forward(imu, fixes, match.offset_s))]


def _check_offset(match: YawMatch) -> Finding:
    step = next((step for step in _STEPS_S if abs(abs(match.offset_s) - step) < 0.5), None)
    figure = f"{match.offset_s:+.2f} s (noise {match.std_s:.2f} s, correlation {abs(match.correlation):.2f})"
    if step is not None:
        text = f"IMU and GNSS are {figure} apart in time: one of them is stamped in another of {_STEPS_S[step]}."
        hint = f"Set input.imu.time_base or input.fix.time_base, or else input.imu.time_offset_s = {match.offset_s:.2f}."
        return Finding("error", "leap-seconds", text, hint)
    if abs(match.offset_s) > max(_TOLD_S, 3 * match.std_s):
        text = f"Turns show in the IMU at another time than in the GNSS course: add {figure} to the IMU's stamps."
        hint = (
            f"Set input.imu.time_offset_s = {match.offset_s:.2f} (on top of any you have set), and check it by the residuals."
        )
        return Finding("warning", "time-offset", text, hint)
    if abs(match.offset_s) > _TOLD_S:
        text = f"The time offset between IMU and GNSS is known no better than {figure}: too little turning to tell."
        return Finding("info", "time-offset", text, "")
    return Finding("info", "time-offset", f"IMU and GNSS agree in time, to about 0.1 s: the estimated offset is {figure}.", "")


def _check_mirrored(imu: ImuSeries, fixes: GnssFixSeries) -> list[Finding]:
    """Turns that go the other way on the map than in the gyros: positions that a mirror of the map makes right."""
    lla = fixes.lla
    within = np.nanmax(np.abs(lla[:, 1])) < np.pi / 2
    tried = {
        "latitude and longitude seem to be exchanged": lla[:, [1, 0, 2]] if within else None,
        "the sign of the longitude (or of the latitude) seems to be lost: west or south given without a sign": lla * [1, -1, 1],
    }
    best, words = 0.0, ""
    for text, mirrored in tried.items():
        if mirrored is None:
            continue
        bare = np.full_like(fixes.vel_n, np.nan)
        alone = replace(fixes, lla=mirrored, vel_n=bare, cov_vel=np.full_like(fixes.cov_vel, np.nan))
        match = match_yaw(imu, alone) if alone.has_position.all() else None
        if match is not None and match.slope > 0 and match.correlation > max(best, _SURE) and 0.8 < match.slope < 1.25:
            best, words = match.correlation, text
    if not words:
        return []
    first = np.degrees(lla[np.flatnonzero(fixes.has_position)[0], :2])
    text = (
        f"The fixes turn the other way than the IMU on the map, as if it were mirrored: {words} (the first fix is at latitude "
        f"{first[0]:.6f}, longitude {first[1]:.6f})."
    )
    return [
        Finding("error", "positions-mirrored", text, "Exchange the columns or mend the sign where the log is made or mapped.")
    ]


def _turns_against_forces(imu: ImuSeries) -> bool:
    """Whether the vehicle is pushed to the left where its gyros say it turns to the right: then these are mirrored, not the
    map, since a turn to the right needs a force to the right."""
    step = max(round(1e9 / float(np.median(np.diff(imu.t_ns)))), 1)
    whole = len(imu.t_ns) // step * step
    rate, force = (values[:whole].reshape(-1, step).mean(axis=1) for values in (imu.gyro[:, 2], imu.accel[:, 1]))
    if len(rate) < _LEAST_SECONDS or min(np.std(rate), np.std(force)) == 0:
        return False
    return bool(np.corrcoef(rate, force)[0, 1] < -_AGAINST)


def _other_turns(axes: str) -> str:
    """A setting under which rates about all axes but the forward one change their sign."""
    if not axes:
        return "input.imu.gyro_axes, the letters of input.imu.axes with all but f and b turned round."
    turned = "".join(letter if letter in "fb" else _OPPOSITE[letter] for letter in axes)
    return f"input.imu.gyro_axes = '{turned}' (the accelerations have '{axes}')."


def _check_yaw(match: YawMatch, axes: str) -> list[Finding]:
    if match.slope < 0:
        text = "The yaw rate has the opposite sign of the course rate: axes mirrored, or gyros or gravity inverted."
        hint = (
            "Set input.imu.axes; where the accelerations are right and only turns are counted the other way, set the axes "
            f"of the angular rates: {_other_turns(axes)}"
        )
        return [Finding("error", "yaw-sign", text, hint)]
    if match.slope < 0.05:
        text = (
            f"The course turns {match.slope:.3f} times as fast as the IMU says: its rates seem to be in deg/s, taken for rad/s."
        )
        return [Finding("error", "gyro-unit", text, "Set input.imu.gyro_unit = 'deg/s'.")]
    if match.slope > 20:
        text = (
            f"The course turns {match.slope:.0f} times as fast as the IMU says: its rates seem to be in rad/s, taken for deg/s."
        )
        return [Finding("error", "gyro-unit", text, "Set input.imu.gyro_unit = 'rad/s'.")]
    if not 0.8 < match.slope < 1.25:
        text = (
            f"The course turns {match.slope:.2f} times as fast as the IMU says: a scale error, or an axis that is not vertical."
        )
        return [Finding("warning", "yaw-scale", text, "Check input.imu.axes and input.imu.mounting_deg.")]
    return []


def _check_forward(imu: ImuSeries, fixes: GnssFixSeries, offset_s: float) -> list[Finding]:
    match = match_forward(imu, fixes, offset_s)
    if match is None or match.correlation < _SURE or abs(match.angle) < _ASKEW:
        return []
    angle = float(np.degrees(match.angle))
    text = (
        f"When the vehicle gains speed, the IMU feels it {abs(angle):.0f} degrees to the {'right' if angle > 0 else 'left'} "
        "of its x axis: that axis does not point forward."
    )
    return [Finding("warning", "forward-axis", text, "Set input.imu.axes, or the yaw of input.imu.mounting_deg.")]
