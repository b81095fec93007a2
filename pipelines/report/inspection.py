"""An inspection of logs as text for the terminal and as plain values for programs."""

from dataclasses import asdict

import numpy as np

from importers.inspection import ChannelInfo, Inspection
from navreplay.geodesy.time_scales import utc_from_gps

__all__ = ["describe_inspection", "inspection_values"]

_HEADINGS = ("channel", "type", "messages", "rate", "gaps", "longest", "start (UTC)", "duration", "stamps", "used as")


def inspection_values(inspection: Inspection) -> dict[str, object]:
    """Files, channels, findings, candidates and assumptions as JSON knows them."""
    return asdict(inspection)


def describe_inspection(inspection: Inspection) -> list[str]:
    """Lines: the files, a table of the channels, what was assumed, what a setting has to decide, and the findings."""
    lines = [f"{file.path}: {file.format}, {_size(file.size)}" for file in inspection.files]
    several = len(inspection.files) > 1
    rows = [_HEADINGS, *(_describe_channel(channel, several) for channel in inspection.channels)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADINGS))]
    lines += ["", *("  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip() for row in rows)]
    if inspection.assumptions:
        lines += ["", "assumed:", *(f"  {text}" for text in inspection.assumptions)]
    if inspection.findings:
        lines += ["", "findings:"]
        lines += [f"  {finding.level}: {finding.text} {finding.hint}".rstrip() for finding in inspection.findings]
    return lines


def _describe_channel(channel: ChannelInfo, several: bool) -> tuple[str, ...]:
    timed = channel.first_ns is not None and channel.last_ns is not None
    return (
        f"{channel.file}: {channel.name}" if several and channel.file != channel.name else channel.name,
        channel.type,
        "?" if channel.count is None else str(channel.count),
        "" if channel.rate_hz is None else f"{channel.rate_hz:.4g} Hz",
        str(channel.gaps) if timed else "",
        "" if channel.largest_gap_s is None else f"{channel.largest_gap_s:.3g} s",
        "" if channel.first_ns is None else _utc(channel.first_ns),
        f"{(channel.last_ns - channel.first_ns) / 1e9:.1f} s"
        if channel.first_ns is not None and channel.last_ns is not None
        else "",
        channel.time_base,
        channel.role,
    )


def _utc(t_ns: int) -> str:
    utc_ns = int(utc_from_gps(np.array([t_ns]))[0])
    return str(np.datetime64(utc_ns, "ns").astype("datetime64[s]")).replace("T", " ")


def _size(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{size / 1e3:.1f} kB"
