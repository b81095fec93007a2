"""A filter over a timeline: passes over its stretches, calibration before them, a look at the result behind."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from navreplay.aiding.guidance import Guidance, choose_guidance
from navreplay.aiding.ranges import RangeAiding
from navreplay.calibration.linear_log import LinearLog
from navreplay.calibration.review import Review
from navreplay.calibration.settled import Settled, settle_nothing
from navreplay.error_models.error_model import ErrorModel
from navreplay.filters.consider import Setup, check_considers, set_up
from navreplay.filters.epochs import DivergedError, output_times, run_epochs
from navreplay.filters.presets import Method
from navreplay.filters.rows import Rows, backward_agreement
from navreplay.filters.second_look import contradiction, doubtful_stops, sit_in_vehicle
from navreplay.filters.trace import Traces
from navreplay.filters.trial import settle_attitude
from navreplay.filters.update import Estimator
from navreplay.mechanisation.strapdown import NavState, idle_steps, make_steps
from navreplay.options import FilterOptions
from navreplay.solution import Event, Solution
from navreplay.start.stretches import cut_at_gaps, tell_unreached
from navreplay.timeline import Floats, ImuSeries, LogError, Timeline, Times
from navreplay.update.adapter import NoiseAdapter
from navreplay.update.range_gate import RangeGate
from navreplay.update.record import Recorder

__all__ = ["run_filter"]

Progress = Callable[[float], None]


def run_filter(timeline: Timeline, method: Method, options: FilterOptions, progress: Progress | None = None) -> Solution:
    """The solution over a timeline: of the IMU, by ranges, fixes or attitudes; without IMU of the antenna, by ranges alone.

    progress is called with the share done, from 0 to 1. Raises LogError without anything to aid by, or without IMU where there
    are only fixes; on a gap that the options refuse, or when no alignment is possible.
    """
    check_considers(method, options)
    settled = settle_nothing(options, method.adapter)
    if method.calibration is not None:
        shares = iter(_share_out(progress, method.calibration.traces + 1))

        def trace(told: FilterOptions, adapter: NoiseAdapter[Any], sources: tuple[str, ...]) -> tuple[LinearLog, ...]:
            """What a forward pass with these linearises."""
            traces, plain = Traces(sources), replace(told.consider, every_method=False)
            # what a vehicle cannot do has no noise to be found, and the IMU is quietest at rest
            told = replace(told, output_rate=0.0, smooth=False, consider=plain, vehicle=told.vehicle.free)
            _run_passes(timeline, replace(method, adapter=adapter), told, traces, next(shares))
            return traces.linear_logs()

        settled = method.calibration.settle(options, trace)
        progress = next(shares)
    method = replace(method, adapter=settled.adapter or method.adapter, calibration=None)
    settled, placed = _placed(timeline, method, settled)
    solution = _run_passes(timeline, method, settled.options, None, progress)
    if method.review is not None:
        solution, settled = _reviewed(timeline, method, method.review, settled, solution, progress)
    solution = _without_doubtful_stops(timeline, method, settled.options, solution, progress)
    told = tuple(Event(int(solution.t_ns[0]), "info", note) for note in settled.notes)
    return replace(solution, estimated=settled.estimated, events=placed + told + solution.events)


def _placed(timeline: Timeline, method: Method, settled: Settled) -> tuple[Settled, tuple[Event, ...]]:
    """What was settled, with how the IMU sits in the vehicle where a constraint needs that and nobody tells it."""
    options, vehicle = settled.options, settled.options.vehicle
    if timeline.imu is None or not vehicle.no_slip or vehicle.mounting is not None:
        return settled, ()
    free = replace(options, output_rate=0.0, smooth=False, vehicle=replace(vehicle, no_slip=False))
    solution = _run_passes(timeline, method, free, None)
    placed, event = sit_in_vehicle(vehicle, solution, timeline.imu, options.alignment.forward)
    return settled._replace(options=replace(options, vehicle=placed)), (event,)


def _without_doubtful_stops(
    timeline: Timeline, method: Method, options: FilterOptions, solution: Solution, progress: Progress | None
) -> Solution:
    """The solution, or one without the stops that the fixes behind them contradict, where they contradict that one less."""
    stops = doubtful_stops(solution)
    if not stops:
        return solution
    doubting = replace(options, vehicle=replace(options.vehicle, doubted=stops))
    other = _run_passes(timeline, method, doubting, None, progress)
    if not contradiction(other, stops) < contradiction(solution, stops):
        return solution
    text = (
        f"{len(stops)} standstills in outages are not believed: the fixes behind them contradict the solution with them, and "
        "less the one without"
    )
    return replace(other, events=(Event(stops[0][0], "warning", text), *other.events))


def _reviewed(
    timeline: Timeline, method: Method, review: Review, settled: Settled, solution: Solution, progress: Progress | None
) -> tuple[Solution, Settled]:
    """The solution, or that of a further pass with what a look at it asks for; and what it was made with."""
    for look in range(review.looks):
        amended = review.amend(settled.options, solution, look > 0)
        if amended is None:
            break
        settled = amended._replace(notes=settled.notes + amended.notes, estimated={**settled.estimated, **amended.estimated})
        solution = _run_passes(timeline, method, settled.options, None, progress)
    return solution, settled


def _share_out(progress: Progress | None, passes: int) -> list[Progress | None]:
    """What each of so many passes, one after the other, tells its progress."""

    def part(tell: Progress, done: int) -> Progress:
        """Of the pass behind so many others."""
        return lambda share: tell((done + share) / passes)

    return [None if progress is None else part(progress, done) for done in range(passes)]


def _run_passes(
    timeline: Timeline,
    method: Method,
    options: FilterOptions,
    traces: Traces | None,
    progress: Progress | None = None,
) -> Solution:
    """One pass over all stretches, forward and, where the options say so, backward; traces, where given, take them down."""
    recorder = Recorder()
    name = f"{method.name}-smoothed" if options.smooth else method.name
    if timeline.imu is None:
        alone = _choose_ranges_alone(timeline, options, recorder)
        setup = set_up(alone, alone.model, method, options)
        rows = [_run_alone(alone, setup, options, recorder, traces, _report_of(alone.t_ns, progress))]
        return _join(rows, f"{name} without IMU", setup.model, recorder)
    guidance = choose_guidance(timeline, options, recorder)
    setup = set_up(guidance.aiding, guidance.model, method, options)
    stretches = cut_at_gaps(timeline.imu, options.gaps, recorder)
    tell_unreached(guidance.main.t_ns, guidance.main.name, stretches, recorder)
    report = _report_of(timeline.imu.t_ns, progress)
    rows = []
    for stretch in stretches:
        try:
            rows += _run_stretch(timeline, guidance, stretch, setup, options, recorder, traces, report)
        except LogError as error:
            if len(stretches) == 1:
                raise
            seconds = (stretch.t_ns[-1] - stretch.t_ns[0]) / 1e9
            recorder.tell(int(stretch.t_ns[0]), "warning", f"a stretch of {seconds:.1f} s is left out: {error}")
        report(int(stretch.t_ns[-1]))
    if not rows:
        raise LogError("filter: no stretch of the IMU could be aligned; see the gaps that `navreplay inspect` shows")
    return _join(rows, name, setup.model, recorder)


def _report_of(t_ns: Times, progress: Progress | None) -> Callable[[int], None]:
    begin, span = int(t_ns[0]), max(int(t_ns[-1] - t_ns[0]), 1)

    def report(now_ns: int) -> None:
        """Tells the share of the span done by now_ns."""
        if progress is not None:
            progress((now_ns - begin) / span)

    return report


def _choose_ranges_alone(timeline: Timeline, options: FilterOptions, recorder: Recorder) -> RangeAiding:
    if timeline.ranges is None or options.use == "fixes":
        raise LogError("filter: the log holds no IMU channel; name it with input.imu.channel, or add the file that holds it")
    text = (
        "the log holds no IMU: the solution is that of a GNSS-only filter and describes the antenna, its yaw is the course, "
        "its roll and pitch are unknown"
    )
    recorder.tell(int(timeline.ranges.t_ns[0]), "warning", text)
    if options.vehicle.holds:
        text = "vehicle.zero_velocity and what else is known of the vehicle are not used: without IMU nothing tells them"
        recorder.tell(int(timeline.ranges.t_ns[0]), "warning", text)
    return RangeAiding(timeline.ranges, timeline.fix_lever_b, None, options, recorder)


def _join(rows: list[Rows], method: str, model: ErrorModel, recorder: Recorder) -> Solution:
    states = np.concatenate([row.states for row in rows])
    return Solution(
        t_ns=np.concatenate([row.t_ns for row in rows]),
        lla=states[:, 0:3].copy(),
        vel_n=states[:, 3:6].copy(),
        q_nb=states[:, 6:10].copy(),
        gyro_bias=states[:, 10:13] + states[:, 22:25],
        accel_bias=states[:, 13:16].copy(),
        cov=np.concatenate([row.covariances for row in rows]),
        status=np.concatenate([row.status for row in rows]),
        state_names=model.names,
        state_units=model.units,
        method=method,
        innovations=recorder.series(),
        weights=recorder.weight_series(),
        events=tuple(sorted(recorder.events, key=lambda event: event.t_ns)),
        backward=backward_agreement([row.agreement for row in rows if row.agreement is not None]),
        beside=states[:, 28:].copy(),
    )


def _run_stretch(
    timeline: Timeline,
    guidance: Guidance,
    imu: ImuSeries,
    setup: Setup,
    options: FilterOptions,
    recorder: Recorder,
    traces: Traces | None,
    report: Callable[[int], None],
) -> list[Rows]:
    """The rows of a stretch: one part, or more where the filter lost its way and was started anew from the measurements."""
    start_ns, state, cov = _start(timeline, guidance, imu, setup, options, recorder)
    aiding, end_ns = guidance.aiding, int(imu.t_ns[-1])
    parts = []
    while True:
        estimator = _traced(setup.estimator(guidance.gate(options.gate), recorder), guidance.model, aiding.t_ns, traces)
        epochs = np.flatnonzero((aiding.t_ns > start_ns) & (aiding.t_ns <= end_ns))
        nodes = np.union1d(aiding.t_ns[epochs], output_times(start_ns, end_ns, options.output_rate))
        steps = make_steps(imu, np.append(nodes, start_ns)).after(start_ns)
        try:
            rows = run_epochs(steps, nodes, aiding.t_ns, epochs, state, cov, estimator, setup.model, options, report)
        except DivergedError as error:
            raise LogError(f"filter '{setup.method.name}': {error}") from error
        parts.append(rows)
        lost_ns = int(rows.t_ns[-1])
        if not len(nodes) or lost_ns >= nodes[-1]:
            return parts
        try:
            start_ns, state, cov = _start(timeline, guidance, _rest_of(imu, lost_ns), setup, options, recorder)
            text = "the filter kept contradicting its measurements; it is started anew from them"
        except LogError as error:
            start_ns, state, cov = lost_ns, NavState.unpack(rows.states[-1]), rows.covariances[-1]
            text = f"the filter keeps contradicting its measurements and could not be started anew: {error}"
        recorder.tell(lost_ns, "warning", text, kind="restart")


def _start(
    timeline: Timeline, guidance: Guidance, imu: ImuSeries, setup: Setup, options: FilterOptions, recorder: Recorder
) -> tuple[int, NavState, Floats]:
    """Time, state and covariance at which a stretch starts; where alignment is not sure of itself, as trials bear it out."""
    start = guidance.start(timeline, imu, options, recorder)
    cov = setup.start_covariance(start.cov)
    if start.sure:
        return start.t_ns, start.state, cov
    state, cov = settle_attitude(guidance, imu, setup, options, recorder, start.t_ns, start.state, cov)
    return start.t_ns, state, cov


def _rest_of(imu: ImuSeries, t_ns: int) -> ImuSeries:
    """The samples from t_ns on. Raises LogError where there are hardly any."""
    first = int(np.searchsorted(imu.t_ns, t_ns))
    if len(imu.t_ns) - first < 2:
        raise LogError("the IMU's samples end")
    return ImuSeries(imu.t_ns[first:], imu.gyro[first:], imu.accel[first:], imu.increments)


def _traced(estimator: Estimator, model: ErrorModel, t_ns: Times, traces: Traces | None) -> Estimator:
    """The estimator or, where traces are asked for, one that takes it down."""
    return estimator if traces is None else traces.follow(estimator, model, t_ns)


def _run_alone(
    aiding: RangeAiding,
    setup: Setup,
    options: FilterOptions,
    recorder: Recorder,
    traces: Traces | None,
    report: Callable[[int], None],
) -> Rows:
    start_ns, state, cov = aiding.start_alone()
    estimator = _traced(setup.estimator(RangeGate(options.gate), recorder), aiding.model, aiding.t_ns, traces)
    epochs = np.flatnonzero(aiding.t_ns > start_ns)
    nodes = np.union1d(aiding.t_ns[epochs], output_times(start_ns, int(aiding.t_ns[-1]), options.output_rate))
    cov, steps = setup.start_covariance(cov), idle_steps(start_ns, nodes)
    return run_epochs(steps, nodes, aiding.t_ns, epochs, state, cov, estimator, setup.model, options, report)
