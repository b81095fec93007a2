"""Noise estimated from the whole log: the linear problem behind it, and expectation maximisation on it."""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import synthetic_logs
from navreplay.adapt.fixed import Fixed
from navreplay.calibration import _chain_kernel, _linear_kernel
from navreplay.calibration.auto import carry_over
from navreplay.calibration.em_offline import improve_factors, maximise_likelihood
from navreplay.calibration.linear_log import (
    LinearLog,
    adjoin,
    correlate,
    correlate_anew,
    delete,
    log_likelihood,
    process_noise,
    scale_rows,
)
from navreplay.calibration.noise_levels import Chain, find_levels, ratios_of
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth
from navreplay.options import CorrelatedNoise, FilterOptions, GateOptions
from navreplay.timeline import LogError, Timeline

TRANSITION = np.array([[1.0, 1.0], [0.0, 0.9]])
PROCESS = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
START = np.diag([4.0, 1.0])


def draw_log(seed: int, count: int, true: Mapping[str, float]) -> LinearLog:
    """A tracker of two states, told unit variances: position at every epoch but each fifth, velocity at each second."""
    rng = np.random.default_rng(seed)
    state, rows, starts = np.linalg.cholesky(START) @ rng.normal(size=2), [], [0]
    root = np.linalg.cholesky(PROCESS * true["push"])
    corrections = rng.normal(size=(count, 2))
    for k in range(count):
        state = TRANSITION @ state + root @ rng.normal(size=2)
        kinds = ["position"] * (k % 5 != 0) + ["velocity"] * (k % 2 == 0)
        for kind in kinds:
            jacobian = np.eye(2)[["position", "velocity"].index(kind)]
            rows.append((kind, jacobian, jacobian @ state + np.sqrt(true[kind]) * rng.normal()))
        state = state - corrections[k]
        starts.append(len(rows))
    kinds = tuple(kind for kind, _, _ in rows)
    told = np.zeros((count, 2, 2))
    for k in range(count):
        size = starts[k + 1] - starts[k]
        told[k, :size, :size] = np.eye(size)
    return LinearLog(
        start_ns=0,
        start=START,
        t_ns=np.arange(1, count + 1, dtype=np.int64) * 10**9,
        transitions=np.tile(TRANSITION, (count, 1, 1)),
        rest=np.zeros((count, 2, 2)),
        sources={"push": np.tile(PROCESS, (count, 1, 1))},
        corrections=corrections,
        starts=np.array(starts),
        residual=np.array([z for _, _, z in rows]),
        jacobian=np.array([h for _, h, _ in rows]),
        told=told,
        labels=kinds,
        kinds=kinds,
    )


ONES = {"position": 1.0, "velocity": 1.0, "push": 1.0}


def value_at(log: LinearLog, factors: Mapping[str, float]) -> float:
    noise = scale_rows(log, np.array([factors[kind] for kind in log.kinds]))
    return log_likelihood(log, process_noise(log, factors), noise)


