"""The gate: kinds judged by themselves, reopened by what they are off and in what they measure alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.options import GateOptions
from navreplay.update.gate import Gate
from navreplay.update.gaussian import Innovation, solve
from navreplay.update.reopening import LossWatch, Widening, widen

KINDS = ("position",) * 3 + ("velocity",) * 3
NAMES = tuple(f"{group}_{axis}" for group in ("position", "velocity", "attitude") for axis in "ned") + ("gyro_bias_x",)
SECOND = 1_000_000_000


def innovation(position: float, velocity: float, t_ns: int) -> Innovation:
    """Six components of unit variance, off by so much along the first axis of each kind."""
    residual = np.array([position, 0, 0, velocity, 0, 0], dtype=np.float64)
    return Innovation(residual, np.zeros((10, 6)), np.eye(6) / 2, np.eye(6) / 2, tuple("abcdef"), t_ns)


def judged(gate: Gate, position: float, velocity: float, epoch: int, step: float = 0.2):
    return gate.judge(KINDS, innovation(position, velocity, int(epoch * step * SECOND)), np.eye(6) / 2)


def test_a_velocity_that_passes_does_not_keep_positions_out() -> None:
    gate = Gate(GateOptions(reset_after=10))
    verdicts = [judged(gate, 100.0, 0.0, epoch) for epoch in range(10)]
    assert all(verdict.passed.tolist() == [3, 4, 5] for verdict in verdicts[:-1])
    assert verdicts[-1].passed.tolist() == [0, 1, 2, 3, 4, 5]
    (widening,) = verdicts[-1].widenings
    assert (widening.kind, widening.variance, widening.run) == ("position", 1e4, 10)


def test_a_filter_that_had_agreed_is_believed_for_ten_seconds() -> None:
    gate = Gate(GateOptions(reset_after=10))
    for epoch in range(20):
        judged(gate, 0.0, 0.0, epoch)
    reopened = [epoch for epoch in range(20, 120) if judged(gate, 100.0, 0.0, epoch).widenings]
    assert reopened[0] == 20 + 50
    assert reopened[1] == reopened[0] + 10  # it has not agreed since


def test_never_means_never() -> None:
    gate = Gate(GateOptions(reset_after=0))
    assert not any(judged(gate, 100.0, 100.0, epoch).widenings for epoch in range(200))


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(1, 12))
def test_a_kind_is_reopened_only_after_a_run_of_its_own(fails: list[bool], after: int) -> None:
    gate, run = Gate(GateOptions(reset_after=after)), 0
    for epoch, failed in enumerate(fails):
        widenings = judged(gate, 0.0, 100.0 if failed else 0.0, epoch, 20.0).widenings
        run = run + 1 if failed else 0
        assert all(widening.kind == "velocity" and widening.run == run >= after for widening in widenings)
        run = 0 if widenings else run


def test_what_is_not_a_number_never_passes() -> None:
    assert judged(Gate(GateOptions()), np.inf, 0.0, 0).passed.tolist() == [3, 4, 5]


@given(st.integers(0, 1000), st.sampled_from(["position", "velocity", "attitude"]), st.floats(1e-6, 1e8))
def test_widening_reaches_what_is_measured_and_nothing_else(seed: int, kind: str, variance: float) -> None:
    root = np.random.default_rng(seed).normal(size=(10, 10))
    cov = root @ root.T
    added = widen(cov, NAMES, (Widening(kind, variance, 10, 10.0),)) - cov
    expected = np.array([variance if name.startswith(kind) else 0.0 for name in NAMES])
    np.testing.assert_allclose(added, np.diag(expected), atol=1e-9 * max(variance, 1.0))


def test_the_third_widening_within_ninety_seconds_is_a_loss() -> None:
    watch, widening = LossWatch(), (Widening("position", 1.0, 10, 10.0),)
    assert [watch.lost(t * SECOND, widening) for t in (0, 80, 95, 120, 260)] == [False, False, False, True, False]
    assert not watch.lost(121 * SECOND, ())


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_a_covariance_that_rounding_spoilt_is_solved_above_a_floor(scale: float) -> None:
    cov = scale * np.array([[1.0, 1.0 + 1e-12], [1.0 + 1e-12, 1.0]])
    assert np.isfinite(solve(cov, np.ones(2))).all()
    assert not np.isfinite(solve(np.full((2, 2), np.nan), np.ones(2))).any()
