"""Vetting of a timeline: every comparison in turn, with the accounting of what it left out."""

from collections.abc import Sequence
from dataclasses import replace

from importers.findings import Finding
from importers.vetting.accuracy import check_told_accuracy
from importers.vetting.axes import turn_upright
from importers.vetting.heights import heights_in_metres
from importers.vetting.jumps import leave_out_jumps
from importers.vetting.repeats import leave_out_repeats
from importers.vetting.undated import set_to_fixes
from importers.vetting.velocities import vet_velocities
from importers.vetting.vetted import Vetted
from importers.vetting.weeks import unroll_weeks
from navreplay.timeline import ChannelUse, Timeline

__all__ = ["vet"]

_AXES_OPEN = {"sensor_msgs/Imu", "csv/imu", "message/imu"}
"""Types whose axes are a custom at best; those of a layout or a receiver of its own are defined."""


def vet(timeline: Timeline) -> tuple[Timeline, tuple[Finding, ...]]:
    """The timeline to use, and what was found wrong with the one that was read.

    The reference is never touched. In the accounting of channels a row that is left out whole is rejected, with the reason.
    """
    timeline, dated = _dated(timeline)
    timeline, upright = _upright(timeline)
    upright = (*dated, *upright)
    fixes = timeline.fixes
    if fixes is None:
        return timeline, upright
    unrolled = unroll_weeks(fixes, timeline.imu)
    fixes, findings = unrolled.fixes, [*upright, *unrolled.findings]
    channels = timeline.provenance.channels
    for step in (leave_out_repeats, heights_in_metres, vet_velocities, leave_out_jumps):
        vetted = step(fixes)
        channels = _account(channels, vetted)
        fixes = vetted.fixes
        findings += vetted.findings
    findings += check_told_accuracy(fixes)
    if not findings:
        return timeline, ()
    return replace(timeline, fixes=fixes, provenance=replace(timeline.provenance, channels=channels)), tuple(findings)


def _dated(timeline: Timeline) -> tuple[Timeline, tuple[Finding, ...]]:
    """The timeline with an IMU that counts from power-on set to the time of the fixes, where their turns tell it."""
    if timeline.imu is None or timeline.fixes is None:
        return timeline, ()
    found = set_to_fixes(timeline.imu, timeline.fixes)
    return (timeline, ()) if found is None else (replace(timeline, imu=found[0]), (found[1],))


def _upright(timeline: Timeline) -> tuple[Timeline, tuple[Finding, ...]]:
    """The timeline with the IMU in axes that gravity agrees with, where nobody told them; a body that is told its attitude may
    lie as it likes."""
    recognised = dict(timeline.provenance.recognised)
    types = {use.type.replace("/msg/", "/") for use in timeline.provenance.channels if use.role == "imu"}
    promised = not types or not types <= _AXES_OPEN
    if timeline.imu is None or timeline.attitude is not None or promised or "input.imu.axes" not in recognised:
        return timeline, ()
    found = turn_upright(timeline.imu, timeline.fixes, recognised["input.imu.axes"])
    if found is None:
        return timeline, ()
    imu, axes, finding = found
    provenance = replace(timeline.provenance, recognised=tuple((recognised | {"input.imu.axes": axes}).items()))
    return replace(timeline, imu=imu, provenance=provenance), (finding,)


def _account(channels: Sequence[ChannelUse], vetted: Vetted) -> tuple[ChannelUse, ...]:
    """The accounting of the channels that gave the fixes, with the rows rejected by the step."""
    apart = any(use.role == "velocity" for use in channels)
    gone = {"fix": vetted.positions_out if apart else vetted.rows_out, "velocity": vetted.velocities_out}
    complete = []
    for use in channels:
        count = min(gone.get(use.role, 0), use.used)
        if count:
            rejected = {**use.rejected, vetted.reason: use.rejected.get(vetted.reason, 0) + count}
            use = replace(use, used=use.used - count, rejected=rejected)
        complete.append(use)
    return tuple(complete)