def joint_problem(log: LinearLog, factors: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """All measurements at once: residuals (r,) without the corrections, and their covariance (r, r)."""
    count = len(log.t_ns)
    mean, cov, process = np.zeros(2), {}, process_noise(log, factors)
    h, offset = np.zeros((len(log.residual), 2 * count)), np.zeros(len(log.residual))
    for k in range(count):
        mean = TRANSITION @ (mean - (log.corrections[k - 1] if k else 0))
        cov[k, k] = TRANSITION @ (cov[k - 1, k - 1] if k else START) @ TRANSITION.T + process[k]
        for j in range(k):
            cov[k, j] = TRANSITION @ cov[k - 1, j]
        rows = slice(log.starts[k], log.starts[k + 1])
        h[rows, 2 * k : 2 * k + 2] = log.jacobian[rows]
        offset[rows] = log.jacobian[rows] @ mean
    states = np.block([[cov[i, j] if i >= j else cov[j, i].T for j in range(count)] for i in range(count)])
    return log.residual - offset, h @ states @ h.T + np.diag([factors[kind] for kind in log.kinds])


def test_likelihood_and_smoothed_noise_are_those_of_all_measurements_at_once():
    log = draw_log(1, 12, ONES)
    residual, cov = joint_problem(log, ONES)
    found = adjoin(log, process_noise(log, {}), log.told)
    assert found.log_likelihood == pytest.approx(multivariate_normal.logpdf(residual, np.zeros(len(cov)), cov))
    # R is the identity: the smoothed noise is u, and its covariance I - D
    inverse = np.linalg.inv(cov)
    np.testing.assert_allclose(found.pulls[log.epochs, log.places], inverse @ residual, atol=1e-9)
    for k in range(12):
        rows = slice(log.starts[k], log.starts[k + 1])
        size = rows.stop - rows.start
        np.testing.assert_allclose(found.holds[k, :size, :size], inverse[rows, rows], atol=1e-9)


def test_compiled_passes_equal_their_source():
    log = draw_log(2, 6, ONES)
    found = adjoin(log, process_noise(log, {}), log.told)
    (k, n), m, r = log.corrections.shape, 2, len(log.residual)
    forward = np.empty(r), np.zeros((k, m, m)), np.zeros((k, n, m))
    known = log.corrections, log.starts, log.residual, log.jacobian
    value = _linear_kernel.filter_forward.py_func(
        log.start, log.transitions, process_noise(log, {}), *known, log.told, *forward
    )
    pulls, holds, state_pulls, state_holds = np.zeros(r), np.zeros((k, m, m)), np.empty((k, n)), np.empty((k, n, n))
    _linear_kernel.adjoin_backward.py_func(
        log.transitions, log.starts, log.jacobian, *forward, pulls, holds, state_pulls, state_holds
    )
    assert value == pytest.approx(found.log_likelihood)
    np.testing.assert_allclose(holds, found.holds, atol=1e-12)
    np.testing.assert_allclose(state_pulls, found.state_pulls, atol=1e-12)
    np.testing.assert_allclose(state_holds, found.state_holds, atol=1e-12)


def test_a_log_correlated_anew_is_the_log_correlated():
    n = 15
    rng = np.random.default_rng(4)
    known = draw_log(4, 20, {"push": 1.0, "position": 1.0, "velocity": 1.0})
    k = len(known.t_ns)
    known = replace(
        known,
        start=np.eye(n),
        transitions=rng.standard_normal((k, n, n)),
        rest=rng.standard_normal((k, n, n)),
        sources={},
        corrections=np.zeros((k, n)),
        jacobian=rng.standard_normal((len(known.residual), n)),
    )
    first, second = (CorrelatedErrors((CorrelatedNoise("position", std, time),)) for std, time in (((1, 2), 3), ((4, 5), 6)))
    plain, anew = correlate(known, second), correlate_anew(known, correlate(known, first), second)
    for name in ("start", "transitions", "rest", "jacobian", "corrections", "told"):
        assert np.array_equal(getattr(plain, name), getattr(anew, name)), name


def test_gain_of_a_step_is_the_gradient_of_the_likelihood():
    """EM moves a factor f by 2 f / n times the derivative by ln f, with n the number of its hidden variables."""
    log = draw_log(3, 60, {"position": 4.0, "velocity": 0.5, "push": 2.0})
    now = {"position": 2.0, "velocity": 1.0, "push": 1.5}
    improved, _ = improve_factors([log], now)
    counts = {"position": log.kinds.count("position"), "velocity": log.kinds.count("velocity"), "push": 120}
    for name in now:
        high, low = (value_at(log, now | {name: now[name] * np.exp(step)}) for step in (1e-5, -1e-5))
        assert (improved[name] / now[name] - 1) * counts[name] / 2 == pytest.approx((high - low) / 2e-5, rel=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_likelihood_never_falls(seed):
    true = {"position": 9.0, "velocity": 0.04, "push": 0.3}
    _, course = maximise_likelihood([draw_log(seed, 100, true)], ONES, 60, -np.inf)
    assert np.diff(course).min() > -1e-8
    assert course[-1] - course[0] > 10


def test_em_recovers_both_noises_with_the_error_of_theory():
    true = {"position": 4.0, "velocity": 1.0, "push": 0.5}
    seeds, names = 24, tuple(ONES)
    logs = [draw_log(seed, 200, true) for seed in range(seeds)]
    found = np.array([[maximise_likelihood([log], ONES, 100, 1e-3)[0][name] for name in names] for log in logs])
    errors = np.log(found) - np.log([true[name] for name in names])
    # Fisher information of the logarithms, 1/2 tr(C^-1 C_i C^-1 C_j); the covariance C of all is linear in the factors
    whole = joint_problem(logs[0], true)[1]
    parts = [np.linalg.solve(whole, joint_problem(logs[0], true | {n: 2 * true[n]})[1] - whole) for n in names]
    information = [[0.5 * np.trace(one @ other) for other in parts] for one in parts]
    theory = np.sqrt(np.diag(np.linalg.inv(information)))
    assert (np.abs(errors.mean(axis=0)) < 3 * theory / np.sqrt(seeds)).all()
    # chi-square of 23 degrees of freedom: its root lies within 35 % of its mean
    np.testing.assert_allclose(errors.std(axis=0, ddof=1) / theory, 1, atol=0.35)


SCENARIO = synthetic_logs.SCENARIOS["car-short"]


@pytest.fixture(scope="module")
def log() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(SCENARIO, 3)


def test_a_trace_has_the_likelihood_of_the_pass(log):
    """Linearised about a pass with the same noise, the innovations are those of the pass."""
    traced = []

    class Watch:
        traces = 4

        def settle(self, options, trace):
            traced.extend(trace(options, Fixed(), ("gyro_noise",)))
            return build_method("em-offline").calibration.settle(options, trace)

    options = FilterOptions(imu_noise=SCENARIO.imu.noise)
    solution = run_filter(log.timeline(), build_method("fixed"), options)
    run_filter(log.timeline(), replace(build_method("em-offline"), calibration=Watch()), options)
    expected = 0.0
    for k, epoch in enumerate(traced[0].t_ns):
        for series in solution.innovations:
            at = np.flatnonzero(series.t_ns == epoch)
            expected += len(at) and series.nis[at[0]]
        assert traced[0].starts[k + 1] - traced[0].starts[k] == 6
    found = adjoin(traced[0], process_noise(traced[0], {}), traced[0].told)
    assert np.isfinite(found.log_likelihood)
    assert traced[0].labels[:3] == ("position north", "position east", "position down")
    assert expected / len(traced[0].residual) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(("scale", "share"), [(0.25, 4.0), (4.0, 0.25)])
def test_em_offline_finds_what_was_told_wrong(log, scale, share):
    options = FilterOptions(imu_noise=SCENARIO.imu.noise, noise_scale=scale)
    solution = run_filter(log.timeline(), build_method("em-offline"), options)
    assert solution.estimated["position_noise_scale"] == pytest.approx(share, rel=0.15)
    assert solution.estimated["velocity_noise_scale"] == pytest.approx(share, rel=0.2)
    assert any("em-offline, pass 2" in event.text for event in solution.events)
    right = run_filter(log.timeline(), build_method("fixed"), FilterOptions(imu_noise=SCENARIO.imu.noise))
    np.testing.assert_allclose(np.median(solution.std[:, :6] / right.std[:, :6], axis=0), 1, atol=0.2)


def test_estimates_filter_alike_when_told(log):
    """The fixed filter told what em-offline found is em-offline."""
    options = FilterOptions(imu_noise=SCENARIO.imu.noise, noise_scale=2.0)
    found = run_filter(log.timeline(), build_method("em-offline"), options)
    figures = dict(found.estimated)
    scales = {key: figures.pop(key) for key in ("position_noise_scale", "velocity_noise_scale")}
    told = replace(options, **scales, imu_noise=replace(SCENARIO.imu.noise, **figures))
    again = run_filter(log.timeline(), build_method("fixed"), told)
    np.testing.assert_array_equal(found.lla, again.lla)
    np.testing.assert_array_equal(found.cov, again.cov)


def test_em_offline_takes_ranges_with_and_without_imu():
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS["ranges-open"], 60.0)
    drive = synthetic_logs.simulate(scenario, 1)
    options = FilterOptions(imu_noise=scenario.imu.noise, noise_scale=3.0)
    solution = run_filter(drive.timeline(), build_method("em-offline"), options)
    assert solution.estimated["pseudorange_noise_scale"] == pytest.approx(1 / 3, rel=0.15)
    alone = Timeline(ranges=drive.ranges, fix_lever_b=drive.timeline().fix_lever_b)
    solution = run_filter(alone, build_method("em-offline"), options)
    assert solution.estimated["pseudorange_noise_scale"] == pytest.approx(1 / 3, rel=0.3)
    assert "horizontal" in solution.estimated


def test_a_log_without_measurements_is_told(log):
    fixes = log.fixes
    only = log.timeline()
    one = replace(
        fixes, t_ns=fixes.t_ns[:1], lla=fixes.lla[:1], vel_n=fixes.vel_n[:1], cov_pos=fixes.cov_pos[:1],
        cov_vel=fixes.cov_vel[:1], status=fixes.status[:1],
    )  # fmt: skip
    with pytest.raises(LogError):
        run_filter(replace(only, fixes=one), build_method("em-offline"), FilterOptions(imu_noise=SCENARIO.imu.noise))


def draw_chain(seed: int, ratio: np.ndarray, spread: float = 0.3) -> Chain:
    """Three components per epoch, whose noise has the told variance times ratio (k,)."""
    rng = np.random.default_rng(seed)
    residual = np.sqrt(ratio[:, None] + spread) * rng.normal(size=(len(ratio), 3))
    return Chain(residual, np.full((len(ratio), 3), spread))


def test_auto_believes_no_range_to_be_better_than_told():
    """Of what stays with a satellite the scatter shows nothing; of what scatters more than told it does."""
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS["ranges-open"], 90.0)
    drive = synthetic_logs.simulate(scenario, 2)
    for scale, expected in ((3.0, 1.0), (0.25, 4.0)):
        told = replace(FilterOptions(imu_noise=scenario.imu.noise), noise_scale=scale)
        solution = run_filter(drive.timeline(), build_method("auto"), told)
        assert solution.estimated["pseudorange_noise_scale"] == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("seed", range(5))
