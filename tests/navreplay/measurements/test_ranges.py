"""Jacobians of ranges against finite differences, clock and motion models, and the gate for ranges."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.free_motion import FreeMotionModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.error_models.receiver_clock import ReceiverClock
from navreplay.geodesy import rotation
from navreplay.measurements.fixes import angular_rate
from navreplay.measurements.range_epochs import arrange_ranges
from navreplay.measurements.ranges import RangeNoise, carried_antenna, free_antenna, range_measurement
from navreplay.mechanisation.strapdown import Leg, NavState, idle_steps
from navreplay.options import GRADES, GateOptions, MotionOptions, RangeOptions
from navreplay.update.gaussian import Innovation
from navreplay.update.measurement import Measurement
from navreplay.update.range_gate import RangeGate
from tests.helpers.range_samples import DRIFT, OFFSETS, PLACE, SKY, START_NS, make_ranges

LEVER = np.array([1.5, -0.7, -1.1])
RATE_DTHETA = np.array([0.01, -0.02, 0.03])
NOISE = replace(GRADES["tactical"], gyro_markov_std=1e-5)
CLOCK = np.array([OFFSETS["G"] + 3.0, OFFSETS["E"] - 2.0, OFFSETS["C"], DRIFT + 0.5])


def state_at_place() -> NavState:
    attitude = rotation.quat_from_euler(0.1, -0.2, 1.2)
    return replace(NavState.at(PLACE, np.array([14.0, -6.0, 0.8]), attitude), clock=CLOCK)


def measure(state: NavState, has_imu: bool = True, multipath: bool = False) -> Measurement:
    ranges = make_ranges(1)
    rate = ranges.range_rate.copy()
    rate[4] = np.nan
    epochs, _ = arrange_ranges(replace(ranges, range_rate=rate), RangeOptions())
    shaped = 4 + np.arange(11) if multipath else np.full(11, -1)
    noise = RangeNoise(np.full(11, 4.0), np.full(11, 0.01), np.linspace(0.5, 2.0, 11), shaped)
    size = 18 if has_imu else 9
    antenna = carried_antenna(state, LEVER, angular_rate(state, RATE_DTHETA, 0.05), size) if has_imu else free_antenna(state, 9)
    return range_measurement(antenna, state.clock, epochs, slice(0, 11), noise)


@pytest.mark.parametrize(("has_imu", "multipath"), [(True, False), (False, False), (True, True)])
def test_jacobian_equals_finite_differences(has_imu, multipath):
    clock = ReceiverClock(("G", "E", "C"), RangeOptions(), tuple(SKY) if multipath else ())
    motion = NedErrorModel(NOISE) if has_imu else FreeMotionModel(MotionOptions())
    model = ClockedModel(motion, clock)
    state = state_at_place()
    if multipath:
        state = replace(state, clock=np.concatenate([CLOCK, np.linspace(-1, 1, 11)]))
    jacobian = measure(state, has_imu, multipath).jacobian
    sizes = np.concatenate([np.repeat([10.0, 0.1, 1e-4, 1e-3, 1e-3, 1e-3], 3)[: motion.size], np.full(clock.size, 1.0)])
    for i in range(model.size):
        d = np.zeros(model.size)
        d[i] = sizes[i]
        plus = measure(model.retract(state, d), has_imu, multipath).residual
        minus = measure(model.retract(state, -d), has_imu, multipath).residual
        # measured minus predicted: the residual falls by what the prediction gains; the state moves towards the error
        column = (minus - plus) / (2 * sizes[i])
        np.testing.assert_allclose(jacobian[:, i], column, rtol=2e-3, atol=2e-5, err_msg=model.names[i])


def test_exact_ranges_leave_no_residual_and_missing_rates_are_left_out():
    clock = np.array([OFFSETS["G"], OFFSETS["E"], OFFSETS["C"], DRIFT])
    still = replace(NavState.at(PLACE, np.zeros(3), np.array([1.0, 0, 0, 0])), clock=clock)
    measurement = measure(still, has_imu=False)
    np.testing.assert_allclose(measurement.residual, 0, atol=1e-6)
    assert measurement.kinds == ("range",) * 11 + ("range_rate",) * 10
    assert measurement.labels[:11] == tuple(make_ranges(1).sat.tolist())
    assert measurement.labels[4] not in measurement.labels[11:]
    np.testing.assert_allclose(np.diag(measurement.noise), [4.0] * 11 + [0.01] * 10)


@pytest.mark.parametrize("sats", [(), ("E04", "G01", "G05")])
def test_clock_steps_compose(sats):
    """Two steps one after the other are one step of their sum, in transition and in noise."""
    clock = ReceiverClock(("G", "E"), RangeOptions(), sats)
    phi, q = clock.transitions(np.array([0.7, 1.3, 2.0])), clock.noises(np.array([0.7, 1.3, 2.0]))
    np.testing.assert_allclose(phi[1] @ phi[0], phi[2])
    np.testing.assert_allclose(phi[1] @ q[0] @ phi[1].T + q[1], q[2], rtol=1e-12)
    assert np.linalg.eigvalsh(q[2]).min() > 0
    # multipath is stationary: what decays is replaced
    shaped = slice(3, 3 + len(sats))
    np.testing.assert_allclose((phi[2] @ phi[2].T + q[2])[shaped, shaped], np.eye(len(sats)), rtol=1e-12, atol=1e-15)
    assert len(clock.names) == len(clock.units) == clock.size == 3 + len(sats)


@pytest.mark.parametrize("model", ["velocity", "acceleration"])
def test_free_motion_steps_compose_and_carry_the_clock(model):
    motion = FreeMotionModel(MotionOptions(model))
    both = ClockedModel(motion, ReceiverClock(("G",), RangeOptions()))
    state, cov = motion.start(PLACE, np.array([3.0, 4.0, -0.5]), np.eye(3), np.eye(3) * 0.1)
    state = replace(state, clock=np.array([100.0, 7.0]), acceleration=np.zeros(3))
    full = np.zeros((both.size, both.size))
    full[: motion.size, : motion.size] = cov
    full[0, -2] = full[-2, 0] = 0.3
    full[-2, -2], full[-1, -1] = 4.0, 0.25
    steps = idle_steps(START_NS, START_NS + np.array([400_000_000, 1_000_000_000]))
    fine = both.propagate(state, full, Leg(steps, 0, np.array([1, 2]), 1.0, keep=True))
    coarse = both.propagate(state, full, Leg(steps, 0, np.array([2]), 1.0, keep=True))
    rest = np.r_[0:6, 9 : both.size]
    np.testing.assert_allclose(fine.covariances[1][np.ix_(rest, rest)], coarse.covariances[0][np.ix_(rest, rest)], atol=1e-12)
    total = fine.transitions[1] @ fine.transitions[0]
    np.testing.assert_allclose(total, coarse.transitions[0], atol=1e-12)
    expected = total @ full @ total.T + fine.transitions[1] @ fine.noises[0] @ fine.transitions[1].T + fine.noises[1]
    np.testing.assert_allclose(fine.covariances[1][np.ix_(rest, rest)], expected[np.ix_(rest, rest)], atol=1e-12)
    end = NavState.unpack(coarse.states[0])
    np.testing.assert_allclose(end.clock, [107.0, 7.0])
    assert rotation.euler_from_quat(end.q_nb)[2] == pytest.approx(np.arctan2(4, 3))


def test_clocked_model_equals_one_propagation_with_all_transitions():
    """The clock's covariance through the kernel is that of the block-diagonal transition from node to node."""
    motion = NedErrorModel(NOISE)
    model = ClockedModel(motion, ReceiverClock(("G", "E"), RangeOptions()))
    steps = idle_steps(START_NS, START_NS + np.arange(1, 201) * 10_000_000)
    steps.dvel[:, 2] = -9.8 * 0.01
    rng = np.random.default_rng(1)
    root = rng.normal(size=(model.size, model.size)) * np.concatenate(
        [np.repeat([1, 0.1, 1e-3, 1e-5, 1e-3, 1e-5], 3), [5, 5, 1]]
    )
    cov = root.T @ root
    state = replace(state_at_place(), clock=np.array([1.0, 2.0, 3.0]))
    moved = model.propagate(state, cov, Leg(steps, 0, np.array([50, 120, 200]), 0.05, keep=True))
    p = cov
    for node in range(3):
        p = moved.transitions[node] @ p @ moved.transitions[node].T + moved.noises[node]
        scale = np.sqrt(np.diag(p))
        np.testing.assert_allclose(moved.covariances[node] / np.outer(scale, scale), p / np.outer(scale, scale), atol=1e-9)


