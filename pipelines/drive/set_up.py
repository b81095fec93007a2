"""What a log tells of its own set-up, found before it is filtered: direction of travel in the IMU's axes, time offset."""

from dataclasses import replace
from math import degrees

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import match_forward, match_yaw
from navreplay.options import FilterOptions
from navreplay.timeline import Timeline
from pipelines.config.spec import Config, filter_options
from pipelines.drive.time_offset import settle_time_offset

__all__ = ["find_set_up", "options_of"]

_SURE = 0.7
_ASKEW = np.radians(25.0)


def find_set_up(timeline: Timeline, config: Config) -> tuple[Timeline, float, tuple[Finding, ...]]:
    """The timeline with the IMU's stamps moved where that is proven; the direction of travel in the body's x-y plane, from x to
    the right [rad], 0 where nothing else is proven; and what was found."""
    imu, fixes = timeline.imu, timeline.fixes
    if imu is None or fixes is None or timeline.ranges is not None or not fixes.has_position.any():
        return timeline, 0.0, ()
    match = match_yaw(imu, fixes)
    if match is None:
        return timeline, 0.0, ()
    ahead = match_forward(imu, fixes, match.offset_s) if abs(match.correlation) > _SURE and match.slope > 0 else None
    plain = ahead is not None and ahead.correlation > _SURE and abs(ahead.angle) > _ASKEW
    forward, findings = 0.0, ()
    if ahead is not None and plain and config.alignment.forward_deg is None:
        forward, findings = ahead.angle, (_tell_forward(ahead.angle),)
    moved, told = settle_time_offset(timeline, match, options_of(config, forward))
    return moved, forward, (*findings, *told)


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
