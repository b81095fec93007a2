"""The derived redundant-measurement adapter: its memory, its curve, its level, and R on noise that is known."""

import numpy as np
import pytest

from navreplay.adapt.redundant.lag_curve import (
    Correlation,
    drift_shape,
    fit_curve,
    fit_variances,
    independent_values,
    lag_shape,
)
from navreplay.adapt.redundant.lag_memory import LAGS, _epochs_before, extend_memory, forget
from navreplay.adapt.redundant.redundancy import level_squares
from navreplay.filters.presets import build_method
from navreplay.update.gaussian import Gaussian, Innovation, Leftover

SECOND = 1_000_000_000
SATELLITES = tuple(f"range G{i:02d}" for i in range(1, 11))
TOLD = 0.64


def gauss_markov(tau, rows, n, rng, interval=1.0):
    """(rows, n) of variance one; tau [s], 0 for white noise."""
    rho = np.exp(-interval / tau) if tau else 0.0
    x = rng.standard_normal((rows, n))
    for k in range(1, n):
        x[:, k] = rho * x[:, k - 1] + np.sqrt(1 - rho**2) * x[:, k]
    return x


def sky(rng, m=10):
    """(m, 4) lines of sight and clock."""
    elevation, azimuth = rng.uniform(0.2, 1.4, m), rng.uniform(0, 2 * np.pi, m)
    level = np.cos(elevation)
    return np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation), np.ones(m)])


def innovate(residual, geometry, t_ns, labels=SATELLITES, leftover=None, told=TOLD):
    spread = geometry @ np.diag([0.04, 0.04, 0.09, 1.0]) @ geometry.T
    return Innovation(residual, np.zeros((1, len(labels))), spread, told * np.eye(len(labels)), labels, t_ns, leftover)


def run_satellites(noise, rng, interval=1.0, name="ermakf-derived", labels=SATELLITES, hidden=lambda k, label: False):
    """Variances (m, n) used for ranges that an INS predicts without error. hidden: who is not received."""
    adapter, geometry = build_method(name).adapter, sky(rng, len(labels))
    state, leftover = adapter.init(), None
    used = np.full(noise.shape, np.nan)
    for k, measured in enumerate(noise.T):
        rows = [i for i, label in enumerate(labels) if not hidden(k, label)]
        names, t_ns = tuple(labels[i] for i in rows), round((1000 + k * interval) * SECOND)
        innovation = innovate(measured[rows], geometry[rows], t_ns, names, leftover)
        adapted = adapter.adapt(state, Gaussian(np.zeros(1), np.eye(1)), innovation)
        state, leftover = adapted.state, Leftover(t_ns, dict(zip(names, measured[rows].tolist(), strict=True)))
        used[rows, k] = np.diag(adapted.noise)
    return used


def average_ratio(tau, interval, seed=2, rounds=8):
    """R used over true of Gauss-Markov noise of 5 m, once a second from the 70th on, (satellites, seconds)."""
    rng = np.random.default_rng(seed)
    seconds = [
        run_satellites(5 * gauss_markov(tau, 10, round(150 / interval), rng, interval), rng, interval) for _ in range(rounds)
    ]
    return np.concatenate(seconds)[:, round(70 / interval) :: round(1 / interval)] / 25


# what is known of few and correlated values is the mean of a skew distribution: the mean lies above the median, and above 1
@pytest.mark.parametrize("interval", [1.0, 0.2])
@pytest.mark.parametrize("tau", [0, 5, 20, 60])
def test_gauss_markov_noise_is_of_the_right_size_at_any_rate(tau, interval):
    ratio = average_ratio(tau, interval)
    assert 0.85 < np.median(ratio) < 1.25
    assert 0.9 < ratio.mean() < 1.35


def test_noise_is_the_same_at_one_and_at_five_hertz():
    """The same course of the noise, of which the slow receiver sees every fifth value."""
    rng = np.random.default_rng(4)
    noise = 5 * gauss_markov(20, 10, 1000, rng, 0.2)
    fast = run_satellites(noise, np.random.default_rng(1), 0.2)[:, 350::5]
    slow = run_satellites(noise[:, ::5], np.random.default_rng(1), 1.0)[:, 70:]
    assert np.median(fast) == pytest.approx(np.median(slow), rel=0.1)
    assert abs(np.log(fast / slow)).mean() < 0.2


def test_a_change_to_correlated_noise_is_seen_while_it_happens():
    """White noise of 0.8 m, then multipath of 4 m and 20 s beside it for 80 s."""
    rng = np.random.default_rng(1)
    used = []
    for _ in range(8):
        noise = 0.8 * gauss_markov(0, 10, 200, rng)
        noise[:, 120:] += 4 * gauss_markov(20, 10, 80, rng)
        used.append(run_satellites(noise, rng))
    used = np.concatenate(used)
    assert np.median(used[:, 70:120]) / 0.64 == pytest.approx(1, abs=0.12)
    assert 0.7 < np.median(used[:, 120:]) / 16.64 < 1.1
    assert 0.85 < np.median(used[:, 180:]) / 16.64 < 1.3


