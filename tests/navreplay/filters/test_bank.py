"""Banks of filters: weights, mixture, one mechanisation for all hypotheses, and the epoch loop with them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import synthetic_logs
from navreplay.error_models.ned import Propagated
from navreplay.evaluation.metrics import evaluate
from navreplay.filters import _bank_kernel
from navreplay.filters.bank import Stack, interact, mix, move_stack, update_stack
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.filters.weights import Imm, Immae, Mmae, MmaeFloor
from navreplay.moments.linearised import Linearised
from navreplay.options import FilterOptions
from navreplay.solution import Solution
from navreplay.timeline import LogError, Timeline
from navreplay.update.gaussian import Gaussian, chi_square, condition
from navreplay.update.measurement import Measurement
from pipelines.config.spec import validate
from pipelines.drive.process import Drive, filter_drive
from pipelines.recording.view import write_recording
from pipelines.report.content import build_report
from pipelines.report.figures import report_plots
from tests.navreplay.adapt.test_adapter_consistency import NOISE, OBSERVATION, PROCESS_NOISE, START, TRANSITION
from tests.pipelines.recording.test_view import read_entity

BANKS = ("mmae", "mmae-floor", "imm", "immae")
SECOND = 1_000_000_000


def drive(name: str, duration: float = 60.0) -> tuple[Timeline, FilterOptions]:
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS[name], duration)
    return synthetic_logs.simulate(scenario, 2).timeline(), FilterOptions(imu_noise=scenario.imu.noise, output_rate=2.0)


def assert_same(found: Solution, expected: Solution, tolerance: float) -> None:
    """States and covariances alike, in units of their standard deviations."""
    std = expected.std
    for name, block in (("vel_n", slice(3, 6)), ("gyro_bias", slice(9, 12)), ("accel_bias", slice(12, 15))):
        assert np.abs((getattr(found, name) - getattr(expected, name)) / std[:, block]).max() < tolerance
    assert np.abs((found.lla - expected.lla) * [6.4e6, 6.4e6, 1.0] / std[:, :3]).max() < tolerance
    assert np.abs((found.q_nb - expected.q_nb)[:, 1:] / std[:, 6:9]).max() < tolerance
    scale = std[:, :, None] * std[:, None, :]
    assert np.abs((found.cov - expected.cov) / scale).max() < tolerance


@pytest.mark.parametrize("name", BANKS)
@pytest.mark.parametrize("inner", ["fixed", "sage-husa", "strong-tracking"])
def test_a_bank_of_one_is_the_plain_filter_on_fixes(name, inner):
    timeline, options = drive("car-short")
    plain = run_filter(timeline, build_method(inner), options)
    alone = run_filter(timeline, build_method(name, {"q_scales": [1.0], "inner": inner}), options)
    assert_same(alone, plain, 1e-11)
    for one, other in zip(alone.innovations, plain.innovations, strict=True):
        np.testing.assert_allclose(one.std, other.std, rtol=1e-12)


@pytest.mark.parametrize("has_imu", [True, False])
def test_a_bank_of_one_is_the_plain_filter_on_ranges(has_imu):
    timeline, options = drive("ranges-open")
    timeline = timeline if has_imu else replace(timeline, imu=None)
    plain = run_filter(timeline, build_method("fixed"), options)
    alone = run_filter(timeline, build_method("mmae", {"q_scales": [1.0]}), options)
    scale = plain.std[:, :, None] * plain.std[:, None, :]
    assert np.abs((alone.cov - plain.cov) / scale).max() < 1e-10
    assert np.abs((alone.vel_n - plain.vel_n) / plain.std[:, 3:6]).max() < 1e-10


def test_the_mixture_of_two_models_is_that_worked_out_by_hand():
    """Means (1, 0) and (-1, 2), weights 1/4 and 3/4: mean (-1/2, 3/2), apart (3/2, -3/2) and (-1/2, 1/2), so that the means
    add 1/4 * 9/4 + 3/4 * 1/4 = 3/4 to each variance and -3/4 between."""
    stack = Stack(np.array([[1.0, 0.0], [-1.0, 2.0]]), np.array([[[4.0, 1.0], [1.0, 2.0]], [[8.0, 0.0], [0.0, 4.0]]]))
    mixed = mix(stack, np.array([0.25, 0.75]))
    np.testing.assert_allclose(mixed.mean, [-0.5, 1.5], rtol=1e-15)
    np.testing.assert_allclose(mixed.cov, [[7.0 + 0.75, 0.25 - 0.75], [0.25 - 0.75, 3.5 + 0.75]], rtol=1e-15)


@given(st.integers(0, 10_000), st.floats(0.01, 1000.0))
def test_interaction_keeps_the_moments_of_the_mixture(seed, seconds):
    rng = np.random.default_rng(seed)
    roots, weights = rng.normal(size=(3, 4, 4)), rng.dirichlet(np.ones(3))
    stack = Stack(rng.normal(size=(3, 4)), roots @ np.swapaxes(roots, 1, 2))
    moves = Imm(q_scales=(1.0, 2.0, 3.0), sojourn=20.0).transitions(seconds)
    np.testing.assert_allclose(moves.sum(axis=1), 1, rtol=1e-12)
    before, after = mix(stack, weights), mix(*interact(stack, weights, moves))
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-12)
    np.testing.assert_allclose(after.cov, before.cov, atol=1e-11)


def test_the_probability_to_stay_is_that_of_the_mean_sojourn():
    """Over a short time 1 - t / sojourn, the rest shared; two intervals are one of their sum; in the end all are even."""
    chain = Imm(q_scales=(1.0, 2.0, 3.0), sojourn=50.0)
    np.testing.assert_allclose(
        chain.transitions(0.05), [[0.999, 5e-4, 5e-4], [5e-4, 0.999, 5e-4], [5e-4, 5e-4, 0.999]], atol=2e-6
    )
    np.testing.assert_allclose(chain.transitions(3.0) @ chain.transitions(4.0), chain.transitions(7.0), rtol=1e-12)
    np.testing.assert_allclose(chain.transitions(1e5), 1 / 3, rtol=1e-12)


def test_imm_that_never_switches_is_mmae():
    timeline, options = drive("car-short", 40.0)
    plain = run_filter(timeline, build_method("mmae"), options)
    assert_same(run_filter(timeline, build_method("imm", {"sojourn": 1e15}), options), plain, 1e-6)


@given(st.integers(0, 10_000))
def test_every_hypothesis_is_updated_as_a_filter_of_its_own(seed):
    rng = np.random.default_rng(seed)
    roots, noise_roots = rng.normal(size=(3, 4, 4)), rng.normal(size=(3, 2, 2))
    stack = Stack(rng.normal(size=(3, 4)), roots @ np.swapaxes(roots, 1, 2) + np.eye(4))
    noises = noise_roots @ np.swapaxes(noise_roots, 1, 2) + np.eye(2)
    residual, jacobian = rng.normal(size=2), rng.normal(size=(2, 4))
    updated = update_stack(stack, residual, jacobian, noises, 4)
    squares = []
    for j, (mean, cov) in enumerate(zip(*stack, strict=True)):
        innovation = Linearised().innovate(Gaussian(mean, cov), z_of(residual, jacobian, noises[j]))
        expected = condition(Gaussian(mean, cov), innovation, noises[j])
        np.testing.assert_allclose(updated.stack.means[j], expected.mean, atol=1e-12)
        np.testing.assert_allclose(updated.stack.covs[j], expected.cov, atol=1e-12)
        spread = innovation.spread + noises[j]
        squares.append(chi_square(innovation.residual, spread) + np.log(np.linalg.det(spread)))
    np.testing.assert_allclose(updated.log_likelihood, -np.array(squares) / 2, rtol=1e-10)


def z_of(residual: np.ndarray, jacobian: np.ndarray, noise: np.ndarray) -> Measurement:
    return Measurement(residual, jacobian, noise, ("position",) * 2, ("north", "east"))


@pytest.mark.parametrize("epochs", [10_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("weighting", [Mmae(), MmaeFloor(), Immae()])
def test_weights_sum_to_one_and_come_through_a_million_epochs(weighting, epochs):
    """Four hypotheses lose 20 nats and more per epoch: in plain figures their weights would be gone within forty."""
    weights = weighting.start(0)
    loss = np.array([0.0, -20.0, -20.5, -30.0, -40.0])
    for epoch in range(1, epochs + 1):
        weights = weighting.weigh(weights, epoch * 50_000_000, loss)
    values = weights.values
    assert values.sum() == pytest.approx(1, abs=1e-12)
    assert np.isfinite(weights.logs).all()
    assert values.argmax() == 0
    if isinstance(weighting, MmaeFloor):
        assert values.min() == pytest.approx(1e-3, rel=0.01)


def test_equal_models_keep_equal_weights():
    timeline, options = drive("car-short")
    for name in BANKS:
        found = run_filter(timeline, build_method(name, {"q_scales": [1, 1, 1]}), options)
        assert np.abs(found.weights.values - 1 / 3).max() < 1e-9
        assert_same(found, run_filter(timeline, build_method("fixed"), options), 1e-9)


def test_immae_starts_anew_where_the_last_interval_contradicts_the_history():
    """A hundred seconds for the first hypothesis, then measurements for the second: mmae has a hundred seconds to unlearn,
    immae notices at the end of the interval."""
    histories = {}
    for weighting in (Mmae((1.0, 10.0)), Immae((1.0, 10.0), interval=10.0, threshold=0.9)):
        weights, leaders, restarts = weighting.start(0), [], []
        for second in range(1, 151):
            weights = weighting.weigh(weights, second * SECOND, np.array([0.0, -1.0 if second <= 100 else 1.0]))
            leaders.append(int(weights.logs.argmax()))
            restarts += [second] if weights.restarted else []
        histories[type(weighting)] = leaders, restarts
    assert histories[Mmae] == ([0] * 150, [])
    leaders, restarts = histories[Immae]
    assert restarts == [110]
    assert leaders[110:] == [1] * 40


def over_an_epoch() -> Propagated:
    """The tracker's transition and noise; its states and covariances do not matter."""
    empty = np.zeros((1, 6, 6))
    return Propagated(np.zeros((1, 6)), empty, empty, TRANSITION[None], PROCESS_NOISE[None])


