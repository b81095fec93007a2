"""Stamps: batches are spread, steps of a clock undone, and what is in order, at rest or in disorder, is left alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from importers.rows.stamps import mend_stamps

SECOND = 1_000_000_000


def even(n: int, rate: float) -> np.ndarray:
    return 5 * SECOND + np.rint(np.arange(n) / rate * SECOND).astype(np.int64)


@pytest.mark.parametrize("size", [4, 5, 10, 32])
@pytest.mark.parametrize("rate", [100.0, 400.0])
def test_batches_are_spread(size: int, rate: float) -> None:
    true = even(size * 60, rate)
    stamped = true[np.arange(len(true)) // size * size + size - 1]
    mended, notes = mend_stamps(stamped)
    assert np.abs(mended - true).max() <= 1
    assert f"batches of {size}" in notes[0]


@pytest.mark.parametrize("step", [0.3, 0.8, 5.0, 30.0])
@pytest.mark.parametrize("rate", [5.0, 100.0])
def test_a_step_of_the_clock_is_undone(step: float, rate: float) -> None:
    true = even(400, rate)
    stamped = true - np.where(np.arange(400) >= 170, round(step * SECOND), 0)
    mended, notes = mend_stamps(stamped)
    if step - 1 / rate < 2 / rate:
        assert np.array_equal(mended, stamped)
    else:
        assert np.array_equal(mended, true)
        assert f"set back by {step:.3f} s behind row 170" in notes[0]


@given(st.integers(0, 100), st.floats(0.0, 0.4))
def test_jitter_in_order_is_left_alone(seed: int, size: float) -> None:
    t_ns = even(300, 100.0) + np.rint(np.random.default_rng(seed).uniform(0, size, 300) * 1e7).astype(np.int64)
    mended, notes = mend_stamps(t_ns)
    assert np.array_equal(mended, t_ns)
    assert notes == ()


def test_disorder_gaps_and_pairs_are_left_alone() -> None:
    shuffled = even(300, 100.0)
    shuffled[100:110] = shuffled[100:110][::-1]
    gap = even(300, 100.0) + np.where(np.arange(300) > 150, 7 * SECOND, 0)
    pairs = even(300, 100.0)[np.arange(300) // 2 * 2]
    again = np.concatenate([even(150, 100.0), even(150, 100.0) - 3600 * SECOND])
    for t_ns in (shuffled, gap, pairs, again):
        mended, notes = mend_stamps(t_ns)
        assert np.array_equal(mended, t_ns)
        assert notes == ()


def test_a_step_that_the_recorder_did_not_see_is_undone_either_way():
    log_time = 1_700_000_000_000_000_000 + np.arange(200) * 10**9 + np.random.default_rng(1).integers(0, 10**7, 200)
    for step in (-2_500_000_000, 2_500_000_000):
        true = log_time - log_time % 10**9
        stamps = true + np.where(np.arange(200) >= 90, step, 0)
        mended, notes = mend_stamps(stamps, log_time)
        np.testing.assert_allclose(mended, true, atol=2 * 10**7)
        assert len(notes) == 1
        assert any(figure in notes[0] for figure in ("by 2.49", "by 2.50"))
        assert ("back" in notes[0]) == (step < 0)


def test_a_pause_that_both_clocks_saw_stays():
    t_ns = 1_700_000_000_000_000_000 + np.arange(200) * 10**8 + np.where(np.arange(200) >= 90, 5 * 10**9, 0)
    mended, notes = mend_stamps(t_ns, t_ns + 10**6)
    assert mended is t_ns
    assert notes == ()


def test_whole_seconds_begin_with_their_rows():
    t_ns = 1_700_000_000_000_000_000 + np.arange(500) * 2 * 10**8
    mended, notes = mend_stamps(t_ns - t_ns % 10**9)
    np.testing.assert_array_equal(mended, t_ns)
    assert "whole seconds" in notes[0]
