"""Checks of a timeline before any filtering."""

from importers.findings import Finding
from navreplay.timeline import Timeline

__all__ = ["Finding", "preflight"]


def preflight(timeline: Timeline) -> tuple[Finding, ...]:
    """All findings about a timeline, errors first."""
    findings: list[Finding] = []
    if timeline.imu is None:
        findings.append(Finding("error", "no-imu", "The log holds no IMU channel.", "Name it with input.imu.channel."))
    return tuple(findings)