def test_told_noise_is_kept_where_it_is_right(seed):
    chain = draw_chain(seed, np.ones(400))
    np.testing.assert_array_equal(ratios_of(chain, find_levels([chain])), 1)


def test_a_scale_a_step_and_a_mixture_are_found():
    scale = draw_chain(1, np.full(400, 9.0))
    np.testing.assert_allclose(ratios_of(scale, find_levels([scale])), 9, rtol=0.15)
    true = np.where((np.arange(600) >= 200) & (np.arange(600) < 400), 16.0, 1.0)
    step = draw_chain(2, true)
    found = ratios_of(step, find_levels([step]))
    assert (np.abs(np.log(found / true)) < 0.3).mean() > 0.98
    wide = np.random.default_rng(3).random(600) < 0.2
    mixture = draw_chain(4, np.where(wide, 64.0, 1.0))
    found = ratios_of(mixture, find_levels([mixture]))
    assert ((found > 8) == wide).mean() > 0.97


def test_few_epochs_are_taken_as_told():
    chain = draw_chain(1, np.full(15, 100.0))
    np.testing.assert_array_equal(ratios_of(chain, find_levels([chain])), 1)


def test_compiled_chain_equals_its_source_and_sums_over_all_paths():
    rng = np.random.default_rng(5)
    first, move, density = np.array([0.7, 0.3]), np.array([[0.9, 0.1], [0.4, 0.6]]), rng.normal(size=(5, 2)) * 3
    posterior, moves = np.empty((5, 2)), np.zeros((2, 2))
    value = _chain_kernel.pass_chain.py_func(first, move, density, posterior, moves)
    expected, shares, steps = 0.0, np.zeros((5, 2)), np.zeros((2, 2))
    for path in itertools.product(range(2), repeat=5):
        weight = first[path[0]] * np.exp(density[range(5), path].sum()) * np.prod([move[a, b] for a, b in pairwise(path)])
        expected += weight
        shares[range(5), path] += weight
        for a, b in pairwise(path):
            steps[a, b] += weight
    assert value == pytest.approx(np.log(expected))
    np.testing.assert_allclose(posterior, shares / expected)
    np.testing.assert_allclose(moves, steps / expected)
    fast, fast_moves = np.empty((5, 2)), np.zeros((2, 2))
    assert _chain_kernel.pass_chain(first, move, density, fast, fast_moves) == pytest.approx(value)
    np.testing.assert_allclose(fast, posterior)


