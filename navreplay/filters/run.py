"""The epoch loop: inertial propagation to each measurement, adaptation, gate, update. There is no other."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from navreplay.alignment import Alignment, align
from navreplay.earth import move_lla
from navreplay.error_models.ned import NedErrorModel
from navreplay.filters.core import Gaussian, condition
from navreplay.filters.gate import Gate
from navreplay.filters.presets import Method
from navreplay.filters.record import Recorder
from navreplay.heading import Sources
from navreplay.measurements import (
    FixNoise,
    Measurement,
    angular_rate,
    fix_noise,
    join,
    position_measurement,
    velocity_measurement,
)
from navreplay.options import FilterOptions
from navreplay.rotation import matrix_from_quat
from navreplay.solution import RowStatus, Solution
from navreplay.strapdown import NavState, Steps, make_steps, split_at_long_gaps
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, LogError, Timeline, Times

__all__ = ["run_filter"]

Progress = Callable[[float], None]


class _Rows(NamedTuple):
    """Output of one stretch between long gaps: t_ns (k,), packed states (k, 22), covariances (k, n, n), status (k,)."""

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
    stretches = _stretches(timeline.imu, options, recorder)
    done = 0
    rows = []
    for stretch in stretches:
        share = len(stretch) / sum(len(s) for s in stretches)
        base = done / len(timeline.imu)
        inner = None if progress is None else (lambda part, base=base, share=share: progress(base + share * part))
        try:
            rows.append(_run_stretch(timeline, timeline.fixes, stretch, method, options, recorder, inner))
        except LogError as error:
            if len(stretches) == 1:
                raise
            recorder.tell(int(stretch.t_ns[0]), "warning", f"a stretch of {_seconds(stretch):.1f} s is left out: {error}")
        done += len(stretch)
    if not rows:
        raise LogError("filter: no stretch of the IMU could be aligned; see the gaps that `navreplay inspect` shows")
    model = NedErrorModel(options.imu_noise)
    states = np.concatenate([row.states for row in rows])
    return Solution(
        t_ns=np.concatenate([row.t_ns for row in rows]),
        lla=states[:, 0:3].copy(),
        vel_n=states[:, 3:6].copy(),
        q_nb=states[:, 6:10].copy(),
        gyro_bias=states[:, 10:13].copy(),
        accel_bias=states[:, 13:16].copy(),
        cov=np.concatenate([row.covariances for row in rows]),
        status=np.concatenate([row.status for row in rows]),
        state_names=model.names,
        state_units=model.units,
        method=method.name,
        innovations=recorder.series(),
        events=tuple(recorder.events),
    )


def _seconds(imu: ImuSeries) -> float:
    return float(imu.t_ns[-1] - imu.t_ns[0]) / 1e9


def _stretches(imu: ImuSeries, options: FilterOptions, recorder: Recorder) -> list[ImuSeries]:
    longest = int(options.gaps.bridge_s * 1e9)
    long = np.flatnonzero(np.diff(imu.t_ns) > longest)
    for i in long.tolist():
        seconds = (imu.t_ns[i + 1] - imu.t_ns[i]) / 1e9
        if options.gaps.longer == "refuse":
            raise LogError(
                f"imu: a gap of {seconds:.3f} s is longer than gaps.bridge_s = {options.gaps.bridge_s:g}; raise that, or set "
                "gaps.longer = 'reset' to align anew behind it"
            )
        recorder.tell(
            int(imu.t_ns[i]), "warning", f"the IMU is silent for {seconds:.3f} s; the filter aligns anew behind the gap"
        )
    stretches = split_at_long_gaps(imu, longest)
    if not stretches:
        raise LogError("imu: gaps leave no two samples together; is the time base of the IMU right?")
    return stretches


def _output_times(start_ns: int, end_ns: int, rate: float) -> Times:
    if rate <= 0:
        return np.empty(0, dtype=np.int64)
    period = round(1e9 / rate)
    return np.arange(-(-(start_ns + 1) // period) * period, end_ns + 1, period, dtype=np.int64)


def _run_stretch(
    timeline: Timeline,
    fixes: GnssFixSeries,
    imu: ImuSeries,
    method: Method,
    options: FilterOptions,
    recorder: Recorder,
    progress: Progress | None,
) -> _Rows:
    start = align(Sources(imu, fixes, timeline.attitude, timeline.reference, options.imu_noise, options.alignment))
    recorder.tell(start.t_ns, "info", start.text)
    for warning in start.warnings:
        recorder.tell(start.t_ns, "warning", warning)
    noise = fix_noise(fixes, options)
    epochs = np.flatnonzero((fixes.t_ns > start.t_ns) & (fixes.t_ns <= imu.t_ns[-1]))
    nodes = np.union1d(fixes.t_ns[epochs], _output_times(start.t_ns, int(imu.t_ns[-1]), options.output_rate))
    steps = make_steps(imu, np.append(nodes, start.t_ns)).after(start.t_ns)
    model = NedErrorModel(options.imu_noise)
    state, cov = _initial(model, fixes, noise, start, timeline.fix_lever_b)

    k = len(nodes) + 1
    rows = _Rows(
        np.concatenate([[start.t_ns], nodes]).astype(np.int64),
        np.empty((k, 22)),
        np.empty((k, model.size, model.size)),
        np.full(k, RowStatus.PREDICTED, dtype=np.int8),
    )
    rows.states[0], rows.covariances[0], rows.status[0] = state.pack(), cov, RowStatus.UPDATED
    ends = np.searchsorted(steps.t_ns, nodes) + 1
    at_node = np.searchsorted(nodes, fixes.t_ns[epochs])
    update = _Updater(fixes, noise, timeline.fix_lever_b, model, method, options, recorder)
    first_node = 0
    for count, (epoch, node) in enumerate(zip(epochs.tolist(), at_node.tolist(), strict=True)):
        state, cov = _advance(model, state, cov, steps, ends, first_node, node + 1, options, rows)
        last = int(ends[node]) - 1
        state, cov, status = update(epoch, state, cov, steps.dtheta[last], float(steps.dt[last]))
        rows.states[node + 1], rows.covariances[node + 1], rows.status[node + 1] = state.pack(), cov, status
        first_node = node + 1
        if progress is not None and count % 64 == 0:
            progress(count / len(epochs))
    if first_node < len(nodes):
        _advance(model, state, cov, steps, ends, first_node, len(nodes), options, rows)
    return rows


def _advance(
    model: NedErrorModel,
    state: NavState,
    cov: Floats,
    steps: Steps,
    ends: np.ndarray,
    first_node: int,
    end_node: int,
    options: FilterOptions,
    rows: _Rows,
) -> tuple[NavState, Floats]:
    first_step = 0 if first_node == 0 else int(ends[first_node - 1])
    moved = model.propagate(state, cov, steps, first_step, ends[first_node:end_node], options.covariance_interval)
    rows.states[first_node + 1 : end_node + 1] = moved.states
    rows.covariances[first_node + 1 : end_node + 1] = moved.covariances
    return NavState.unpack(moved.states[-1]), moved.covariances[-1]


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
    return state, cov


class _Updater:
    """Measurement updates with one adapter state per set of components."""

    def __init__(
        self,
        fixes: GnssFixSeries,
        noise: FixNoise,
        lever_b: Floats,
        model: NedErrorModel,
        method: Method,
        options: FilterOptions,
        recorder: Recorder,
    ) -> None:
        self._fixes = fixes
        self._noise = noise
        self._lever_b = lever_b
        self._model = model
        self._method = method
        self._recorder = recorder
        self._use_velocity = options.use_velocity
        self._has_position = fixes.has_position
        self._has_velocity = fixes.has_velocity
        self._gate = Gate(options.gate)
        self._adapter_states: dict[tuple[str, ...], Any] = {}
        self._zero = np.zeros(model.size)

    def __call__(
        self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float
    ) -> tuple[NavState, Floats, RowStatus]:
        """State and covariance after the fix with index epoch; dtheta (3,) and dt of the step before it."""
        measurement = self._measure(epoch, state, dtheta, dt)
        if measurement is None:
            return state, cov, RowStatus.PREDICTED
        t_ns = int(self._fixes.t_ns[epoch])
        rule, adapter = self._method.rule, self._method.adapter
        prior = Gaussian(self._zero, cov)
        innovation = rule.innovate(prior, measurement)
        key = innovation.labels
        adapter_state = self._adapter_states[key] if key in self._adapter_states else adapter.init()
        adapted, noise, self._adapter_states[key] = adapter.adapt(adapter_state, prior, innovation)
        if adapted is not prior:
            innovation = rule.innovate(adapted, measurement)
        verdict = self._gate.judge(measurement.kinds, innovation, noise)
        if verdict.inflation > 1:
            adapted = Gaussian(self._zero, cov * verdict.inflation)
            innovation = rule.innovate(adapted, measurement)
            self._recorder.tell(
                t_ns, "warning", f"fixes were rejected {verdict.run} epochs in a row; covariance times {verdict.inflation:.1f}"
            )
        for kind, judged in verdict.parts(measurement.kinds, innovation, noise):
            self._recorder.add(t_ns, kind, judged)
        if not len(verdict.passed):
            return state, cov, RowStatus.REJECTED
        square = np.ix_(verdict.passed, verdict.passed)
        posterior = condition(adapted, innovation.select(verdict.passed), noise[square])
        return self._model.retract(state, posterior.mean), posterior.cov, RowStatus.UPDATED

    def _measure(self, epoch: int, state: NavState, dtheta: Floats, dt: float) -> Measurement | None:
        parts = []
        size = self._model.size
        if self._has_position[epoch]:
            parts.append(position_measurement(state, self._lever_b, self._fixes.lla[epoch], self._noise.position[epoch], size))
        if self._use_velocity and self._has_velocity[epoch]:
            rate = angular_rate(state, dtheta, dt)
            vel_n = self._fixes.vel_n[epoch]
            parts.append(velocity_measurement(state, self._lever_b, rate, vel_n, self._noise.velocity[epoch], size))
        return join(parts) if parts else None