def test_hypotheses_move_by_the_transition_with_their_own_noise_and_so_does_the_mixture():
    rng = np.random.default_rng(0)
    roots, transitions, noise_roots = rng.normal(size=(3, 4, 4)), rng.normal(size=(2, 4, 4)), rng.normal(size=(2, 4, 4))
    stack = Stack(rng.normal(size=(3, 4)), roots @ np.swapaxes(roots, 1, 2))
    noises, scales, weights = (
        noise_roots @ np.swapaxes(noise_roots, 1, 2),
        np.array([0.5, 2.0, 30.0]),
        np.array([0.2, 0.5, 0.3]),
    )
    stack = stack._replace(means=stack.means - weights @ stack.means)
    told, cov = [], mix(stack, weights).cov
    for step, noise in zip(transitions, noises, strict=True):
        cov = step @ cov @ step.T + noise
        told.append(cov)
    moved = Propagated(np.zeros((2, 4)), np.array(told), np.zeros((2, 4, 0)), transitions, noises)
    found = move_stack(stack, moved, scales, weights)
    total = transitions[1] @ transitions[0]
    for j, scale in enumerate(scales):
        np.testing.assert_allclose(found.means[j], total @ stack.means[j], rtol=1e-12)
        first = transitions[0] @ stack.covs[j] @ transitions[0].T + scale * noises[0]
        np.testing.assert_allclose(found.covs[j], transitions[1] @ first @ transitions[1].T + scale * noises[1], rtol=1e-11)
    np.testing.assert_allclose(moved.covariances[1], mix(found, weights).cov, rtol=1e-11, atol=1e-11)


