"""Consider parameters: against the printed equations, their limits, coverage of biases, and runs of every kind."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import synthetic_logs
from navreplay.adapt.inflation.partial_tracking import PartialTracking
from navreplay.error_models.considered import ConsideredModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.bank import Stack, update_stack
from navreplay.filters.consider import Schmidt
from navreplay.filters.presets import PRESETS, Preset, build_method
from navreplay.filters.run import run_filter
from navreplay.mechanisation.strapdown import Leg, NavState, make_steps
from navreplay.moments.linearised import Linearised
from navreplay.options import ConsiderOptions, FilterOptions, GateOptions
from navreplay.solution import Solution
from navreplay.timeline import LogError, Timeline
from navreplay.update.gaussian import Gaussian, chi_square, condition, kalman_gain
from navreplay.update.measurement import Measurement
from pipelines.config.spec import filter_options, validate

FLIGHT = synthetic_logs.SCENARIOS["uav-flight"]
OPEN_SKY = synthetic_logs.SCENARIOS["ranges-open"]
ALL_BIASES = ConsiderOptions((1.0, 1.0, 2.0), (0.1, 0.1, 0.2), 0.5, (0.01, 0.01, 0.01), (1e-3, 1e-3, 1e-3))
NOTHING = ConsiderOptions(position_bias=(0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def log() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(synthetic_logs.with_duration(FLIGHT, 45.0), 4)


@pytest.fixture(scope="module")
def ranges() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(synthetic_logs.with_duration(OPEN_SKY, 60.0), 4)


def options(**changes) -> FilterOptions:
    return replace(FilterOptions(imu_noise=FLIGHT.imu.noise, output_rate=1.0), **changes)


def assert_equal(one: Solution, other: Solution, tolerance: float, states: int = 15) -> None:
    for name in ("lla", "vel_n", "q_nb", "gyro_bias", "accel_bias"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=tolerance, atol=tolerance * 1e-3)
    std = other.std[:, :states]
    scale = std[:, :, None] * std[:, None, :]
    difference = (one.cov[:, :states, :states] - other.cov[:, :states, :states]) / scale
    np.testing.assert_allclose(difference, 0, atol=tolerance)


def draw_problem(seed: int, n: int = 7, p: int = 3, m: int = 4) -> tuple[Gaussian, Measurement]:
    rng = np.random.default_rng(seed)
    root, noise_root = rng.normal(size=(n + p, n + p)), rng.normal(size=(m, m)) + 2 * np.eye(m)
    noise = noise_root @ noise_root.T
    measurement = Measurement(rng.normal(size=m), rng.normal(size=(m, n + p)), noise, ("position",) * m, tuple("abcd"))
    return Gaussian(np.zeros(n + p), root @ root.T), measurement


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_the_update_is_that_of_the_printed_equations(seed, factor):
    """Lou et al., eqs. (57)-(60), also with a factor on P alone."""
    n = 7
    prior, z = draw_problem(seed)
    prior.cov[:n, :n] *= factor
    p, c, pp = prior.cov[:n, :n], prior.cov[:n, n:], prior.cov[n:, n:]
    h, influence = z.jacobian[:, :n], z.jacobian[:, n:]
    spread = h @ p @ h.T + influence @ c.T @ h.T + h @ c @ influence.T + influence @ pp @ influence.T + z.noise
    gain = np.linalg.solve(spread, (p @ h.T + c @ influence.T).T).T
    rule = Schmidt(Linearised(), n, np.diagonal(pp))
    after = rule.condition(prior, rule.innovate(prior, z), z.noise)
    tolerance = 1e-14 * np.abs(prior.cov).max() * np.linalg.cond(spread)
    np.testing.assert_allclose(after.mean[:n], gain @ z.residual, atol=1e-12)
    np.testing.assert_allclose(after.cov[:n, :n], (np.eye(n) - gain @ h) @ p - gain @ influence @ c.T, atol=tolerance)
    np.testing.assert_allclose(after.cov[:n, n:], (np.eye(n) - gain @ h) @ c - gain @ influence @ pp, atol=tolerance)
    np.testing.assert_array_equal(after.mean[n:], 0)
    np.testing.assert_array_equal(after.cov[n:, n:], pp)


def test_biases_get_their_told_variance_back_after_an_inflation():
    prior, z = draw_problem(1)
    rule = Schmidt(Linearised(), 7, np.diagonal(prior.cov)[7:])
    wide = Gaussian(prior.mean, prior.cov * 4)
    after = rule.condition(wide, rule.innovate(wide, z), z.noise).cov
    np.testing.assert_allclose(after[7:, 7:], prior.cov[7:, 7:])
    assert np.linalg.eigvalsh(after).min() > 0


def propagate(considered: ConsiderOptions, cov: np.ndarray | None = None):
    """Over ten nodes of a flight; the model, the covariance before (given behind the biases' own) and what came of it."""
    log = synthetic_logs.simulate(synthetic_logs.with_duration(FLIGHT, 5.0), 1)
    steps = make_steps(log.imu, np.empty(0, dtype=np.int64))
    model = ConsideredModel.of(NedErrorModel(FLIGHT.imu.noise), considered)
    start = np.diag(np.append(np.full(15, 1e-6), np.diagonal(model.bias_cov))) if cov is None else cov
    state = NavState.at(log.truth.lla[0], np.array([30.0, 20.0, -3.0]), log.truth.q_nb[0])
    ends = np.arange(50, 501, 50)
    return model, start, model.propagate(state, start, Leg(steps, 0, ends, 0.05, keep=True))


def test_propagation_is_that_of_states_and_biases_together():
    """Eq. (21), node by node, with the transpose that the third term of the printed table lacks; P_pp stays."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(28, 28)) * 0.01
    model, cov, moved = propagate(ALL_BIASES, root @ root.T)
    assert model.size == 28
    for node, (phi, noise) in enumerate(zip(moved.transitions, moved.noises, strict=True)):
        cov = phi @ cov @ phi.T + noise
        np.testing.assert_allclose(moved.covariances[node], cov, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(moved.covariances[node], moved.covariances[node].T, rtol=1e-12)
        np.testing.assert_array_equal(moved.covariances[node][15:, 15:], (root @ root.T)[15:, 15:])


def test_biases_of_the_dynamics_move_velocity_and_position():
    considered = replace(NOTHING, position_rate=(0.1, 0.0, 0.0), velocity_rate=(0.0, 0.02, 0.0))
    model, _, moved = propagate(considered)
    assert model.names[15:] == ("position_rate_n", "velocity_rate_e")
    assert model.units[15:] == ("m/s", "m/s^2")
    cross = moved.covariances[-1][:15, 15:] / np.diagonal(model.bias_cov)
    np.testing.assert_allclose(cross[0, 0], 5.0, rtol=1e-5)
    np.testing.assert_allclose(cross[[1, 4], 1], [12.5, 5.0], rtol=1e-3)


def test_biases_of_ranges_lie_along_the_line_of_sight():
    model = ConsideredModel.of(NedErrorModel(FLIGHT.imu.noise), ALL_BIASES)
    sight = np.array([[0.6, 0.0, -0.8], [0.0, 0.8, -0.6]])
    jacobian = np.zeros((4, 20))
    jacobian[:2, :3] = jacobian[2:, 3:6] = -sight
    z = Measurement(np.zeros(4), jacobian, np.eye(4), ("range", "range", "range_rate", "range_rate"), ("G01", "G02") * 2)
    influence = model.influence(z)
    np.testing.assert_array_equal(influence[:2, 6:9], -sight)
    np.testing.assert_array_equal(influence[2:, 9:12], -sight)
    np.testing.assert_allclose(influence[:, 12], [1 / 0.8, 1 / 0.6, 0, 0])
    assert np.abs(influence[:, :6]).max() == np.abs(influence[2:, 6:9]).max() == np.abs(influence[:2, 9:12]).max() == 0


@pytest.mark.parametrize("considered", [NOTHING, replace(NOTHING, position_bias=(1e-100,) * 3, velocity_rate=(1e-100,) * 3)])
def test_without_bias_covariance_eckf_is_ekf(log, considered):
    plain, schmidt = (run_filter(log.timeline(), build_method(n), options(consider=considered)) for n in ("ekf", "eckf"))
    assert_equal(schmidt, plain, 1e-12)


def test_biases_leave_the_cubature_rule_as_it_is(log):
    biases = replace(NOTHING, position_bias=(1e-100,) * 3, every_method=True)
    plain, schmidt = (run_filter(log.timeline(), build_method("ckf"), options(consider=c)) for c in (NOTHING, biases))
    assert_equal(schmidt, plain, 1e-9)
    assert np.abs(plain.vel_n - run_filter(log.timeline(), build_method("ekf"), options()).vel_n).max() > 1e-6


def test_ekf_is_fixed_and_ignores_biases(log):
    ekf, fixed = (run_filter(log.timeline(), build_method(name), options(consider=ALL_BIASES)) for name in ("ekf", "fixed"))
    np.testing.assert_array_equal(ekf.cov, fixed.cov)
    np.testing.assert_array_equal(ekf.lla, fixed.lla)


def test_with_a_factor_of_one_psteckf_is_eckf(log, monkeypatch):
    chosen = options(consider=ALL_BIASES)
    eckf, psteckf = (run_filter(log.timeline(), build_method(name), chosen) for name in ("eckf", "psteckf"))
    assert np.abs(psteckf.cov - eckf.cov).max() > 0.1
    monkeypatch.setattr(PartialTracking, "_factor", lambda *_: (1.0, {}))
    assert_equal(run_filter(log.timeline(), build_method("psteckf"), chosen), eckf, 1e-12, 27)


@pytest.mark.parametrize("seed", range(5))
def test_the_factor_is_that_of_the_printed_equations(seed):
    """Lou et al., eqs. (44)-(48) and (52), of components that are normalised by their S."""
    n = 7
    prior, z = draw_problem(seed)
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n)) * 0.1
    process = root @ root.T
    p, c, pp = prior.cov[:n, :n], prior.cov[:n, n:], prior.cov[n:, n:]
    h, influence = z.jacobian[:, :n], z.jacobian[:, n:]
    tracking, state, faded = PartialTracking(ceiling=1e6), PartialTracking().init(), None
    for _ in range(3):
        residual = rng.normal(size=4) * 40
        told = h @ p @ h.T + influence @ c.T @ h.T + h @ c @ influence.T + influence @ pp @ influence.T + z.noise
        scale = np.diag(1 / np.diagonal(told))
        square = np.outer(residual, residual)
        faded = square if faded is None else (0.95 * faded + square) / 1.95
        others = influence @ c.T @ h.T + h @ c @ influence.T + h @ process @ h.T + influence @ pp @ influence.T + z.noise
        factor = np.trace(scale @ (faded - others)) / np.trace(scale @ h @ (p - process) @ h.T)
        assert factor > 1
        inflated, state = tracking.inflate(state, prior.cov, process, z._replace(residual=residual))
        np.testing.assert_allclose(inflated[:n, :n], factor * (p - process) + process, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(inflated[:n, n:], c)
        np.testing.assert_array_equal(inflated[n:, n:], pp)
    calm, _ = tracking.inflate(tracking.init(), prior.cov, process, z._replace(residual=np.zeros(4)))
    np.testing.assert_array_equal(calm, prior.cov)


def test_the_ceiling_holds_each_state_and_leaves_the_whole_positive():
    prior, z = draw_problem(3)
    tracking, state = PartialTracking(ceiling=1.5), PartialTracking().init()
    first = np.diagonal(prior.cov)[:7].copy()
    cov = prior.cov
    for _ in range(20):
        cov, state = tracking.inflate(state, cov, np.zeros((7, 7)), z._replace(residual=np.full(4, 1e3)))
        np.testing.assert_allclose(np.diagonal(cov)[6], 1.5**2 * first[6])
        scale = np.sqrt(np.diagonal(cov))
        assert np.linalg.eigvalsh(cov / scale / scale[:, None]).min() > -1e-12
    assert (np.diagonal(cov)[:6] > 1e3 * first[:6]).all()


def track(rule: Schmidt, tracking: PartialTracking | None, seed: int, epochs: int) -> tuple[float, float]:
    """Mean NEES per state and NIS per component of a tracker in three axes of position and velocity, with biased positions."""
    axes = np.eye(3)
    phi, process = np.kron(axes, [[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.kron(axes, [[1 / 3, 1 / 2], [1 / 2, 1.0]])
    h = np.hstack([np.vstack([np.kron(axes, [[1.0, 0.0]]), np.kron(axes, [[0.0, 1.0]])]), np.vstack([axes, 0 * axes])])
    noise, start = np.diag([2.25] * 3 + [0.01] * 3), np.kron(axes, np.diag([4.0, 1.0]))
    full_phi, full_process = np.eye(9), np.zeros((9, 9))
    full_phi[:6, :6], full_process[:6, :6] = phi, process
    rng = np.random.default_rng(seed)
    true = np.append(np.linalg.cholesky(start) @ rng.normal(size=6), np.sqrt(rule.told) * rng.normal(size=3))
    now, state = Gaussian(np.zeros(9), np.diag(np.append(np.diagonal(start), rule.told))), PartialTracking().init()
    nees, nis = [], []
    for _ in range(epochs):
        true = full_phi @ true + np.append(np.linalg.cholesky(process) @ rng.normal(size=6), np.zeros(3))
        observed = h @ true + np.sqrt(np.diagonal(noise)) * rng.normal(size=6)
        mean, cov = full_phi @ now.mean, full_phi @ now.cov @ full_phi.T + full_process
        z = Measurement(observed - h @ mean, h, noise, ("position",) * 3 + ("velocity",) * 3, ("n", "e", "d") * 2)
        if tracking is not None:
            cov, state = tracking.inflate(state, cov, process, z)
        prior = Gaussian(np.zeros(9), cov)
        innovation = rule.innovate(prior, z)
        nis.append(chi_square(innovation.residual, innovation.spread + noise) / 6)
        after = rule.condition(prior, innovation, noise)
        now = Gaussian(mean + after.mean, after.cov)
        nees.append(chi_square((true - now.mean)[:6], now.cov[:6, :6]) / 6)
    return float(np.mean(nees)), float(np.mean(nis))


@pytest.mark.parametrize(
    ("tracking", "nees_band", "nis_band"),
    [(None, (0.85, 1.15), (0.9, 1.1)), (PartialTracking(), (0.75, 1.1), (0.75, 0.95))],
)
def test_with_the_right_noise_nees_and_nis_stay_in_the_band(tracking, nees_band, nis_band):
    rule = Schmidt(Linearised(), 6, np.full(3, 4.0))
    nees, nis = np.array([track(rule, tracking, seed, 150) for seed in range(40)]).mean(axis=0)
    assert nees_band[0] < nees < nees_band[1], nees
    assert nis_band[0] < nis < nis_band[1], nis


def biased(seed: int) -> tuple[Timeline, synthetic_logs.SyntheticLog]:
    """A flight whose fixes are off by a constant, drawn with 3 m per axis."""
    log = synthetic_logs.simulate(synthetic_logs.with_duration(FLIGHT, 40.0), seed)
    timeline = log.timeline()
    bias = np.random.default_rng(seed).normal(0, 3.0, 3)
    metres = np.array([6.37e6, 6.38e6 * np.cos(log.fixes.lla[0, 0]), -1.0])
    return replace(timeline, fixes=replace(log.fixes, lla=log.fixes.lla + bias / metres)), log


def test_a_bias_that_is_considered_is_covered_and_one_that_is_not_is_not():
    chosen = options(consider=ConsiderOptions(position_bias=(3.0, 3.0, 3.0)), gate=GateOptions(probability=1.0))
    nees: dict[str, list[float]] = {"ekf": [], "eckf": []}
    for seed in range(12):
        timeline, log = biased(seed)
        for name, found in nees.items():
            solution = run_filter(timeline, build_method(name), chosen)
            found.append(float(evaluate(solution, log.truth).errors["position"].nees[-1]))
    assert np.mean(nees["eckf"]) == pytest.approx(3, abs=1.5)
    assert np.mean(nees["ekf"]) > 3 * np.mean(nees["eckf"])


SINGLE = [n for n, p in PRESETS.items() if isinstance(p, Preset) and p.calibration is None and not n.endswith("-ga")]
"""Presets that biases go with; the adapter of those by genetic algorithm is tested by its quick sibling."""


@pytest.mark.parametrize("name", SINGLE)
def test_every_adapter_runs_with_biases(log, name):
    chosen = options(consider=replace(ALL_BIASES, zenith_delay=0.0, every_method=True))
    solution = run_filter(log.timeline(), build_method(name), chosen)
    scale = solution.std
    assert np.linalg.eigvalsh(solution.cov / (scale[:, :, None] * scale[:, None, :])).min() > 0
    np.testing.assert_allclose(scale[:, 15:], np.tile(scale[0, 15:], (len(solution), 1)), rtol=1e-9)


@pytest.mark.parametrize("name", ["eckf", "psteckf"])
def test_tightly_coupled_with_and_without_imu(ranges, name):
    chosen = options(imu_noise=OPEN_SKY.imu.noise, consider=replace(ALL_BIASES, velocity_rate=(0.0, 0.0, 0.0)))
    for timeline in (ranges.timeline(), replace(ranges.timeline(), imu=None)):
        solution = run_filter(timeline, build_method(name), chosen)
        position = evaluate(solution, ranges.truth).errors["position"]
        assert np.abs(position.error[-20:]).max() < 8
        assert solution.state_names[-1] == "zenith_delay"
        assert (solution.std[-1, :2] > 0.9).all()


def test_smoothed_errors_are_as_large_as_told_where_biases_are_considered() -> None:
    """Biases of 2, 2 and 4 m that stay: no smoother takes them away, and its covariance says so."""
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS["uav-biased-fixes"], 120.0)
    gnss = replace(scenario.gnss, position_bias_std=(2.0, 2.0, 4.0), velocity_bias_std=(0.0, 0.0, 0.0))
    biases = replace(NOTHING, position_bias=(2.0, 2.0, 4.0))
    nees, std = [], []
    for seed in range(1, 13):
        drawn = synthetic_logs.simulate(replace(scenario, gnss=gnss), seed)
        chosen = FilterOptions(imu_noise=drawn.scenario.imu.noise, output_rate=1.0, smooth=True, consider=biases)
        solution = run_filter(drawn.timeline(), build_method("eckf"), chosen)
        nees.append(evaluate(solution, drawn.truth).nees["position"].mean)
        std.append(solution.std[:, 2].min())
    # three biases a seed: the sum over the seeds is chi-square of 36, and what is white comes on top
    assert 36 * 0.4 < np.sum(nees) < 36 * 1.8
    assert min(std) > 3.9


def test_a_considered_bias_of_nothing_smooths_like_none(log) -> None:
    biases = replace(NOTHING, position_bias=(1e-6,) * 3, every_method=True)
    with_biases, without = (
        run_filter(log.timeline(), build_method("fixed"), options(smooth=True, consider=chosen))
        for chosen in (biases, replace(NOTHING, every_method=False))
    )
    n = without.cov.shape[1]
    np.testing.assert_allclose(with_biases.lla, without.lla, rtol=0, atol=1e-13)
    scale = without.std[:, :, None] * without.std[:, None, :]
    np.testing.assert_allclose(with_biases.cov[:, :n, :n] / scale, without.cov / scale, atol=1e-6)


@pytest.mark.parametrize("inner", ["fixed", "student-t"])
def test_a_bank_of_one_considers_as_the_single_filter_does(log, ranges, inner):
    for one, biases in ((log, replace(ALL_BIASES, zenith_delay=0.0)), (ranges, ALL_BIASES)):
        chosen = options(consider=replace(biases, every_method=True))
        plain = run_filter(one.timeline(), build_method(inner), chosen)
        bank = run_filter(one.timeline(), build_method("mmae", {"q_scales": [1.0], "inner": inner}), chosen)
        assert_equal(bank, plain, 1e-4, len(plain.state_names))


@given(st.integers(0, 10_000))
def test_every_hypothesis_is_updated_as_a_schmidt_filter_of_its_own(seed):
    prior, z = draw_problem(seed)
    rule = Schmidt(Linearised(), 7, np.diagonal(prior.cov)[7:])
    expected = rule.condition(prior, rule.innovate(prior, z), z.noise)
    updated = update_stack(Stack(prior.mean[None], prior.cov[None]), z.residual, z.jacobian, z.noise[None], 7)
    np.testing.assert_allclose(updated.stack.means[0], expected.mean, atol=1e-9)
    np.testing.assert_allclose(updated.stack.covs[0], expected.cov, atol=1e-9)


@pytest.mark.parametrize("name", ["em-offline", "auto"])
def test_a_method_that_calibrates_finds_the_noise_without_biases_and_reckons_with_them_after(log, name):
    without = run_filter(log.timeline(), build_method(name), options())
    biases = replace(NOTHING, position_bias=(2.0, 2.0, 3.0), every_method=True)
    solution = run_filter(log.timeline(), build_method(name), options(consider=biases))
    assert solution.estimated == without.estimated
    assert (solution.std[-1, :3] > [1.9, 1.9, 2.9]).all()


def test_the_configuration_names_biases_with_units():
    section = {
        "position_bias_std_m": [1.5, 1.5, 3.0],
        "velocity_bias_std_mps": [0.1, 0.1, 0.2],
        "zenith_delay_std_m": 0.4,
        "position_rate_std_mps": [0.01, 0.01, 0.02],
        "velocity_rate_std_mps2": [1e-3, 1e-3, 2e-3],
        "every_method": True,
    }
    told = filter_options(validate({"consider": section}, "drive.toml")).consider
    expected = ((1.5, 1.5, 3.0), (0.1, 0.1, 0.2), 0.4, (0.01, 0.01, 0.02), (1e-3, 1e-3, 2e-3), True)
    assert told == ConsiderOptions(*expected)
    with pytest.raises(LogError, match=r"consider.zenith_delay_std_m: expected greater than or equal to 0"):
        validate({"consider": {"zenith_delay_std_m": -1}}, "drive.toml")


def test_any_gain_with_zero_rows_conditions_as_the_joseph_form():
    prior, z = draw_problem(4)
    innovation = Linearised().innovate(prior, z)
    gain = kalman_gain(innovation, z.noise)
    gain[7:] = 0
    keep = np.eye(10) - gain @ z.jacobian
    joseph = keep @ prior.cov @ keep.T + gain @ z.noise @ gain.T
    rule = Schmidt(Linearised(), 7, np.diagonal(prior.cov)[7:])
    np.testing.assert_allclose(rule.condition(prior, innovation, z.noise).cov, joseph, atol=1e-12)
    np.testing.assert_allclose(condition(prior, innovation, z.noise, gain).cov, joseph, atol=1e-12)


@pytest.mark.parametrize("name", ["fixed", "checked", "ckf", "mmae"])
def test_biases_of_ranges_are_reckoned_with(name: str) -> None:
    ranges = synthetic_logs.simulate(synthetic_logs.with_duration(synthetic_logs.SCENARIOS["ranges-open"], 60.0), 1)
    chosen = FilterOptions(consider=ConsiderOptions(every_method="ranges"), output_rate=0.0)
    solution = run_filter(ranges.timeline(), build_method(name), chosen)
    # a metre and more of biases that no average removes
    assert solution.std[-1, 0] > 0.9


def test_biases_of_ranges_do_not_concern_fixes(log) -> None:
    told = FilterOptions(consider=ConsiderOptions(every_method="ranges"))
    with_choice, without = (run_filter(log.timeline(), build_method("fixed"), chosen) for chosen in (told, FilterOptions()))
    np.testing.assert_array_equal(with_choice.cov, without.cov)