def gate_problem(faults: dict[int, float], clock_std: float = 100.0) -> tuple[Innovation, tuple[str, ...]]:
    """Eight pseudoranges of unit noise that share an offset known to clock_std."""
    rng = np.random.default_rng(2)
    residual = 40.0 + rng.normal(size=8)
    for i, fault in faults.items():
        residual[i] += fault
    spread = np.full((8, 8), clock_std**2)
    return Innovation(residual, np.ones((3, 8)), spread, np.eye(8), tuple("abcdefgh")), ("range",) * 8


def test_a_loose_clock_hides_no_fault():
    innovation, kinds = gate_problem({2: 12.0, 5: -30.0})
    verdict = RangeGate(GateOptions()).judge(kinds, innovation, np.eye(8))
    assert verdict.passed.tolist() == [0, 1, 3, 4, 6, 7]
    assert "beyond the gate of 15.1" in verdict.reasons[2]
    assert verdict.reasons[0] == ""


def test_the_gate_lets_good_measurements_pass_and_may_be_off():
    innovation, kinds = gate_problem({})
    assert len(RangeGate(GateOptions()).judge(kinds, innovation, np.eye(8)).passed) == 8
    faulty, _ = gate_problem({1: 500.0})
    assert len(RangeGate(GateOptions(probability=1.0)).judge(kinds, faulty, np.eye(8)).passed) == 8


def test_the_range_gate_reopens_after_a_run_of_disagreement():
    innovation, kinds = gate_problem({i: 100.0 * (-1) ** i for i in range(8)}, clock_std=1.0)
    gate = RangeGate(GateOptions(reset_after=3))
    verdicts = [gate.judge(kinds, innovation, np.eye(8)) for _ in range(3)]
    assert [len(verdict.widenings) for verdict in verdicts] == [0, 0, 1]
    (widening,) = verdicts[2].widenings
    assert (widening.kind, widening.run) == ("range", 3)
    assert widening.variance == pytest.approx(np.median(np.square(innovation.residual)))
    assert len(verdicts[2].passed) == 0
    assert not gate.judge(kinds, innovation, np.eye(8)).widenings
