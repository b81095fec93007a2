"""The measurement update against textbook forms, and the contracts that every adapter keeps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.filters.presets import PRESETS, build_method
from navreplay.moments.linearised import Linearised
from navreplay.timeline import LogError
from navreplay.update.gaussian import Gaussian, Innovation, chi_square, condition, kalman_gain
from navreplay.update.measurement import Measurement


def random_problem(seed: int, n: int = 6, m: int = 3) -> tuple[Gaussian, Measurement]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n)) * np.logspace(-2, 2, n)[:, None]
    noise_root = rng.normal(size=(m, m)) + 2 * np.eye(m)
    measurement = Measurement(
        rng.normal(size=m) * 10, rng.normal(size=(m, n)), noise_root @ noise_root.T, ("position",) * m, tuple("abcdef")[:m]
    )
    return Gaussian(np.zeros(n), root @ root.T), measurement


@given(st.integers(0, 10_000))
def test_update_equals_the_information_filter(seed):
    prior, z = random_problem(seed)
    innovation = Linearised().innovate(prior, z)
    posterior = condition(prior, innovation, z.noise)
    information = np.linalg.inv(prior.cov) + z.jacobian.T @ np.linalg.inv(z.noise) @ z.jacobian
    mean = np.linalg.solve(information, z.jacobian.T @ np.linalg.inv(z.noise) @ z.residual)
    scale = np.sqrt(np.diag(prior.cov))
    np.testing.assert_allclose(
        posterior.cov / np.outer(scale, scale), np.linalg.inv(information) / np.outer(scale, scale), atol=1e-7
    )
    np.testing.assert_allclose(posterior.mean / scale, mean / scale, atol=1e-6)


@given(st.integers(0, 10_000))
def test_any_gain_gives_the_joseph_form(seed):
    prior, z = random_problem(seed)
    gain = np.random.default_rng(seed).normal(size=(6, 3))
    got = condition(prior, Linearised().innovate(prior, z), z.noise, gain).cov
    keep = np.eye(6) - gain @ z.jacobian
    expected = keep @ prior.cov @ keep.T + gain @ z.noise @ gain.T
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(got, got.T)


def test_a_nonzero_prior_mean_shifts_the_residual():
    prior, z = random_problem(3)
    shifted = Gaussian(np.arange(6.0), prior.cov)
    posterior = condition(shifted, Linearised().innovate(shifted, z), z.noise)
    centred = z._replace(residual=z.residual - z.jacobian @ shifted.mean)
    expected = condition(prior, Linearised().innovate(prior, centred), z.noise)
    np.testing.assert_allclose(posterior.mean, shifted.mean + expected.mean, rtol=1e-12)


def test_selecting_components_is_leaving_out_rows():
    prior, z = random_problem(4)
    rows = np.array([0, 2])
    part = Linearised().innovate(prior, z).select(rows)
    fewer = Measurement(z.residual[rows], z.jacobian[rows], z.noise[np.ix_(rows, rows)], ("position",) * 2, ("a", "c"))
    expected = Linearised().innovate(prior, fewer)
    np.testing.assert_allclose(part.cross, expected.cross)
    np.testing.assert_allclose(part.spread, expected.spread)
    assert part.labels == expected.labels == ("position a", "position c")


def test_chi_square():
    assert chi_square(np.array([2.0, 3.0]), np.diag([4.0, 9.0])) == pytest.approx(2.0)


def scalar_innovations(count: int, noise_std: float, seed: int) -> list[Innovation]:
    """Innovations of a converged filter: spread 1, told noise 1, actual noise of noise_std, three components."""
    rng = np.random.default_rng(seed)
    residual = rng.normal(size=(count, 3)) * np.sqrt(1 + noise_std**2)
    return [Innovation(r, np.eye(2, 3) / 2, np.eye(3), np.eye(3), ("a", "b", "c")) for r in residual]


PRIOR = Gaussian(np.zeros(2), np.eye(2))


@pytest.mark.parametrize("name", PRESETS)
def test_adapter_contract(name):
    """R stays symmetric positive definite, nothing is mutated, and the same input gives the same output."""
    adapter = build_method(name).adapter
    outputs = []
    for _ in range(2):
        state = adapter.init()
        noises = []
        for innovation in scalar_innovations(60, 2.0, seed=5):
            before = [np.copy(part) for part in innovation[:4]]
            adapted = adapter.adapt(state, PRIOR, innovation)
            for was, part in zip(before, innovation[:4], strict=True):
                np.testing.assert_array_equal(was, part)
            assert np.linalg.eigvalsh(adapted.noise).min() > 0
            np.testing.assert_array_equal(adapted.noise, adapted.noise.T)
            assert np.linalg.eigvalsh(adapted.prior.cov).min() > 0
            state = adapted.state
            noises.append(adapted.noise)
        outputs.append(np.array(noises))
    np.testing.assert_array_equal(outputs[0], outputs[1])


@pytest.mark.parametrize(("name", "last"), [("iae", 200), ("sage-husa", 200)])
@pytest.mark.parametrize("actual", [0.5, 1.0, 3.0])
def test_averaging_adapters_find_the_actual_noise(name, last, actual):
    adapter = build_method(name, {"window": 100} if name == "iae" else {"forgetting": 0.99}).adapter
    state = adapter.init()
    found = []
    for innovation in scalar_innovations(2000, actual, seed=11):
        adapted = adapter.adapt(state, PRIOR, innovation)
        state = adapted.state
        found.append(np.diag(adapted.noise))
    mean = np.mean(found[last:])
    # variance of nu^2 is 2 (1 + actual^2)^2; about 54 independent means of three components
    assert mean == pytest.approx(actual**2, abs=4 * (1 + actual**2) * np.sqrt(2 / 1800 / 3))


def test_iae_keeps_the_told_noise_until_its_window_is_full():
    adapter = build_method("iae", {"window": 10}).adapter
    state = adapter.init()
    for count, innovation in enumerate(scalar_innovations(12, 5.0, seed=1), 1):
        adapted = adapter.adapt(state, PRIOR, innovation)
        state = adapted.state
        assert np.array_equal(adapted.noise, np.eye(3)) == (count < 10)


def test_iae_equals_the_printed_formula_with_constant_noise():
    innovations = scalar_innovations(10, 3.0, seed=2)
    adapter = build_method("iae", {"window": 10}).adapter
    state = adapter.init()
    for innovation in innovations:
        adapted = adapter.adapt(state, PRIOR, innovation)
        state = adapted.state
    printed = np.mean([np.outer(i.residual, i.residual) for i in innovations], axis=0) - np.eye(3)
    np.testing.assert_allclose(np.diag(adapted.noise), np.diag(printed))


def test_huber_leaves_good_measurements_alone_and_enlarges_outliers():
    adapter = build_method("huber").adapter
    good = Innovation(np.array([0.5, -0.3, 0.1]), np.ones((2, 3)), np.eye(3), np.eye(3), ("a", "b", "c"))
    np.testing.assert_array_equal(adapter.adapt(None, PRIOR, good).noise, np.eye(3))
    bad = good._replace(residual=np.array([0.5, 30.0, 0.1]))
    noise = np.diag(adapter.adapt(None, PRIOR, bad).noise)
    np.testing.assert_allclose(noise[[0, 2]], 1)
    # fixed point of r = nu R / (1 + R), R = |r| / k: R = nu / k - 1
    assert noise[1] == pytest.approx(30 / 1.345 - 1, rel=5e-3)


def test_method_errors_say_what_would_be_valid():
    with pytest.raises(LogError, match="there is no 'hubert'; did you mean 'huber'"):
        build_method("hubert")
    with pytest.raises(LogError, match="no parameter 'windw'; did you mean 'window'"):
        build_method("iae", {"windw": 3})
    with pytest.raises(LogError, match=r"'window' must be a whole number, got 2\.5"):
        build_method("iae", {"window": 2.5})
    with pytest.raises(LogError, match="'threshold' must be positive, got -1"):
        build_method("huber", {"threshold": -1})


def test_gain_of_a_perfect_measurement_takes_all():
    prior, z = random_problem(9, n=3)
    innovation = Linearised().innovate(prior, z._replace(jacobian=np.eye(3)))
    np.testing.assert_allclose(kalman_gain(innovation, np.zeros((3, 3))), np.eye(3), atol=1e-6)
