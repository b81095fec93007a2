"""Properties of the single adapters: likelihoods, gradients, limits, and what each finds where the answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from navreplay.adapt.inflation.h_infinity import HInfinity
from navreplay.adapt.inflation.strong_tracking import StrongTracking
from navreplay.adapt.joint import inflate, posterior_square
from navreplay.adapt.likelihood import _likelihood_kernel
from navreplay.adapt.likelihood.em import Em, Estimate, PrintedEm, improve
from navreplay.adapt.likelihood.gaussian_likelihood import misfit, stack_innovations
from navreplay.adapt.likelihood.maximum_likelihood import GeneticLikelihood, MaximumLikelihood
from navreplay.adapt.likelihood.variational_bayes import VariationalBayes
from navreplay.adapt.robust.correntropy import Correntropy
from navreplay.adapt.robust.huber import Huber
from navreplay.adapt.robust.student_t import StudentT
from navreplay.adapt.windowed.iae import Iae
from navreplay.adapt.windowed.iae_q import IaeQ
from navreplay.adapt.windowed.sage_husa import SageHusa
from navreplay.filters.presets import PRESETS, build_method
from navreplay.moments.linearised import Linearised
from navreplay.update.gaussian import Gaussian, Innovation, condition
from navreplay.update.measurement import Measurement

LABELS = tuple("abcdef")


def draw_problem(seed: int, n: int = 5, m: int = 3) -> tuple[Gaussian, Measurement]:
    rng = np.random.default_rng(seed)
    root, noise_root = rng.normal(size=(n, n)), rng.normal(size=(m, m)) + 2 * np.eye(m)
    measurement = Measurement(
        rng.normal(size=m) * 3, rng.normal(size=(m, n)), noise_root @ noise_root.T, ("position",) * m, LABELS[:m]
    )
    return Gaussian(rng.normal(size=n), root @ root.T), measurement


def log_likelihood(estimate: Estimate) -> float:
    cov = estimate.innovation.spread + estimate.noise
    return float(multivariate_normal.logpdf(estimate.innovation.residual, np.zeros(len(cov)), cov))


def climb(seed: int, printed: bool, components: int = 3) -> np.ndarray:
    """Change of the log-likelihood in each of eight iterations."""
    prior, z = draw_problem(seed, m=components)
    now = Estimate(prior, Linearised().innovate(prior, z), z.noise)
    values = [log_likelihood(now)]
    for _ in range(8):
        now = improve(now, 0.05, printed)
        values.append(log_likelihood(now))
    return np.diff(values)


@given(st.integers(0, 10_000))
def test_derived_em_never_loses_likelihood(seed):
    assert climb(seed, printed=False).min() > -1e-8


def test_printed_em_loses_likelihood():
    """Of one component; with more, what it gains in the directions without residual outweighs the loss."""
    assert np.mean([climb(seed, printed=True, components=1).min() < -0.01 for seed in range(50)]) > 0.5


@given(st.integers(0, 10_000))
def test_em_carries_the_moments_of_the_prediction(seed):
    prior, z = draw_problem(seed)
    found = improve(Estimate(prior, Linearised().innovate(prior, z), z.noise), 0.05)
    again = Linearised().innovate(found.prior, z)
    np.testing.assert_allclose(found.innovation.spread, again.spread, atol=1e-9 * np.abs(again.spread).max())
    np.testing.assert_allclose(found.innovation.cross, again.cross, atol=1e-9 * np.abs(again.cross).max())
    assert np.linalg.eigvals(np.linalg.solve(z.noise, found.noise)).real.min() > 0.05 * (1 - 1e-9)


@pytest.mark.parametrize("printed", [False, True])
@given(seed=st.integers(0, 1000))
def test_em_is_its_equations_with_the_jacobian_written_out(printed, seed):
    """Three iterations of (26)-(28), (38), (39) at one epoch of one component, where the floor does not bite."""
    prior, z = draw_problem(seed, m=1)
    adapter = (PrintedEm if printed else Em)(iterations=3, floor=1e-9)
    innovation = Linearised().innovate(prior, z)
    adapted = adapter.adapt(adapter.init(), prior, innovation)
    h, p, r, nu = z.jacobian, prior.cov, z.noise, innovation.residual
    for _ in range(3):
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
        x, posterior = prior.mean + gain @ nu, p - gain @ h @ p
        left = nu if printed else z.residual - h @ x
        p, r = posterior + np.outer(x - prior.mean, x - prior.mean), np.outer(left, left) + h @ posterior @ h.T
    got = condition(adapted.prior, Linearised().innovate(adapted.prior, z), adapted.noise)
    np.testing.assert_allclose(got.mean, x, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(got.cov, posterior, rtol=1e-6, atol=1e-6)
    assert adapted.state[innovation.labels[0]] * z.noise[0, 0] == pytest.approx(r[0, 0], rel=1e-6)


@given(st.integers(0, 10_000))
def test_expected_square_is_that_of_the_posterior(seed):
    prior, z = draw_problem(seed)
    posterior = condition(prior, Linearised().innovate(prior, z), z.noise)
    expected = (z.residual - z.jacobian @ posterior.mean) ** 2 + np.diag(z.jacobian @ posterior.cov @ z.jacobian.T)
    np.testing.assert_allclose(posterior_square(Linearised().innovate(prior, z), z.noise), expected, rtol=1e-6)


@given(st.integers(0, 10_000))
def test_inflated_innovation_is_that_of_the_inflated_prior(seed):
    prior, z = draw_problem(seed)
    wider, innovation = inflate(prior, Linearised().innovate(prior, z), np.arange(5.0))
    expected = Linearised().innovate(wider, z)
    np.testing.assert_allclose(innovation.cross, expected.cross, atol=1e-6)
    np.testing.assert_allclose(innovation.spread, expected.spread, atol=1e-6)


def draw_window(seed: int, count: int = 12) -> list[Innovation]:
    """Innovations of two to four components, whose set changes."""
    rng = np.random.default_rng(seed)
    window = []
    for _ in range(count):
        m = int(rng.integers(2, 5))
        root, noise_root = rng.normal(size=(m, m)), rng.normal(size=(m, m)) + 2 * np.eye(m)
        labels = tuple(np.array(LABELS[:4])[np.sort(rng.permutation(4)[:m])].tolist())
        window.append(Innovation(rng.normal(size=m) * 3, np.empty((0, m)), root @ root.T, noise_root @ noise_root.T, labels))
    return window


def test_misfit_is_the_likelihood_of_the_window():
    window = draw_window(1)
    log_ratio = np.array([0.3, -1.0, 2.0, 0.7])
    expected = 0.0
    for epoch in window:
        root = np.exp(log_ratio[[LABELS.index(label) for label in epoch.labels]] / 2)
        cov = epoch.spread + epoch.noise * np.outer(root, root)
        expected += np.linalg.slogdet(cov)[1] + epoch.residual @ np.linalg.solve(cov, epoch.residual)
    assert misfit(log_ratio, stack_innovations(window, LABELS[:4]))[0] == pytest.approx(expected / len(window))


@given(st.integers(0, 1000), st.lists(st.floats(-3, 3), min_size=4, max_size=4))
def test_gradient_equals_finite_differences(seed, log_ratio):
    stack = stack_innovations(draw_window(seed), LABELS[:4])
    x = np.array(log_ratio)
    step = 1e-5 * np.eye(4)
    numeric = [(misfit(x + h, stack)[0] - misfit(x - h, stack)[0]) / 2e-5 for h in step]
    np.testing.assert_allclose(misfit(x, stack)[1], numeric, rtol=1e-5, atol=1e-7)


def test_compiled_misfit_equals_its_source():
    stack = stack_innovations(draw_window(2), LABELS[:4])
    x, gradient, curvature = np.array([0.5, -0.5, 1.0, 0.0]), np.empty(4), np.empty(4)
    value = _likelihood_kernel.misfit.py_func(x, *stack, gradient, curvature)
    fast = misfit(x, stack)
    np.testing.assert_allclose(fast[0], value / 12)
    np.testing.assert_allclose(fast[1], gradient / 12)
    np.testing.assert_allclose(fast[2], curvature / 12)


def estimate_static(adapter: MaximumLikelihood, seed: int, actual: np.ndarray) -> np.ndarray:
    """Ratios (m,) that the adapter finds after its window, where spread and told R are known and nothing moves."""
    rng = np.random.default_rng(seed)
    told, spread = np.diag([25.0, 64.0]), np.diag([5.0, 2.0])
    state = adapter.init()
    prior = Gaussian(np.zeros(2), spread)
    noise = told
    for _ in range(adapter.window):
        residual = rng.normal(size=2) * np.sqrt(np.diag(spread) + actual)
        _, noise, state = adapter.adapt(state, prior, Innovation(residual, spread, spread, told, LABELS[:2]))
    return np.diag(noise)


def test_maximum_likelihood_recovers_noise_with_the_error_of_theory():
    actual = np.array([6.25, 256.0])
    window = 200
    adapter = MaximumLikelihood(window=window, least=window)
    found = np.array([estimate_static(adapter, seed, actual) for seed in range(40)])
    theory = (actual + [5.0, 2.0]) * np.sqrt(2 / window)
    assert (np.abs(found.mean(axis=0) - actual) < 3 * theory / np.sqrt(40)).all()
    # chi-square of 39 degrees of freedom: its root lies within 25 % of its mean
    np.testing.assert_allclose(found.std(axis=0, ddof=1) / theory, 1, atol=0.25)


def test_both_searches_agree():
    actual = np.array([6.25, 256.0])
    quadratic = estimate_static(MaximumLikelihood(window=40), 3, actual)
    genetic = estimate_static(GeneticLikelihood(window=40, generations=50), 3, actual)
    np.testing.assert_allclose(genetic, quadratic, rtol=0.02)


def test_maximum_likelihood_holds_the_told_noise_at_first_and_its_bounds_later():
    adapter = MaximumLikelihood(least=15, floor=0.04)
    state = adapter.init()
    nothing = Innovation(np.zeros(2), np.eye(2), np.eye(2), np.eye(2), LABELS[:2])
    for count in range(1, 20):
        _, noise, state = adapter.adapt(state, Gaussian(np.zeros(2), np.eye(2)), nothing)
        np.testing.assert_allclose(np.diag(noise), 1 if count < 15 else 0.04, rtol=1e-6)


NEUTRAL = {
    "iae-q": IaeQ(window=10_000),
    "iae": Iae(window=10_000),
    "sage-husa": SageHusa(forgetting=1 - 1e-12, told_epochs=10**13),
    "huber": Huber(threshold=1e9),
    "student-t": StudentT(dof=1e12),
    "correntropy": Correntropy(width=1e9),
    "vb": VariationalBayes(forgetting=1.0, told_epochs=10**13),
    "ml": MaximumLikelihood(least=10_000),
    "ml-ga": GeneticLikelihood(least=10_000),
    "em-kf": Em(memory=0.0),
    "strong-tracking": StrongTracking(softening=1e9),
    "h-infinity": HInfinity(gamma=1e9),
}


@pytest.mark.parametrize("name", NEUTRAL)
def test_without_gain_an_adapter_is_the_fixed_filter(name):
    adapter = NEUTRAL[name]
    state = adapter.init()
    for seed in range(20):
        prior, z = draw_problem(seed)
        innovation = Linearised().innovate(prior, z)
        adapted = adapter.adapt(state, prior, innovation)
        state = adapted.state
        expected = condition(prior, innovation, z.noise)
        got = condition(adapted.prior, Linearised().innovate(adapted.prior, z), adapted.noise)
        np.testing.assert_allclose(got.mean, expected.mean, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(got.cov, expected.cov, rtol=1e-7, atol=1e-7)


@given(st.integers(0, 1000))
def test_h_infinity_widens_the_inverse_of_what_is_seen_and_nothing_else(seed):
    prior, z = draw_problem(seed)
    adapted = HInfinity(gamma=3.0, margin=2.0).adapt(np.ones(5), prior, Linearised().innovate(prior, z))
    bound = max(9.0, 2 * np.linalg.eigvalsh(prior.cov)[-1])
    expected = np.linalg.inv(np.linalg.inv(prior.cov) - np.eye(5) / bound)
    h, found = z.jacobian, adapted.prior.cov
    scale = np.abs(expected).max()
    np.testing.assert_allclose(h @ found @ h.T, h @ expected @ h.T, rtol=1e-5, atol=1e-5 * scale * np.abs(h).max() ** 2)
    unseen = null_space((prior.cov @ h.T).T)
    np.testing.assert_allclose(unseen.T @ found @ unseen, unseen.T @ prior.cov @ unseen, rtol=1e-5, atol=1e-5 * scale)


def test_strong_tracking_factor_is_the_printed_one():
    """Of one component, where no normalisation matters."""
    adapter = StrongTracking(forgetting=0.5)
    prior = Gaussian(np.zeros(1), np.array([[2.0]]))
    residuals, state, square = (1.0, 6.0, -5.0), adapter.init(), None
    for residual in residuals:
        innovation = Innovation(np.array([residual]), prior.cov, prior.cov, np.array([[3.0]]), ("a",))
        adapted = adapter.adapt(state, prior, innovation)
        state = adapted.state
        square = residual**2 if square is None else (0.5 * square + residual**2) / 1.5
        assert adapted.prior.cov[0, 0] == pytest.approx(2.0 * max(1.0, (square - 3.0) / 2.0))


def test_strong_tracking_multiplies_what_the_measurement_sees():
    prior, z = draw_problem(1)
    innovation = Linearised().innovate(prior, z._replace(residual=z.residual + 100))
    adapter = StrongTracking()
    wider = Linearised().innovate(adapter.adapt(adapter.init(), prior, innovation).prior, z)
    factor = wider.spread[0, 0] / innovation.spread[0, 0]
    assert factor > 2
    np.testing.assert_allclose(wider.spread, factor * innovation.spread, rtol=1e-6)
    np.testing.assert_allclose(wider.cross, factor * innovation.cross, rtol=1e-6)


@pytest.mark.parametrize(("name", "least"), [("student-t", 20.0), ("correntropy", 40.0)])
def test_robust_adapters_enlarge_the_noise_of_an_outlier_only(name, least):
    adapter = build_method(name).adapter
    prior = Gaussian(np.zeros(2), np.eye(2))
    outlier = Innovation(np.array([0.3, 30.0]), np.eye(2), np.eye(2), np.eye(2), LABELS[:2])
    noise = np.diag(adapter.adapt(adapter.init(), prior, outlier).noise)
    assert noise[0] < 1.5
    assert noise[1] > least


def test_adapters_follow_a_changing_set_of_components():
    """Satellites come and go: whatever the set of an epoch, R has its shape and is positive definite."""
    for name in PRESETS:
        adapter = build_method(name).adapter
        state = adapter.init()
        for epoch in draw_window(5, 40):
            m = len(epoch.residual)
            full = epoch._replace(cross=np.vstack([np.eye(m), np.zeros((4 - m, m))]) / 9, t_ns=0)
            adapted = adapter.adapt(state, Gaussian(np.zeros(4), np.eye(4)), full)
            state = adapted.state
            assert adapted.noise.shape == (m, m)
            assert np.linalg.eigvalsh(adapted.noise).min() > 0
