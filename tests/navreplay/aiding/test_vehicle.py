"""What is known of a land vehicle: constraint at the rear axle, mounting found in the log, stops refused and let in."""

from dataclasses import fields, replace

import numpy as np
import pytest

from navreplay.aiding.no_slip import no_slip_times
from navreplay.aiding.standstill import StandstillAiding, StopGate
from navreplay.calibration.mounting import find_mounting
from navreplay.error_models.ned import NedErrorModel
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.filters.second_look import contradiction, doubtful_stops
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_euler
from navreplay.mechanisation.strapdown import NavState
from navreplay.moments.linearised import Linearised
from navreplay.options import GRADES, FilterOptions, GateOptions, VehicleOptions
from navreplay.timeline import GnssFixSeries, ImuSeries
from navreplay.update.gaussian import Gaussian
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration

SECOND = 1_000_000_000
CAR = VehicleOptions(zero_velocity=True, zero_rate=True, no_slip=True)
SCENARIO = with_duration(SCENARIOS["car-city"], 240.0)
OUTAGE_S = 30
NOISE = SCENARIO.imu.noise


@pytest.fixture(scope="module")
def log():
    return simulate(SCENARIO, 5)


def options(**changes):
    return replace(FilterOptions(imu_noise=NOISE, output_rate=2.0), **changes)


def select(fixes, rows):
    return GnssFixSeries(*(getattr(fixes, field.name)[rows] for field in fields(fixes)))


def with_outage(timeline, start_s):
    seconds = (timeline.fixes.t_ns - timeline.imu.t_ns[0]) / 1e9
    return replace(timeline, fixes=select(timeline.fixes, (seconds < start_s) | (seconds > start_s + OUTAGE_S)))


def turned(imu, pitch, yaw):
    """As sensed by an IMU in whose axes the vehicle's lie at that pitch and yaw."""
    c_bv = matrix_from_quat(quat_from_euler(0.0, pitch, yaw))
    return ImuSeries(imu.t_ns, imu.gyro @ c_bv.T, imu.accel @ c_bv.T, imu.increments)