def test_a_deletion_residual_is_what_all_others_say():
    """Against conditioning all measurements at once without the one in question, whatever R that one was given."""
    log = draw_log(4, 10, ONES)
    residual, cov = joint_problem(log, ONES)
    for row in (0, 7, len(residual) - 1):
        others = np.delete(np.arange(len(residual)), row)
        weight = np.linalg.solve(cov[np.ix_(others, others)], cov[others, row])
        expected = residual[row] - weight @ residual[others]
        spread = cov[row, row] - weight @ cov[others, row] - 1
        for given in (1.0, 25.0):
            ratios = np.ones(len(residual))
            ratios[row] = given
            noise = scale_rows(log, ratios)
            found = adjoin(log, process_noise(log, {}), noise)
            y, s = delete(log, found, noise, log.told, np.array([[row]]))
            assert abs(y[0, 0]) == pytest.approx(abs(expected))
            assert s[0, 0] == pytest.approx(spread)


AUTO = FilterOptions(imu_noise=SCENARIO.imu.noise, gate=GateOptions(1.0))


def test_auto_is_the_fixed_filter_where_the_told_noise_is_right(log):
    found = run_filter(log.timeline(), build_method("auto"), AUTO)
    fixed = run_filter(log.timeline(), build_method("fixed"), AUTO)
    assert found.estimated["position_noise_scale"] == 1
    np.testing.assert_array_equal(found.lla, fixed.lla)


