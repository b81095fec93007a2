"""Findings about raw ranges: satellites, C/N0, gaps, coverage by ephemerides, jumps of the receiver's clock."""

import numpy as np

from importers.findings import Finding
from importers.satellites.states import FAULTS
from navreplay.timeline import ChannelUse, Floats, RangeSeries, Times

__all__ = ["check_ranges", "clock_jumps"]

_NAMES = {"G": "GPS", "R": "GLONASS", "E": "Galileo", "C": "BeiDou", "J": "QZSS"}
_GAP_FACTOR = 3.0
_JUMP_M = 3e4
"""A tenth of a millisecond: no receiver moves so far beside its range rate."""
_POOR_COVERAGE = 0.2


def check_ranges(ranges: RangeSeries, channels: tuple[ChannelUse, ...]) -> list[Finding]:
    """What there is, and what is odd about it."""
    starts = ranges.epoch_starts
    times, counts = ranges.t_ns[starts[:-1]], np.diff(starts)
    findings = [_describe(ranges, counts), *_check_gaps(times), *_check_coverage(channels)]
    if counts.max() < 4:
        text = f"There are never more than {counts.max()} satellites at a time; a position of its own needs four."
        findings.append(Finding("warning", "few-satellites", text, "Give an initial position, or use more systems."))
    jumps, sizes = clock_jumps(ranges)
    if len(jumps):
        text = f"The receiver's clock jumps {len(jumps)} times, by {np.median(np.abs(sizes)) / 299_792.458:.3g} ms as a rule."
        findings.append(Finding("info", "clock-jumps", text, ""))
    return findings


def clock_jumps(ranges: RangeSeries) -> tuple[Times, Floats]:
    """Times (k,) and sizes (k,) [m] of steps that most pseudoranges take together against their range rates."""
    order = np.lexsort((ranges.t_ns, ranges.sat))
    sat, t_ns = ranges.sat[order], ranges.t_ns[order]
    elapsed = np.diff(t_ns) * 1e-9
    rate = (ranges.range_rate[order][1:] + ranges.range_rate[order][:-1]) / 2
    step = np.diff(ranges.pseudorange[order]) - rate * elapsed
    usable = (sat[1:] == sat[:-1]) & (elapsed > 0) & np.isfinite(step)
    usable &= elapsed <= _GAP_FACTOR * _interval(ranges.t_ns[ranges.epoch_starts[:-1]])
    times, epoch = np.unique(t_ns[1:][usable], return_inverse=True)
    seen = np.bincount(epoch, minlength=len(times))
    jumped = np.bincount(epoch, np.abs(step[usable]) > _JUMP_M, minlength=len(times))
    most = np.flatnonzero(jumped * 2 > seen)
    sizes = np.array([np.median(step[usable][epoch == place]) for place in most])
    return times[most], sizes


def _describe(ranges: RangeSeries, counts: np.ndarray) -> Finding:
    systems, inverse = np.unique(ranges.sat.astype("U1"), return_inverse=True)
    sats = [len(np.unique(ranges.sat[inverse == i])) for i in range(len(systems))]
    listed = ", ".join(f"{count} of {_NAMES.get(str(name), str(name))}" for name, count in zip(systems, sats, strict=True))
    text = f"Ranges of {int(np.median(counts))} satellites at a time ({counts.min()} to {counts.max()}); {listed} in all"
    cn0 = ranges.cn0[np.isfinite(ranges.cn0)]
    if len(cn0):
        low, middle = np.percentile(cn0, [10, 50])
        text += f"; C/N0 {middle:.0f} dB-Hz as a rule, {low:.0f} and less for a tenth of them"
    if not np.isfinite(ranges.range_rate).any():
        text += "; no range rates"
    return Finding("info", "ranges", text + ".", "")


def _check_gaps(times: Times) -> list[Finding]:
    interval = np.diff(times) * 1e-9
    gaps = interval[interval > _GAP_FACTOR * _interval(times)] if len(interval) else interval
    if len(gaps) == 0:
        return []
    text = f"The ranges have {len(gaps)} gaps, the longest of {gaps.max():.1f} s, {gaps.sum():.1f} s in all."
    return [Finding("info", "range-gaps", text, "")]


def _interval(times: Times) -> float:
    """The usual interval between epochs [s]."""
    return float(np.median(np.diff(times))) * 1e-9 if len(times) > 1 else 0.0


def _check_coverage(channels: tuple[ChannelUse, ...]) -> list[Finding]:
    uses = [use for use in channels if use.role == "range"]
    lost = {reason: sum(use.rejected.get(reason, 0) for use in uses) for reason in FAULTS[1:]}
    wanted = sum(lost.values()) + sum(use.used for use in uses)
    if sum(lost.values()) == 0:
        return []
    share = sum(lost.values()) / wanted
    listed = ", ".join(f"{reason} {count}" for reason, count in lost.items() if count)
    text = f"{100 * share:.0f} % of the pseudoranges are left out for want of a usable ephemeris: {listed}."
    hint = "Add a navigation file of that day, which holds all satellites, with input.range.navigation."
    return [Finding("warning" if share > _POOR_COVERAGE else "info", "ephemeris-coverage", text, hint)]