def test_whitened_noise_has_the_density_of_the_correlated_one():
    rng = np.random.default_rng(12)
    used = np.concatenate(
        [run_satellites(5 * gauss_markov(20, 10, 150, rng), rng, name="ermakf-whitened")[:, 70:] for _ in range(6)]
    )
    assert np.median(used) / 25 == pytest.approx((1 + np.exp(-1 / 20)) / (1 - np.exp(-1 / 20)), rel=0.4)
    white = run_satellites(0.8 * gauss_markov(0, 10, 150, rng), rng, name="ermakf-whitened")[:, 70:]
    assert np.median(white) / 0.64 == pytest.approx(1, rel=0.3)


def test_a_drifting_and_jumping_clock_does_not_pass_for_noise():
    rng = np.random.default_rng(13)
    clock = np.cumsum(rng.normal(size=300) * 20)
    clock[150:] += 299_792.458
    used = run_satellites(0.8 * gauss_markov(0, 10, 300, rng) + clock, rng)
    assert np.median(used[:, 70:]) / 0.64 == pytest.approx(1, abs=0.15)


def test_biases_that_stay_are_in_the_level_alone():
    rng = np.random.default_rng(3)
    used = []
    for _ in range(20):
        noise = 0.1 * gauss_markov(0, 10, 60, rng) + 6 * rng.standard_normal((10, 1))
        used.append(run_satellites(noise, rng)[:, 40:])
    # of 36.01; differences see 0.01 of it
    assert 0.5 < np.median(used) / 36 < 2


def test_a_biased_satellite_is_told_from_the_others():
    rng = np.random.default_rng(5)
    noise = 0.8 * gauss_markov(0, 10, 100, rng)
    noise[4, 40:] += 40
    used = run_satellites(noise, rng)
    rest = np.delete(used, 4, axis=0)
    assert used[4, 70:].min() > 50 * TOLD
    assert np.median(rest[:, 70:]) < 4 * TOLD


def test_a_new_satellite_has_the_noise_of_its_surroundings():
    rng = np.random.default_rng(6)
    noise = 8 * gauss_markov(0, 10, 70, rng)
    used = run_satellites(noise, rng, hidden=lambda k, label: label == SATELLITES[0] and k < 60)
    assert 0.5 < used[0, 60] / np.median(used[1:, 60]) < 3
    assert used[0, 60] > 20 * TOLD


def test_nothing_known_is_the_told_noise():
    adapter = build_method("ermakf-derived").adapter
    labels = ("position north", "position east")
    noise = 2.0 * np.eye(2)
    innovation = Innovation(np.array([50.0, -3.0]), np.zeros((1, 2)), np.eye(2), noise, labels, SECOND, None)
    adapted = adapter.adapt(adapter.init(), Gaussian(np.zeros(1), np.eye(1)), innovation)
    np.testing.assert_allclose(adapted.noise, noise)


def test_no_difference_reaches_over_a_gap_and_what_was_seen_fades():
    rng = np.random.default_rng(7)
    noise = 8 * gauss_markov(0, 10, 200, rng)
    noise[:, 80:120] = np.nan
    noise[:, 120:] = 0.8 * gauss_markov(0, 10, 80, rng) + 1000 * rng.standard_normal()
    kept = np.r_[:80, 120:200]
    adapter, geometry = build_method("ermakf-derived").adapter, sky(rng)
    state, leftover, used = adapter.init(), None, []
    for k in kept:
        residual = noise[:, k]
        adapted = adapter.adapt(
            state, Gaussian(np.zeros(1), np.eye(1)), innovate(residual, geometry, int(k) * SECOND, leftover=leftover)
        )
        state, leftover = adapted.state, Leftover(int(k) * SECOND, dict(zip(SATELLITES, residual.tolist(), strict=True)))
        used.append(np.diag(adapted.noise))
    used = np.array(used)
    assert np.median(used[60:80]) / 64 == pytest.approx(1, rel=0.3)
    assert used[80:].max() < 10 * TOLD  # forty seconds without anything, and a clock that is a kilometre off behind it
    assert np.median(used[130:]) / 0.64 == pytest.approx(1, rel=0.2)


