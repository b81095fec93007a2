"""The epoch loop: inertial propagation to each measurement, then its update. There is no other."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from navreplay.alignment import Alignment, align
from navreplay.earth import move_lla
from navreplay.error_models.ned import NedErrorModel
from navreplay.filters.core import symmetric
from navreplay.filters.presets import Method
from navreplay.filters.record import Recorder
from navreplay.filters.stretches import cut_at_gaps, tell_unreached_fixes
from navreplay.filters.update import FixUpdater
from navreplay.heading import Sources
from navreplay.measurements import FixNoise, fix_noise
from navreplay.options import FilterOptions
from navreplay.rotation import matrix_from_quat
from navreplay.solution import RowStatus, Solution
from navreplay.strapdown import NavState, make_steps
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, LogError, Timeline, Times

__all__ = ["run_filter"]

Progress = Callable[[float], None]


class _Rows(NamedTuple):
    """Output of one stretch: t_ns (k,), packed states (k, w), covariances (k, n, n), status (k,)."""

    t_ns: Times
    states: Floats
    covariances: Floats
    status: np.ndarray


def run_filter(timeline: Timeline, method: Method, options: FilterOptions, progress: Progress | None = None) -> Solution:
    """The forward solution of the IMU over a timeline.

    progress is called with the share done, from 0 to 1. Raises LogError without IMU or fixes, on a gap that the options
    refuse, or when no alignment is possible.
    """
    if timeline.imu is None:
        raise LogError("filter: the log holds no IMU channel; name it with input.imu.channel, or add the file that holds it")
    if timeline.fixes is None:
        raise LogError("filter: the log holds no GNSS fixes; name them with input.fix.channel, or add the file that holds them")
    recorder = Recorder()
    stretches = cut_at_gaps(timeline.imu, options.gaps, recorder)
    tell_unreached_fixes(timeline.fixes, stretches, recorder)
    rows = []
    begin, span = int(timeline.imu.t_ns[0]), int(timeline.imu.t_ns[-1] - timeline.imu.t_ns[0])

    def report(t_ns: int) -> None:
        if progress is not None:
            progress((t_ns - begin) / span)

    for stretch in stretches:
        try:
            rows.append(_run_stretch(timeline, timeline.fixes, stretch, method, options, recorder, report))
        except LogError as error:
            if len(stretches) == 1:
                raise
            seconds = (stretch.t_ns[-1] - stretch.t_ns[0]) / 1e9
            recorder.tell(int(stretch.t_ns[0]), "warning", f"a stretch of {seconds:.1f} s is left out: {error}")
        report(int(stretch.t_ns[-1]))
    if not rows:
        raise LogError("filter: no stretch of the IMU could be aligned; see the gaps that `navreplay inspect` shows")
    return _join(rows, method, NedErrorModel(options.imu_noise), recorder)


def _join(rows: list[_Rows], method: Method, model: NedErrorModel, recorder: Recorder) -> Solution:
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
        method=method.name,
        innovations=recorder.series(),
        events=tuple(sorted(recorder.events, key=lambda event: event.t_ns)),
    )


def _run_stretch(
    timeline: Timeline,
    fixes: GnssFixSeries,
    imu: ImuSeries,
    method: Method,
    options: FilterOptions,
    recorder: Recorder,
    report: Callable[[int], None],
) -> _Rows:
    start = align(Sources(imu, fixes, timeline.attitude, timeline.reference, options.imu_noise, options.alignment))
    recorder.tell(start.t_ns, "info", start.text)
    for warning in start.warnings:
        recorder.tell(start.t_ns, "warning", warning)
    noise = fix_noise(fixes, options)
    model = NedErrorModel(options.imu_noise)
    updater = FixUpdater(fixes, noise, timeline.fix_lever_b, model, method, options, recorder)
    state, cov = _initial(model, fixes, noise, start, timeline.fix_lever_b)

    epochs = np.flatnonzero((fixes.t_ns > start.t_ns) & (fixes.t_ns <= imu.t_ns[-1]))
    nodes = np.union1d(fixes.t_ns[epochs], _output_times(start.t_ns, int(imu.t_ns[-1]), options.output_rate))
    steps = make_steps(imu, np.append(nodes, start.t_ns)).after(start.t_ns)
    ends = np.searchsorted(steps.t_ns, nodes) + 1
    rows = _allocate(np.concatenate([[start.t_ns], nodes]).astype(np.int64), len(state.pack()), model.size)
    rows.states[0], rows.covariances[0], rows.status[0] = state.pack(), cov, RowStatus.UPDATED

    # each epoch ends a run of nodes; behind the last epoch one more run may follow, without a measurement
    node, step = 0, 0
    stops = (np.searchsorted(nodes, fixes.t_ns[epochs]) + 1).tolist()
    for epoch, stop in zip([*epochs.tolist(), None], [*stops, len(nodes)], strict=True):
        if stop > node:
            moved = model.propagate(state, cov, steps, step, ends[node:stop], options.covariance_interval)
            rows.states[node + 1 : stop + 1], rows.covariances[node + 1 : stop + 1] = moved.states, moved.covariances
            state, cov = NavState.unpack(moved.states[-1]), moved.covariances[-1]
            node, step = stop, int(ends[stop - 1])
        if epoch is not None:
            state, cov, status = updater.update(epoch, state, cov, steps.dtheta[step - 1], float(steps.dt[step - 1]))
            rows.states[node], rows.covariances[node], rows.status[node] = state.pack(), cov, status
            report(int(fixes.t_ns[epoch]))
    return rows


def _output_times(start_ns: int, end_ns: int, rate: float) -> Times:
    if rate <= 0:
        return np.empty(0, dtype=np.int64)
    period = round(1e9 / rate)
    return np.arange((start_ns // period + 1) * period, end_ns + 1, period, dtype=np.int64)


def _allocate(t_ns: Times, width: int, size: int) -> _Rows:
    k = len(t_ns)
    status = np.full(k, RowStatus.PREDICTED, dtype=np.int8)
    return _Rows(t_ns, np.empty((k, width)), np.empty((k, size, size)), status)


def _initial(
    model: NedErrorModel, fixes: GnssFixSeries, noise: FixNoise, start: Alignment, lever_b: Floats
) -> tuple[NavState, Floats]:
    at = start.fix
    lever_n = matrix_from_quat(start.q_nb) @ lever_b
    known = bool(fixes.has_velocity[at])
    velocity = fixes.vel_n[at] if known else start.vel_n
    cov_vel = noise.velocity[at] if known else np.eye(3) * start.vel_std**2
    zero = np.zeros(3)
    state = NavState(move_lla(fixes.lla[at], -lever_n), velocity.copy(), start.q_nb, start.gyro_bias, zero, zero, zero)
    cov = model.initial_covariance(noise.position[at], cov_vel, start.cov_att, start.gyro_bias_std)
    if start.levelled:
        cov = model.tie_tilt_to_accel_bias(cov, start.q_nb)
    return state, symmetric(cov)
