"""Wheel speeds made those of the vehicle before any filter runs: scale, delay and track fitted to fixes and gyro, and told."""

from dataclasses import replace

import numpy as np

from importers.findings import Finding
from navreplay.calibration.wheels import WheelFit, apply_fit, fit_speed, fit_turn
from navreplay.timeline import SpeedSeries, Timeline
from pipelines.config.spec import Config

__all__ = ["settle_wheels"]

_DOWN = np.array([0.0, 0.0, 1.0])
_LEAST_TURN_STD = 0.01


def settle_wheels(timeline: Timeline, config: Config) -> tuple[Timeline, tuple[Finding, ...]]:
    """The timeline with wheel speeds in metres per second and at their times; without them where neither a scale is told nor
    the fixes bear one out. And what was found."""
    wheels, fixes = timeline.speed, timeline.fixes
    if wheels is None:
        return timeline, ()
    told = config.input.speed.scale
    fit = None if fixes is None else fit_speed(wheels, fixes)
    if fit is None:
        if told is not None:
            return replace(timeline, speed=_settle_turn(wheels, timeline, config)), ()
        text = "The wheel speeds are not used: they do not follow the speed of the fixes, or too few fixes know one in motion."
        hint = "Set input.speed.scale and input.speed.time_offset_s, or input.speed.channel = 'none'."
        return replace(timeline, speed=None), (Finding("warning", "wheel-speed", text, hint),)
    settled = apply_fit(wheels, fit._replace(scale=1.0) if told is not None else fit)
    return replace(timeline, speed=_settle_turn(settled, timeline, config)), (_tell(fit, told is not None),)


def _settle_turn(wheels: SpeedSeries, timeline: Timeline, config: Config) -> SpeedSeries:
    """With turns in rad/s, or without where the gyro does not bear them out."""
    if not np.isfinite(wheels.turn).any() or timeline.imu is None:
        return wheels
    found = fit_turn(wheels, timeline.imu, _DOWN)
    if found is None:
        return replace(wheels, turn=np.full(len(wheels), np.nan))
    scale = 1.0 if config.input.speed.track_m is not None else found[0]
    return replace(wheels, turn=wheels.turn * scale, turn_std=max(found[1], _LEAST_TURN_STD))


def _tell(fit: WheelFit, told: bool) -> Finding:
    quantum = f", in steps of {fit.quantum:.2g} m/s" if fit.quantum else ""
    kept = " (the told one is kept)" if told else ""
    text = (
        f"Wheel speeds follow the fixes' with a scale of {fit.scale:.4g}{kept}; {fit.delay:+.2f} s are added to their "
        f"stamps, and they agree within {fit.std:.2f} m/s{quantum}, as {fit.fixes} fixes show."
    )
    return Finding("info", "wheel-speed", text, "")