def test_lag_sums_equal_their_definition():
    """White noise of an antenna at 2 Hz: v_L is what its path says, summed over the window's seconds."""
    rng = np.random.default_rng(8)
    z = rng.normal(size=(2, 60))
    labels, memory, leftover = ("position north", "position east"), forget(), None
    for k, residual in enumerate(z.T):
        t_ns = SECOND + k * SECOND // 2
        innovation = Innovation(residual, np.zeros((1, 2)), np.eye(2), 4 * np.eye(2), labels, t_ns, leftover)
        memory = extend_memory(memory, innovation, 1000.0, 1.5)
        leftover = Leftover(t_ns, dict(zip(labels, residual.tolist(), strict=True)))
    for column, lag in enumerate(LAGS):
        steps = round(lag * 2)
        expected = ((z[:, steps:] - z[:, : 60 - steps]) ** 2).sum(axis=1) / 2 / 4 * 0.5 if steps < 60 else np.zeros(2)
        np.testing.assert_allclose(memory.sums[:, :, column].sum(axis=0), expected)
        np.testing.assert_allclose(memory.weights[:, :, column].sum(axis=0), max(60 - steps, 0) * 0.5)


@pytest.mark.parametrize(("step", "found"), [(1.0, 6), (0.2, 6), (1.5, 5), (1.02, 6)])
def test_no_difference_counts_as_two_lags(step, found):
    """At steps of 1.5 s nothing is a lag of 1 s."""
    epochs = _epochs_before(-step * np.arange(int(40 / step), -1, -1))
    known = [epoch for epoch in epochs if epoch >= 0]
    assert len(known) == len(set(known)) == found


@pytest.mark.parametrize("correlation", [Correlation(0.0, 1.0), Correlation(0.7, 20.0), Correlation(1.0, 5.0)])
@pytest.mark.parametrize("drift", [0.0, 4.0])
def test_fit_recovers_exact_curves(correlation, drift):
    curve = 7 * lag_shape(correlation) + drift * drift_shape()
    fitted = fit_curve(curve, np.ones(len(curve)))
    assert fitted.variance == pytest.approx(7)
    assert fitted.drift == pytest.approx(drift, abs=1e-9)
    np.testing.assert_allclose(lag_shape(fitted.correlation), lag_shape(correlation))
    levels, share = fit_variances(np.array([3 / 7 * curve + 4 / 7 * drift * drift_shape()]), np.ones((1, len(curve))), fitted)
    assert levels == pytest.approx([3])
    assert share == pytest.approx([1])


@pytest.mark.parametrize("interval", [1.0, 0.2])
@pytest.mark.parametrize("correlation", [Correlation(0.0, 1.0), Correlation(1.0, 10.0), Correlation(0.7, 20.0)])
def test_independent_values_give_the_scatter_of_a_mean_square(correlation, interval):
    rng = np.random.default_rng(9)
    n = round(30 / interval)
    noise = np.sqrt(correlation.share) * gauss_markov(correlation.time, 6000, n, rng, interval)
    noise += np.sqrt(1 - correlation.share) * rng.standard_normal((6000, n))
    count = independent_values(correlation, np.array([30.0]), interval)[0]
    assert (noise**2).mean(axis=1).var() == pytest.approx(2 / count, rel=0.15)


def test_a_constant_counts_once():
    assert independent_values(Correlation(1.0, 1e6), np.array([30.0]), 0.2) == pytest.approx([1], abs=1e-3)


def test_levels_have_their_expectation():
    rng = np.random.default_rng(10)
    geometry, variance = sky(rng), rng.uniform(0.5, 2, 10)
    squares = []
    for _ in range(4000):
        residual = np.sqrt(variance) * rng.standard_normal(10)
        found, shares = level_squares(innovate(residual, geometry, 0), variance)
        squares.append(found)
    # without errors of the state, of which as many as the filter expects count as expected: slightly less
    np.testing.assert_allclose(np.mean(squares, axis=0), shares, rtol=0.1, atol=0.03)
    assert 6 <= shares.sum() <= 8


def test_levels_know_neither_the_clock_nor_much_of_the_state():
    rng = np.random.default_rng(11)
    geometry, residual, variance = sky(rng), rng.standard_normal(10), np.full(10, TOLD)
    squares, _ = level_squares(innovate(residual, geometry, 0), variance)
    jumped, _ = level_squares(innovate(residual + 1000, geometry, 0), variance)
    np.testing.assert_allclose(jumped, squares, rtol=1e-2, atol=1e-2)
    moved, _ = level_squares(innovate(residual + geometry @ [0.6, -0.6, 0.9, 0], geometry, 0), variance)
    np.testing.assert_allclose(moved, squares, atol=0.5)


def test_levels_of_fixes_are_not_judged():
    labels = ("position north", "position east", "position down")
    innovation = Innovation(np.full(3, 9.0), np.zeros((1, 3)), np.eye(3), np.eye(3), labels, 0, None)
    squares, shares = level_squares(innovation, np.ones(3))
    assert not squares.any()
    assert not shares.any()
