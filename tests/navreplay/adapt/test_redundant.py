"""The adapters that estimate R from redundant measurements, and the window functions beneath them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.adapt.redundant.autoregression import akaike_order, autocorrelation, burg, explained_share
from navreplay.adapt.redundant.eiakf import corrected_variance
from navreplay.adapt.redundant.ermakf import correlated_variance
from navreplay.adapt.redundant.kernel_density import is_credible, kernel_density, silverman_bandwidth
from navreplay.adapt.redundant.random_weights import random_weights
from navreplay.adapt.redundant.trails import remove_common
from navreplay.filters.presets import build_method
from navreplay.update.gaussian import Gaussian, Innovation, Leftover, condition

NAMES = ("eiakf", "srmakf", "ermakf", "ermakf-derived")
DIFFERENCING = NAMES[1:]
SECOND = 1_000_000_000
LABELS = ("position north", "position east", "position down")


def gauss_markov(tau: float, rows: int, n: int, seed: int) -> np.ndarray:
    """(rows, n) of variance one; tau in samples, 0 for white noise."""
    rng = np.random.default_rng(seed)
    rho = np.exp(-1 / tau) if tau else 0.0
    x = rng.standard_normal((rows, n))
    for k in range(1, n):
        x[:, k] = rho * x[:, k - 1] + np.sqrt(1 - rho**2) * x[:, k]
    return x


def run_adapter(name, noise, parameters=None, times=None, told=1.0, labels=LABELS, spread=0.01):
    """Variances used (n, m) by an adapter in a filter of m random walks whose predictions have a variance of `spread`."""
    adapter = build_method(name, parameters).adapter
    m = noise.shape[1]
    walk = np.random.default_rng(77).standard_normal(noise.shape) * spread / np.sqrt(spread + told)
    state, leftover, used = adapter.init(), None, []
    estimate = np.zeros(m)
    truth = np.cumsum(walk, axis=0)
    times = range(1, len(noise) + 1) if times is None else times
    for t, measured in zip(times, noise + truth, strict=True):
        innovation = Innovation(
            measured - estimate, spread * np.eye(m), spread * np.eye(m), told * np.eye(m), labels, t * SECOND, leftover
        )
        adapted = adapter.adapt(state, Gaussian(np.zeros(m), spread * np.eye(m)), innovation)
        estimate = estimate + condition(adapted.prior, innovation, adapted.noise).mean
        leftover = Leftover(t * SECOND, dict(zip(labels, (measured - estimate).tolist(), strict=True)))
        state = adapted.state
        used.append(np.diag(adapted.noise))
    return np.array(used)


@pytest.mark.parametrize("name", [*NAMES, "ermakf-whitened"])
def test_contract_on_a_running_filter(name):
    """R stays symmetric positive definite and what came in is not changed, with satellites that come and go."""
    adapter = build_method(name).adapter
    rng = np.random.default_rng(3)
    satellites = [f"range G{i:02d}" for i in range(1, 9)] + [f"range_rate G{i:02d}" for i in range(1, 9)]
    outputs = []
    for _ in range(2):
        rng = np.random.default_rng(3)
        state, leftover, noises = adapter.init(), None, []
        for t in range(1, 90):
            labels = tuple(label for label in satellites if t % 31 or label.endswith("1"))
            m = len(labels)
            root = rng.normal(size=(m, m)) * 0.1
            told = np.diag(rng.uniform(0.5, 2, m))
            residual = rng.normal(size=m) * 3 + (20 if t % 40 == 0 else 0)
            parts = (residual, rng.normal(size=(4, m)), root @ root.T, told)
            innovation = Innovation(*parts, labels, t * SECOND, leftover)
            before = [part.copy() for part in parts]
            adapted = adapter.adapt(state, Gaussian(np.zeros(4), np.eye(4)), innovation)
            for was, part in zip(before, parts, strict=True):
                np.testing.assert_array_equal(was, part)
            assert np.linalg.eigvalsh(adapted.noise).min() > 0
            np.testing.assert_array_equal(adapted.noise, adapted.noise.T)
            state, leftover = adapted.state, Leftover(t * SECOND, dict(zip(labels, residual.tolist(), strict=True)))
            noises.append(adapted.noise.sum())
        outputs.append(noises)
    assert outputs[0] == outputs[1]
    assert len(set(outputs[0])) > 50  # it did adapt


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("actual", [0.3, 1.0, 4.0])
def test_white_noise_is_recovered(name, actual):
    noise = actual * gauss_markov(0, 3, 1200, seed=5).T
    used = run_adapter(name, noise)[100:]
    window = 30
    # differences of white noise correlate by -1/2, so that one window scatters by sqrt(3 / window); windows overlap, and
    # about 3 * 1100 / window of them are independent
    sigma = actual**2 * np.sqrt(3 / window) / np.sqrt(3 * 1100 / window)
    # the state's own errors are in the differences; eiakf also takes one window in twenty for correlated
    own = {"eiakf": 0.03 * actual**2}.get(name, 0.01)
    assert abs(used.mean() - actual**2 - own) < 5 * sigma + 0.02 * actual**2


def test_scatter_of_srmakf_is_that_of_theory():
    used = run_adapter("srmakf", gauss_markov(0, 3, 2000, seed=8).T, spread=1e-6)[30:]
    assert used.std() == pytest.approx(np.sqrt(3 / 30), rel=0.15)


@pytest.mark.parametrize("name", NAMES)
def test_a_step_of_the_noise_is_followed(name):
    noise = gauss_markov(0, 3, 600, seed=6).T
    noise[300:] *= 4
    used = run_adapter(name, noise)
    assert np.median(used[100:300]) == pytest.approx(1, rel=0.25)
    assert np.median(used[380:]) == pytest.approx(16, rel=0.25)


BIAS_FACTORS = [(0, 1.0, 1.9, 2.3), (5, 0.18, 0.17, 0.23), (20, 0.049, 0.045, 0.06), (60, 0.0165, 0.015, 0.021)]


@pytest.mark.parametrize(("tau", "plain", "low", "high"), BIAS_FACTORS)
def test_bias_factors_of_the_printed_variance(tau, plain, low, high):
    """R estimated over true: (29) doubles white noise and sees no more of correlated noise than (17) does."""
    differences = np.diff(gauss_markov(tau, 4000, 61, seed=9), axis=1)
    assert (differences**2).mean() / 2 == pytest.approx(plain, rel=0.05)
    assert low < np.mean(correlated_variance(differences, 8, 0.1) / 2) < high


def test_derived_beats_printed_on_correlated_noise_in_the_filter():
    noise = 5 * gauss_markov(20, 3, 1500, seed=12).T
    ratio = {name: run_adapter(name, noise)[100:].mean() / 25 for name in DIFFERENCING}
    assert ratio["srmakf"] < 0.07
    assert ratio["ermakf"] < 0.1
    assert 0.6 < ratio["ermakf-derived"] < 2


def test_whitened_noise_has_the_density_of_the_correlated_one():
    noise = 5 * gauss_markov(20, 3, 1000, seed=12).T
    derived, whitened = (run_adapter(name, noise)[100:] for name in ("ermakf-derived", "ermakf-whitened"))
    assert (whitened >= 0.999 * derived).all()
    # (1 + rho) / (1 - rho) is 40 for 20 epochs; three components without redundancy show less of it
    assert 5 < np.median(whitened) / 25 < 60
    white = run_adapter("ermakf-whitened", gauss_markov(0, 3, 600, seed=5).T)[100:]
    assert np.median(white) == pytest.approx(1, rel=0.15)


def test_burg_finds_a_known_process():
    rng = np.random.default_rng(2)
    x = np.zeros((3, 6000))
    shock = rng.normal(size=x.shape)
    for k in range(2, x.shape[1]):
        x[:, k] = 1.2 * x[:, k - 1] - 0.6 * x[:, k - 2] + shock[:, k]
    predictors, variances = burg(x, 6)
    np.testing.assert_allclose(predictors[2, :, :2], np.tile([1.2, -0.6], (3, 1)), atol=0.03)
    np.testing.assert_array_equal(predictors[2, :, 2:], 0)
    np.testing.assert_allclose(variances[2], 1, rtol=0.05)
    assert (akaike_order(variances, x.shape[1]) >= 2).all()
    # gamma_0 = sigma^2 / (1 - sum of a beta)
    np.testing.assert_allclose(1 - explained_share(x, 2), 1 / x.var(axis=1), rtol=0.05)


@given(st.integers(0, 1000))
def test_burg_is_stable_and_never_gains_error(seed):
    x = np.random.default_rng(seed).normal(size=(2, 20)).cumsum(axis=1)
    predictors, variances = burg(x, 5)
    assert (np.diff(variances, axis=0) <= 1e-12).all()
    for row in predictors[5]:
        assert np.abs(np.roots([1, *(-row)])).max() < 1 + 1e-9


def test_burg_of_order_one_is_its_closed_form():
    x = np.array([[1.0, 2.0, -1.0, 0.5]])
    predictors, _ = burg(x, 1)
    expected = 2 * (1 * 2 + 2 * -1 + -1 * 0.5) / (1 + 4 + 4 + 1 + 1 + 0.25)
    assert predictors[1, 0, 0] == pytest.approx(expected)


def test_silent_sequences_give_no_correlation():
    silent = np.zeros((1, 30))
    assert explained_share(silent, 4) == pytest.approx([0])
    assert autocorrelation(silent, 2) == pytest.approx(np.zeros((1, 2)))
    assert corrected_variance(silent, 0.1) == pytest.approx([0])
    assert correlated_variance(silent, 4, 0.1) == pytest.approx([0])


def test_denominators_are_guarded():
    ramp = np.arange(1.0, 31.0)[None, :]
    mean_square = (ramp**2).mean()
    assert correlated_variance(ramp, 4, 0.5) == pytest.approx([mean_square / 0.5])
    assert corrected_variance(ramp, 0.5) == pytest.approx([mean_square / 0.5])


def test_random_weights_are_dirichlet_and_repeatable():
    counts = np.array([30.0, 12.0, 0.0])
    weights = random_weights(4, 17, counts, 30, 1.0, 1)
    np.testing.assert_array_equal(weights, random_weights(4, 17, counts, 30, 1.0, 1))
    assert not np.array_equal(weights, random_weights(5, 17, counts, 30, 1.0, 1))
    assert not np.array_equal(weights, random_weights(4, 18, counts, 30, 1.0, 1))
    np.testing.assert_allclose(weights.sum(axis=1), [1, 1, 0])
    assert (weights[1, :18] == 0).all()
    many = random_weights(1, 1, np.full(4000, 10.0), 10, 1.0, 1)
    # of a flat Dirichlet distribution: variance (n - 1) / (n^2 (n + 1))
    assert many.var() == pytest.approx(9 / 1100, rel=0.05)
    assert random_weights(1, 1, np.full(4000, 10.0), 10, 1.0, 50).var() == pytest.approx(9 / 1100 / 50, rel=0.1)


def test_kernel_density_integrates_to_one_and_its_bandwidth_is_silvermans():
    samples = np.random.default_rng(0).normal(size=(1, 40))
    grid = np.linspace(-8, 8, 400)
    width = silverman_bandwidth(np.array([2.0]), 32)
    assert width == pytest.approx([1.06 * 2.0 / 2.0])
    density = [kernel_density(samples, np.array([z]), width)[0] for z in grid]
    assert np.trapezoid(density, grid) == pytest.approx(1, abs=1e-3)


def test_credibility_rejects_what_lies_far_out():
    samples = np.random.default_rng(1).normal(size=(2000, 30))
    assert is_credible(samples, np.zeros(2000)).all()
    assert is_credible(samples, np.random.default_rng(2).normal(size=2000)).mean() > 0.98
    assert not is_credible(samples, np.full(2000, 6.0)).any()


def test_correlated_noise_is_not_doubted():
    """The detection sees differences, which are as normal as before: it is no detector of correlation."""
    adapter = build_method("ermakf").adapter
    state, leftover, doubts = adapter.init(), None, 0
    for t, row in enumerate(5 * gauss_markov(20, 3, 1000, seed=4).T, 1):
        innovation = Innovation(row, np.zeros((1, 3)), np.zeros((3, 3)), np.eye(3), LABELS, t * SECOND, leftover)
        state = adapter.adapt(state, Gaussian(np.zeros(1), np.eye(1)), innovation).state
        leftover = Leftover(t * SECOND, dict(zip(LABELS, row.tolist(), strict=True)))
        doubts += sum(trail.doubtful >= adapter.doubtful for trail in state.values())
    assert doubts < 5


def test_the_clocks_part_leaves_ranges_and_only_ranges():
    labels = (*(f"range G{i:02d}" for i in range(1, 7)), "range_rate G01", *LABELS)
    values = np.array([100.0, 101, 102, 103, np.nan, 190, 7, 1, 2, 3])
    left = remove_common(labels, values, np.ones(10))
    # four agree on 101.5 and are stretched for their quarter in it; the fifth is shrunk for the error of the mean
    stretch, shrink = np.sqrt(4 / 3), np.sqrt(4 / 5)
    expected = [-1.5 * stretch, -0.5 * stretch, 0.5 * stretch, 1.5 * stretch, np.nan, 88.5 * shrink, 7, 1, 2, 3]
    np.testing.assert_allclose(left, expected)
    np.testing.assert_array_equal(remove_common(labels[:3], values[:3], np.ones(3)), values[:3])


def test_what_the_clock_leaves_has_the_variance_it_had():
    rng = np.random.default_rng(6)
    labels = tuple(f"range G{i:02d}" for i in range(1, 9))
    variances = np.linspace(0.5, 4, 8)
    left = np.array([remove_common(labels, rng.normal(size=8) * np.sqrt(variances) + 1e3, variances) for _ in range(4000)])
    np.testing.assert_allclose((left**2).mean(axis=0), variances, rtol=0.1)


@pytest.mark.parametrize("name", DIFFERENCING[:-1])
def test_a_drifting_clock_does_not_pass_for_noise(name):
    rng = np.random.default_rng(0)
    labels = tuple(f"range G{i:02d}" for i in range(1, 11))
    clock = np.cumsum(rng.normal(size=400) * 20)[:, None]
    clock[200:] += 299_792.458
    used = run_adapter(name, gauss_markov(0, 10, 400, seed=3).T + clock, labels=labels)
    assert used[70:].mean() == pytest.approx(1, abs=0.07)


@pytest.mark.parametrize("name", NAMES[:-1])
def test_a_gap_restarts_the_windows(name):
    noise = 3 * gauss_markov(0, 3, 160, seed=2).T
    noise[80:] += 500.0
    times = [*range(1, 81), *range(101, 181)]
    used = run_adapter(
        name, noise[:, :1] if name == "eiakf" else noise, labels=LABELS[:1] if name == "eiakf" else LABELS, times=times
    )
    assert (used[80:89] == 1).all()
    if name != "eiakf":
        assert used[100:].max() < 30  # the step of 500 was not differenced


@pytest.mark.parametrize("name", DIFFERENCING)
def test_a_slow_receiver_is_left_alone(name):
    used = run_adapter(name, 3 * gauss_markov(0, 3, 50, seed=2).T, times=range(5, 255, 5))
    assert (used == 1).all()


def test_noise_is_scaled_from_what_is_told():
    noise = gauss_markov(0, 3, 300, seed=2).T
    once, again = run_adapter("srmakf", noise, told=1.0), run_adapter("srmakf", noise, told=25.0)
    np.testing.assert_allclose(once[40:].mean(), again[40:].mean(), rtol=0.05)


def test_a_rejected_outlier_stays_in_its_own_difference():
    """The leftover is that of the state as it was corrected, so an outlier that was kept out moves no other component."""
    adapter = build_method("srmakf", {"least": 1}).adapter
    told = np.eye(2)
    first = Innovation(np.array([0.0, 50.0]), np.ones((1, 2)), np.ones((2, 2)), told, LABELS[:2], SECOND, None)
    prior = Gaussian(np.zeros(1), np.eye(1))
    state = adapter.adapt(adapter.init(), prior, first).state
    left = Leftover(SECOND, {LABELS[0]: 0.0, LABELS[1]: 50.0})
    second = first._replace(residual=np.array([1.0, 0.0]), t_ns=2 * SECOND, leftover=left)
    noise = np.diag(adapter.adapt(state, prior, second).noise)
    np.testing.assert_allclose(noise, [0.5, 1250])