def test_ratios_of_a_pass_are_carried_to_one_with_other_stretches_and_epochs():
    """By time and label; what the pass before did not see has the mean of its kind."""
    true = {"position": 1.0, "velocity": 1.0, "push": 1.0}
    short, long = draw_log(1, 30, true), draw_log(1, 40, true)
    ratios = np.arange(1.0, len(short.residual) + 1)
    (carried,) = carry_over((short,), (ratios,), (long,), {"position": 2.0, "velocity": 3.0})
    np.testing.assert_array_equal(carried[: len(ratios)], ratios)
    np.testing.assert_array_equal(carried[len(ratios) :], long.by_kind({"position": 2.0, "velocity": 3.0})[len(ratios) :])
    (back,) = carry_over((long,), (carried,), (short,), {})
    np.testing.assert_array_equal(back, ratios)


@pytest.mark.slow
def test_auto_ends_where_the_told_noise_makes_a_pass_lose_its_way():
    """The filter with told noise is started anew within this log; that with the noise found is not."""
    scenario = synthetic_logs.SCENARIOS["step-noise"]
    flight = synthetic_logs.simulate(scenario, 0)
    options = FilterOptions(imu_noise=scenario.imu.noise, output_rate=0.0)
    plain = run_filter(flight.timeline(), build_method("fixed"), options)
    assert any(event.kind == "restart" for event in plain.events)
    found = run_filter(flight.timeline(), build_method("auto"), options)
    assert not any(event.kind == "restart" for event in found.events)


def test_auto_finds_correlated_errors_and_smooths(log):
    gnss = replace(SCENARIO.gnss, correlated_std=(6.0, 6.0, 10.0), correlation_time=8.0, told_position_std=(1.5, 1.5, 2.5))
    drive = synthetic_logs.simulate(replace(SCENARIO, gnss=gnss, journey=replace(SCENARIO.journey, duration=180.0)), 3)
    found = run_filter(drive.timeline(), build_method("auto"), replace(AUTO, smooth=True))
    assert found.method == "auto-smoothed"
    assert found.state_names[-3:] == ("fix_position_error_n", "fix_position_error_e", "fix_position_error_d")
    assert found.estimated["correlated_position_std"][0] == pytest.approx(6, rel=0.5)
    assert found.estimated["position_correlation_time"] == pytest.approx(8, rel=0.6)
    at = np.searchsorted(drive.truth.t_ns, found.t_ns)
    rows = np.flatnonzero(drive.truth.t_ns[np.minimum(at, len(drive.truth) - 1)] == found.t_ns)
    error = earth.ned_between(found.lla[rows], drive.truth.lla[at[rows]])
    square = np.einsum("ki,kij,kj->k", error, np.linalg.inv(found.cov[rows, :3, :3]), error)
    assert square.mean() < 9


def test_auto_weighs_outliers_of_ranges_down():
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS["ranges-open"], 45.0)
    drive = synthetic_logs.simulate(scenario, 1)
    ranges = drive.ranges
    wrong = np.random.default_rng(1).random(len(ranges)) < 0.05
    off = replace(drive, ranges=replace(ranges, pseudorange=ranges.pseudorange + 60.0 * wrong))
    options = FilterOptions(imu_noise=scenario.imu.noise, gate=GateOptions(1.0))
    solution = run_filter(off.timeline(), build_method("auto"), options)
    series = next(series for series in solution.innovations if series.kind == "range")
    ratio = (series.noise_std / series.nominal_std)[:, 0]
    outlying = np.abs(series.residual[:, 0]) > 40
    assert outlying.sum() > 10
    assert np.median(ratio[outlying]) > 5 * np.median(ratio[~outlying])