def track(weighting: Mmae, seed: int, epochs: int, true_scale: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """NEES per state and NIS per component by epoch, and final weights, of a tracker of position and velocity in three axes
    whose process noise is true_scale times what the bank is told."""
    rng = np.random.default_rng(seed)
    roots = [np.linalg.cholesky(cov) for cov in (START, PROCESS_NOISE * true_scale, NOISE)]
    true = roots[0] @ rng.normal(size=6)
    q_scales, r_scales = np.array(weighting.hypotheses()).T
    size = len(q_scales)
    nominal, stack, weights = np.zeros(6), Stack(np.zeros((size, 6)), np.tile(START, (size, 1, 1))), weighting.start(0)
    nees, nis = [], []
    for epoch in range(1, epochs + 1):
        true = TRANSITION @ true + roots[1] @ rng.normal(size=6)
        nominal, stack = TRANSITION @ nominal, move_stack(stack, over_an_epoch(), q_scales, weights.values)
        residual = OBSERVATION @ (true - nominal) + roots[2] @ rng.normal(size=6)
        prior, noise = mix(stack, weights.values), NOISE * (weights.values @ r_scales)
        nis.append(chi_square(residual, OBSERVATION @ prior.cov @ OBSERVATION.T + noise) / 6)
        stack, log_likelihood = update_stack(stack, residual, OBSERVATION, NOISE * r_scales[:, None, None], 6)
        weights = weighting.weigh(weights, epoch * SECOND, log_likelihood)
        now = mix(stack, weights.values)
        nominal, stack = nominal + now.mean, stack._replace(means=stack.means - now.mean)
        nees.append(chi_square(true - nominal, now.cov) / 6)
    return np.array(nees), np.array(nis), weights.values


@pytest.mark.parametrize(
    ("weighting", "low", "high"),
    [(Mmae(), 0.95, 1.05), (MmaeFloor((1.0, 10.0)), 0.95, 1.05), (MmaeFloor(), 0.5, 0.65), (Immae(), 0.95, 1.05)],
)
def test_with_the_right_noise_nees_and_nis_stay_in_the_band(weighting, low, high):
    """The band that navreplay.filters.weights declares, low to high of the NIS."""
    nees, nis, _ = (np.mean(column) for column in zip(*(track(weighting, seed, 200) for seed in range(12)), strict=True))
    assert 0.9 < nees < 1.1
    assert low < nis < high


@pytest.mark.parametrize("name", BANKS)
@pytest.mark.parametrize("true_scale", [1.0, 100.0])
def test_the_bank_finds_the_scale_of_the_process_noise(name, true_scale):
    weighting = build_method(name).weighting
    for seed in range(4):
        _, _, values = track(weighting, seed, 300, true_scale)
        assert weighting.q_scales[values.argmax()] == true_scale
        assert values.max() > 0.9


def test_the_bank_finds_the_scale_of_the_measurement_noise():
    timeline, options = drive("car-short", 120.0)
    told = replace(options, noise_scale=0.25)
    bank = build_method("mmae", {"q_scales": [1], "r_scales": [1, 4, 16, 64]})
    values = run_filter(timeline, bank, told).weights.values
    assert values[-1].argmax() == 2
    assert values[-1, 2] > 0.99


@pytest.mark.parametrize("name", BANKS)
def test_runs_repeat_and_covariances_are_positive_definite(name):
    for scenario in ("car-short", "ranges-open"):
        timeline, options = drive(scenario)
        one, other = (run_filter(timeline, build_method(name), options) for _ in range(2))
        np.testing.assert_array_equal(one.lla, other.lla)
        np.testing.assert_array_equal(one.weights.values, other.weights.values)
        np.testing.assert_allclose(one.weights.values.sum(axis=1), 1, atol=1e-12)
        scale = one.std[:, :, None] * one.std[:, None, :]
        assert np.abs((one.cov - np.swapaxes(one.cov, 1, 2)) / scale).max() < 1e-13
        assert np.linalg.eigvalsh(one.cov / scale).min() > 0


def test_smoothing_improves_a_bank():
    timeline, options = drive("car-short", 120.0)
    bank = build_method("immae")
    forward, smoothed = (
        evaluate(run_filter(timeline, bank, replace(options, smooth=smooth)), timeline.reference) for smooth in (False, True)
    )
    for quantity in ("position", "velocity"):
        before, after = (np.sqrt((e.errors[quantity].error ** 2).mean()) for e in (forward, smoothed))
        assert after < before
        assert np.nanmean(smoothed.errors[quantity].nees) / 3 < 2


def test_a_switch_is_told():
    timeline, options = drive("car-short")
    events = [event.text for event in run_filter(timeline, build_method("mmae"), options).events]
    assert sum("the bank follows Q × 1," in text for text in events) == 1


def test_compiled_kernels_are_their_python_selves():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(2, 4, 4))
    means, covs, noises = rng.normal(size=(2, 4)), roots @ np.swapaxes(roots, 1, 2), np.tile(np.eye(2), (2, 1, 1))
    steps, jacobian, residual = rng.normal(size=(3, 4, 4)), rng.normal(size=(2, 4)), rng.normal(size=2)
    outcomes = []
    for carry, update in ((_bank_kernel.carry, _bank_kernel.update), (_bank_kernel.carry.py_func, _bank_kernel.update.py_func)):
        m, p, mixture, likelihood = means.copy(), covs.copy(), np.zeros((3, 4, 4)), np.empty(2)
        carry(steps, np.tile(np.eye(4), (3, 1, 1)), np.array([1.0, 5.0]), 0.7, mixture, m, p)
        assert update(residual, jacobian, noises, 3, m, p, likelihood)
        assert not update(residual, jacobian, -1e3 * noises, 3, m.copy(), p.copy(), np.empty(2))
        outcomes.append((m, p, mixture, likelihood))
    for compiled, plain in zip(*outcomes, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"inner": "immae"}, "'inner' cannot be 'immae'"),
        ({"inner": "psteckf"}, "'inner' cannot be 'psteckf'"),
        ({"inner": "fixd"}, "did you mean 'fixed'"),
        ({"inner": 3}, "must be a name in quotes, got 3"),
        ({"q_scales": 3.0}, "must be a list of numbers"),
        ({"q_scales": []}, "must be a list of numbers"),
        ({"q_scales": [1, -2]}, "'q_scales' must be positive, got -2"),
        ({"q_scales": [1, "2"]}, "'q_scales' must be a number, got '2'"),
        ({"floor": 0.1}, "there is no parameter 'floor'"),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(parameters, message):
    with pytest.raises(LogError, match=message):
        build_method("mmae", parameters)


def test_weights_are_in_report_and_recording(tmp_path):
    timeline, _ = drive("car-short")
    config = validate({"filter": {"name": "immae"}, "imu": {"grade": "industrial"}}, "test")
    result = filter_drive(Drive(timeline, ()), config)
    weights = build_report(result)["weights"]
    assert list(weights) == ["Q × 1", "Q × 10", "Q × 100", "Q × 1000", "Q × 10000"]
    assert sum(hypothesis["last"] for hypothesis in weights.values()) == pytest.approx(1, abs=1e-8)
    assert sum(hypothesis["leads"] for hypothesis in weights.values()) == pytest.approx(1, abs=1e-8)
    assert [plot.title for plot in report_plots(result)].count("Weights of the hypotheses") == 1
    write_recording(tmp_path / "recording.rrd", result)
    recorded = read_entity(tmp_path / "recording.rrd", "/weights/bank/hypothesis_1")["Scalars:scalars"].combine_chunks()
    np.testing.assert_allclose(recorded.flatten().to_numpy(), result.solution.weights.values[:, 0])
