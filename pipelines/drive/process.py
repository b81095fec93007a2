"""One drive from log files to a result: read, check, withhold, filter, evaluate."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from importers.findings import Finding
from importers.load import load_timeline
from importers.preflight.checks import preflight
from importers.vetting.vet import vet
from navreplay.evaluation.metrics import evaluate, find_outages
from navreplay.evaluation.sky import view_sky
from navreplay.evaluation.verdict import judge
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.measurements.least_squares import fixes_of, solve_points
from navreplay.solution import Solution
from navreplay.timeline import Floats, GnssFixSeries, LogError, RangeSeries, Timeline
from pipelines.config.spec import Config
from pipelines.drive.advice import advise
from pipelines.drive.outages import outage_windows, withhold_fixes, withhold_ranges
from pipelines.drive.result import RunResult
from pipelines.drive.set_up import find_set_up, options_of
from pipelines.drive.wheels import settle_wheels
from pipelines.trajectory.output_point import move_to_point

__all__ = ["Drive", "Progress", "filter_drive", "process", "read_drive"]

Progress = Callable[[str, float], None]
"""Told the name of the stage and the fraction of it that is done."""


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """A drive as read: its timeline, what preflight found, the seconds reading took, and the direction of travel in the body's
    x-y plane [rad]."""

    timeline: Timeline
    findings: tuple[Finding, ...]
    timing_s: dict[str, float] = field(default_factory=dict)
    forward: float = 0.0


def process(paths: Sequence[str | Path], config: Config, progress: Progress | None = None, advised: bool = False) -> RunResult:
    """Reads the logs as one drive and filters it as configured. advised: where the verdict is not good, try what would help.

    Raises LogError for logs that cannot be read, that preflight refuses, or that the filter cannot start on.
    """
    build_method(config.filter.name, config.filter.parameters)  # a misspelled method should not cost the time of reading
    return filter_drive(read_drive(paths, config, progress), config, progress, advised)


def read_drive(paths: Sequence[str | Path], config: Config, progress: Progress | None = None) -> Drive:
    """The logs merged into one timeline and checked. Raises LogError with the first error that preflight finds."""
    timing: dict[str, float] = {}
    with _stage("reading", timing, progress) as tell:
        timeline = load_timeline(paths, config.input, progress=tell)
    with _stage("checking", timing, progress):
        timeline, vetted = vet(timeline)
        timeline, forward, found = find_set_up(timeline, config)
        timeline, wheels = settle_wheels(timeline, config)
        findings = _one_of_a_kind((*vetted, *found, *wheels, *preflight(timeline)))
    for finding in findings:
        if finding.level == "error":
            raise LogError(f"{finding.text} {finding.hint}".strip())
    return Drive(timeline, findings, timing, forward)


def _one_of_a_kind(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The first of each code."""
    once: dict[str, Finding] = {}
    for finding in findings:
        once.setdefault(finding.code, finding)
    return tuple(once.values())


def filter_drive(drive: Drive, config: Config, progress: Progress | None = None, advised: bool = False) -> RunResult:
    """The drive through the configured filter, evaluated against the reference if there is one. advised: see `process`."""
    timing = dict(drive.timing_s)
    timeline = drive.timeline
    method = build_method(config.filter.name, config.filter.parameters)
    used = _withhold(timeline, config)
    with _stage("filtering", timing, progress) as tell:
        solution = run_filter(used, method, options_of(config, drive.forward), tell)
    with _stage("evaluating", timing, progress):
        solution = replace(solution, outages=find_outages(solution, _simulated_windows(timeline, config)))
        evaluation = None if timeline.reference is None else evaluate(solution, timeline.reference, _reference_lever(timeline))
        sky = None if used.ranges is None else view_sky(used.ranges, solution)
        verdict = judge(solution, used, _points(used, config, drive.forward), evaluation)
    advice = None
    if advised and verdict.grade != "good":
        with _stage("advising", timing, progress):
            advice = advise(used, config, drive.forward, solution)
    moved = _at_output_point(solution, used, config)
    return RunResult(config, timeline, used, moved, evaluation, verdict, advice, sky, drive.findings, timing)


def _aiding(timeline: Timeline, config: Config) -> GnssFixSeries | RangeSeries | None:
    """What aids the filter."""
    return timeline.fixes if timeline.ranges is None or config.filter.use == "fixes" else timeline.ranges


def _points(timeline: Timeline, config: Config, forward: float) -> GnssFixSeries | None:
    """Least-squares positions of the ranges that aided the filter; None where others did."""
    aiding = _aiding(timeline, config)
    if not isinstance(aiding, RangeSeries):
        return None
    return fixes_of(solve_points(aiding, options_of(config, forward).ranges)[0])


def _withhold(timeline: Timeline, config: Config) -> Timeline:
    aiding = _aiding(timeline, config)
    if isinstance(aiding, RangeSeries):
        return replace(timeline, ranges=withhold_ranges(aiding, config.outages))
    return timeline if aiding is None else replace(timeline, fixes=withhold_fixes(aiding, config.outages))


def _simulated_windows(timeline: Timeline, config: Config) -> tuple[tuple[int, int], ...]:
    aiding = _aiding(timeline, config)
    return () if aiding is None else outage_windows(config.outages, aiding.t_ns)


def _reference_lever(timeline: Timeline) -> Floats:
    """From the point that is solved for, which without IMU is the antenna."""
    return timeline.reference_lever_b if timeline.imu is not None else timeline.reference_lever_b - timeline.fix_lever_b


def _at_output_point(solution: Solution, timeline: Timeline, config: Config) -> Solution:
    if config.output.output_point_m is None or timeline.imu is None:
        return solution
    return move_to_point(solution, timeline.imu, np.array(config.output.output_point_m))


@contextmanager
def _stage(name: str, timing: dict[str, float], progress: Progress | None) -> Iterator[Callable[[float], None] | None]:
    """Times a stage and tells its beginning and end; gives the function that tells the fraction done."""
    start = time.perf_counter()
    if progress is not None:
        progress(name, 0.0)
    yield None if progress is None else lambda fraction: progress(name, fraction)
    timing[name] = time.perf_counter() - start
    if progress is not None:
        progress(name, 1.0)