def error_at_end(solution, log, start_s):
    end = int(log.imu.t_ns[0]) + (start_s + OUTAGE_S) * SECOND
    at = truth_at(log.scenario.journey, np.arange(end - SECOND, end + 1, SECOND // 2))
    error = evaluate(solution, at).errors["position"]
    return np.hypot(*error.error[-1, :2]), error.nees[-1]


def test_constraints_are_a_second_apart():
    times = np.array([0.0, 0.2, 0.9, 1.0, 1.5, 2.1, 5.0]) * SECOND
    assert (no_slip_times(times.astype(np.int64)) / SECOND).tolist() == [0.0, 1.0, 2.1, 5.0]


def test_the_mounting_is_found_with_a_deviation_that_is_true(log):
    errors = []
    for seed in range(3):
        drawn = simulate(SCENARIO, seed)
        imu = turned(drawn.imu, np.radians(2.0), np.radians(-3.0))
        lever_b = matrix_from_quat(quat_from_euler(0.0, np.radians(2.0), np.radians(-3.0))) @ drawn.timeline().fix_lever_b
        timeline = replace(drawn.timeline(), imu=imu, fix_lever_b=lever_b)
        found = find_mounting(run_filter(timeline, build_method("fixed"), options()), imu, 0.0)
        errors.append(np.array([found.pitch - np.radians(2.0), found.yaw + np.radians(3.0)]) / max(found.std, np.radians(0.2)))
        assert abs(found.arm) < 0.5
    assert np.abs(errors).max() < 4
    assert np.sqrt(np.mean(np.square(errors))) < 2


def test_a_log_without_motion_tells_no_mounting():
    still = simulate(with_duration(SCENARIOS["car-city"], 30.0), 1)
    solution = run_filter(still.timeline(), build_method("fixed"), options(vehicle=CAR))
    assert any("cannot be found" in event.text for event in solution.events)


def test_the_constraint_tames_outages_and_stays_honest(log):
    """Three draws of everything with the IMU askew by what nobody tells."""
    squares, ends = [], {False: [], True: []}
    for seed in range(1, 4):
        drawn = simulate(SCENARIO, seed)
        imu = turned(drawn.imu, np.radians(1.0), np.radians(2.0))
        lever_b = matrix_from_quat(quat_from_euler(0.0, np.radians(1.0), np.radians(2.0))) @ drawn.timeline().fix_lever_b
        start_s = 120
        cut = with_outage(replace(drawn.timeline(), imu=imu, fix_lever_b=lever_b), start_s)
        for known in (False, True):
            solution = run_filter(cut, build_method("fixed"), options(vehicle=CAR if known else VehicleOptions()))
            error, nees = error_at_end(solution, drawn, start_s)
            ends[known].append(error)
            squares += [nees] if known else []
    assert np.mean(ends[True]) < 0.7 * np.mean(ends[False])
    assert np.mean(squares) < 6


def judge(gate, t_ns, speed):
    """The verdict on a standstill of a filter that is sure to drive with that speed [m/s]."""
    claimed = StandstillAiding(np.array([0]), 0.01, NedErrorModel(GRADES["tactical"]))
    state = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([speed, 0.0, 0.0]), np.array([1.0, 0, 0, 0]))
    prior = Gaussian(np.zeros(15), np.eye(15) * 1e-4)
    measured = claimed.observe(0, state, prior.cov, np.zeros(3), 0.01).measurement
    innovation = Linearised().innovate(prior, measured)._replace(t_ns=t_ns)
    return gate.judge(measured.kinds, innovation, innovation.noise)


@pytest.mark.parametrize("aided", [False, True])
def test_a_long_stop_opens_a_filter_that_nothing_else_aids(aided):
    times = np.arange(0, 12 * SECOND, SECOND)
    gate = StopGate(GateOptions(probability=1.0, reset_after=10), times if aided else times[:0])
    opened = [bool(judge(gate, t_ns, 10.0).widenings) for t_ns in times.tolist()]
    assert opened == [not aided and i == 10 for i in range(12)]


def test_refusals_of_several_stops_are_not_added_up():
    gate = StopGate(GateOptions(reset_after=10), np.empty(0, np.int64))
    times = [stop * 60 * SECOND + i * SECOND for stop in range(4) for i in range(6)]
    assert not any(judge(gate, t_ns, 10.0).widenings for t_ns in times)


def test_a_false_standstill_costs_nothing(log, monkeypatch):
    """In an outage at full speed the detector claims a stop that the filter, unsure by then, lets in."""
    start_s = 120
    cut = with_outage(log.timeline(), start_s)
    begin = int(log.imu.t_ns[0]) + start_s * SECOND
    times = begin + np.arange(20, 24) * SECOND
    moving = np.linalg.norm(truth_at(log.scenario.journey, times).vel_n, axis=1)
    assert moving.min() > 3
    loose = replace(NOISE, accel_noise=0.5, gyro_noise=np.radians(1.0))
    told = replace(options(), imu_noise=loose)
    plain = run_filter(cut, build_method("fixed"), told)

    def claim(imu, fixes, t_ns):
        return Standstill(np.intersect1d(t_ns, times), "claimed")

    from navreplay.aiding import guidance
    from navreplay.measurements.standstill import Standstill

    offered = np.union1d(guidance.standstill_candidates(cut.fixes.t_ns, int(log.imu.t_ns[0]), int(log.imu.t_ns[-1])), times)
    monkeypatch.setattr(guidance, "standstill_candidates", lambda *_: offered)
    monkeypatch.setattr(guidance, "find_standstills", claim)
    solution = run_filter(cut, build_method("fixed"), replace(told, vehicle=VehicleOptions(zero_velocity=True)))
    assert any("are not believed" in event.text for event in solution.events)
    assert error_at_end(solution, log, start_s)[0] < 1.05 * error_at_end(plain, log, start_s)[0] + 0.1
    assert doubtful_stops(solution) == ()
    assert contradiction(plain, ()) == 0.0
