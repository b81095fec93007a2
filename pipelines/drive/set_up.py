"""What a log tells of its own set-up, found before it is filtered: direction of travel in the IMU's axes, time offset."""

from dataclasses import replace
from math import degrees

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import match_forward, match_yaw
from navreplay.measurements.least_squares import fixes_of, solve_points
from navreplay.options import FilterOptions
from navreplay.timeline import LogError, Timeline
from pipelines.config.spec import Config, filter_options
from pipelines.drive.time_offset import settle_time_offset

__all__ = ["find_set_up", "options_of"]

_SURE = 0.7
_ASKEW = np.radians(25.0)


def find_set_up(timeline: Timeline, config: Config) -> tuple[Timeline, float, tuple[Finding, ...]]:
    """The timeline with the IMU's stamps moved where that is proven; the direction of travel in the body's x-y plane, from x to
    the right [rad], 0 where nothing else is proven; and what was found."""
    seen = _with_points(timeline, config)
    imu, fixes = seen.imu, seen.fixes
    if imu is None or fixes is None or not fixes.has_position.any():
        return timeline, 0.0, ()
    match = match_yaw(imu, fixes)
    if match is None:
        return timeline, 0.0, ()
    ahead = match_forward(imu, fixes, match.offset_s) if abs(match.correlation) > _SURE and match.slope > 0 else None
    plain = ahead is not None and ahead.correlation > _SURE and abs(ahead.angle) > _ASKEW
    forward, findings = 0.0, ()
    if ahead is not None and plain and config.alignment.forward_deg is None:
        forward, findings = ahead.angle, (_tell_forward(ahead.angle),)
    moved, told = settle_time_offset(seen, match, options_of(config, forward))
    return timeline if moved is seen else replace(timeline, imu=moved.imu), forward, (*findings, *told)


def _with_points(timeline: Timeline, config: Config) -> Timeline:
    """The timeline with least-squares positions of single epochs in the place of ranges that are to aid the filter."""
    if timeline.ranges is None or timeline.imu is None or config.filter.use == "fixes":
        return timeline
    try:
        points, _, _ = solve_points(timeline.ranges, options_of(config, 0.0).ranges)
        return replace(timeline, fixes=fixes_of(points), ranges=None)
    except LogError:  # too few satellites for positions: then nothing is told of the set-up, and the filter says why
        return replace(timeline, fixes=None, ranges=None)


def options_of(config: Config, forward: float) -> FilterOptions:
    """The filter's options of a configuration, with the direction of travel that the log shows where none is configured."""
    options = filter_options(config)
    if config.alignment.forward_deg is not None:
        return options
    return replace(options, alignment=replace(options.alignment, forward=forward))


def _tell_forward(angle: float) -> Finding:
    off = abs(degrees(angle))
    text = (
        f"When the vehicle gains speed, the IMU feels it {off:.0f} degrees to the {'right' if angle > 0 else 'left'} of its "
        f"x axis: "
        "that axis does not point forward. The heading at the start reckons with it."
    )
    return Finding("warning", "forward-axis", text, "Set input.imu.axes, or the yaw of input.imu.mounting_deg, to keep it.")
