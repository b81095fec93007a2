"""The epoch loop on synthetic drives: against batch least squares, its own covariance, cuts, gaps and bad input."""

from dataclasses import replace

import numpy as np
import pytest

import synthetic_logs
from navreplay.error_models.ned import NedErrorModel
from navreplay.filters.presets import PRESETS, build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.mechanisation.strapdown import Leg, NavState, make_steps
from navreplay.options import AlignmentOptions, FilterOptions, GapOptions, GateOptions
from navreplay.solution import RowStatus, Solution
from navreplay.timeline import GnssFixSeries, ImuSeries, LogError, Timeline, Trajectory
from tests.navreplay.adapt.test_adapter_consistency import BANDS

SCENARIO = synthetic_logs.SCENARIOS["car-short"]


@pytest.fixture(scope="module")
def log() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(SCENARIO, 3)


def options(**changes) -> FilterOptions:
    return replace(FilterOptions(imu_noise=SCENARIO.imu.noise), **changes)


def errors(solution: Solution, truth: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """True minus computed position, velocity and attitude (k, 9) at the rows whose time is in truth, and those rows."""
    at = np.searchsorted(truth.t_ns, solution.t_ns)
    rows = np.flatnonzero((at < len(truth)) & (truth.t_ns[np.minimum(at, len(truth) - 1)] == solution.t_ns))
    at = at[rows]
    turn = rotation.quat_multiply(truth.q_nb[at], rotation.quat_conjugate(solution.q_nb[rows]))
    position = earth.ned_between(solution.lla[rows], truth.lla[at])
    return np.hstack([position, truth.vel_n[at] - solution.vel_n[rows], rotation.rotvec_from_quat(turn)]), rows


def select_imu(imu: ImuSeries, rows: np.ndarray) -> ImuSeries:
    return ImuSeries(imu.t_ns[rows], imu.gyro[rows], imu.accel[rows], imu.increments)


def test_forward_solution_equals_batch_least_squares():
    """Over ten seconds with errors so small that the problem is linear: the last state, given all measurements at once."""
    motion = synthetic_logs.with_duration(SCENARIO, 12.0).journey
    imu = synthetic_logs.ideal_imu(motion)
    truth = synthetic_logs.truth_at(motion, imu.t_ns)
    epochs = np.arange(100, 1200, 100)
    rng = np.random.default_rng(0)
    n_fix = len(epochs)
    z = rng.normal(0, 1e-3, (n_fix, 3))
    fixes = GnssFixSeries(
        imu.t_ns[epochs],
        earth.move_lla(truth.lla[epochs], z),
        np.full((n_fix, 3), np.nan),
        np.tile(np.eye(3) * 1e-6, (n_fix, 1, 1)),
        np.full((n_fix, 3, 3), np.nan),
        np.ones(n_fix, dtype=np.int8),
    )
    true_angles = tuple(rotation.euler_from_quat(truth.q_nb[epochs[0]]))
    chosen = options(
        alignment=AlignmentOptions(method="given", given=true_angles, given_std=(1e-4, 1e-4, 1e-3)),
        gate=GateOptions(probability=1.0),
        position_std_floor=1e-9,
        output_rate=0.0,
    )
    solution = run_filter(Timeline(imu=imu, fixes=fixes), build_method("fixed"), chosen)

    steps = make_steps(imu, np.empty(0, dtype=np.int64)).after(int(fixes.t_ns[0]))
    start = NavState(fixes.lla[0], solution.vel_n[0], solution.q_nb[0], solution.gyro_bias[0], *np.zeros((3, 3)))
    model = NedErrorModel(SCENARIO.imu.noise)
    ends = np.searchsorted(steps.t_ns, fixes.t_ns[1:]) + 1
    moved = model.propagate(start, solution.cov[0], Leg(steps, 0, ends, 0.05, keep=True))
    # joint covariance of the states at all epochs, from the transitions and noises alone
    state_cov = {(0, 0): solution.cov[0]}
    for k, (phi, q) in enumerate(zip(moved.transitions, moved.noises, strict=True), 1):
        for j in range(k):
            state_cov[k, j] = phi @ state_cov[k - 1, j]
        state_cov[k, k] = phi @ state_cov[k - 1, k - 1] @ phi.T + q
    count = len(ends)
    seen = np.vstack([earth.ned_between(s[:3], lla) for s, lla in zip(moved.states, fixes.lla[1:], strict=True)]).ravel()
    joint = np.zeros((3 * count, 3 * count))
    for i in range(1, count + 1):
        for j in range(1, i + 1):
            block = state_cov[i, j][:3, :3]
            joint[3 * i - 3 : 3 * i, 3 * j - 3 : 3 * j] = block
            joint[3 * j - 3 : 3 * j, 3 * i - 3 : 3 * i] = block.T
    joint += np.eye(3 * count) * 1e-6
    last = np.hstack([state_cov[count, j][:, :3] for j in range(1, count + 1)])
    gain = np.linalg.solve(joint, last.T).T
    batch = model.retract(NavState.unpack(moved.states[-1]), gain @ seen)
    batch_cov = state_cov[count, count] - gain @ last.T
    std = np.sqrt(np.diag(batch_cov))
    np.testing.assert_allclose(earth.ned_between(batch.lla, solution.lla[-1]) / std[:3], 0, atol=1e-2)
    np.testing.assert_allclose((batch.vel_n - solution.vel_n[-1]) / std[3:6], 0, atol=1e-2)
    turn = rotation.rotvec_from_quat(rotation.quat_multiply(batch.q_nb, rotation.quat_conjugate(solution.q_nb[-1])))
    np.testing.assert_allclose(turn / std[6:9], 0, atol=1e-2)
    np.testing.assert_allclose((batch.accel_bias - solution.accel_bias[-1]) / std[12:15], 0, atol=1e-2)
    np.testing.assert_allclose(np.sqrt(np.diag(solution.cov[-1])) / std, 1, atol=1e-3)


@pytest.mark.parametrize("name", PRESETS)
def test_every_method_runs_and_its_covariance_stays_positive(log, name):
    solution = run_filter(log.timeline(), build_method(name), options())
    assert solution.method == name
    np.testing.assert_array_equal(solution.cov, np.swapaxes(solution.cov, 1, 2))
    scale = solution.std
    assert np.linalg.eigvalsh(solution.cov / (scale[:, :, None] * scale[:, None, :])).min() > 0
    error, rows = errors(solution, log.truth)
    # six standard deviations, of a covariance as much too small as the method's file declares
    widest = max(1.0, BANDS[name][0][1]) if name in BANDS else 1.0
    assert np.abs(error[:, :2] / solution.std[rows, :2]).max() < 6 * np.sqrt(widest)
    assert {series.kind for series in solution.innovations} == {"position", "velocity"}


def test_the_same_run_twice_is_identical(log):
    first = run_filter(log.timeline(), build_method("iae"), options())
    second = run_filter(log.timeline(), build_method("iae"), options())
    for name in ("t_ns", "lla", "vel_n", "q_nb", "cov"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_rows_lie_on_the_output_grid_and_at_every_fix(log):
    solution = run_filter(log.timeline(), build_method("fixed"), options(output_rate=10.0))
    updated = solution.t_ns[solution.status == RowStatus.UPDATED]
    inside = log.fixes.t_ns[(log.fixes.t_ns >= log.imu.t_ns[0]) & (log.fixes.t_ns <= log.imu.t_ns[-1])]
    assert set(updated) == set(inside)
    between = np.setdiff1d(solution.t_ns, inside)
    assert (between % 100_000_000 == 0).all()
    assert (np.diff(between) == 100_000_000).all()


def test_output_rate_does_not_change_the_solution(log):
    dense = run_filter(log.timeline(), build_method("fixed"), options(output_rate=20.0))
    sparse = run_filter(log.timeline(), build_method("fixed"), options(output_rate=0.0))
    at = np.searchsorted(dense.t_ns, sparse.t_ns)
    apart = np.abs(earth.ned_between(dense.lla[at], sparse.lla))
    assert (apart < 0.02 * sparse.std[:, :3]).all()


def test_scale_factor_states_are_estimated():
    noise = replace(SCENARIO.imu.noise, gyro_scale_std=0.01, accel_scale_std=0.01)
    scenario = replace(SCENARIO, imu=replace(SCENARIO.imu, noise=noise))
    drive = synthetic_logs.simulate(scenario, 2)
    solution = run_filter(drive.timeline(), build_method("fixed"), options(imu_noise=noise))
    assert solution.state_names[15:] == tuple(f"{sensor}_scale_{axis}" for sensor in ("gyro", "accel") for axis in "xyz")
    assert solution.std[-1, 17] < 0.6 * 0.01
    error, rows = errors(solution, drive.truth)
    square = np.einsum("ki,kij,kj->k", error[:, :3], np.linalg.inv(solution.cov[rows, :3, :3]), error[:, :3])
    assert square.mean() / 3 < 2.5


def test_outlying_fix_is_gated_with_its_reason(log):
    lla = log.fixes.lla.copy()
    lla[80] = earth.move_lla(lla[80], np.array([60.0, 0, 0]))
    fixes = replace(log.fixes, lla=lla)
    solution = run_filter(replace(log.timeline(), fixes=fixes), build_method("fixed"), options())
    position, velocity = solution.innovations
    bad = int(np.flatnonzero(position.t_ns == fixes.t_ns[80])[0])
    assert not position.used[bad]
    assert "beyond the gate" in position.reason[bad]
    assert velocity.used[bad]
    error, rows = errors(solution, log.truth)
    assert np.abs(error[:, 0] / solution.std[rows, 0]).max() < 6


def test_gate_reopens_after_a_run_of_rejections(log):
    lla = log.fixes.lla.copy()
    lla[60:] = earth.move_lla(lla[60:], np.array([300.0, 0, 0]))
    unknown = np.full_like(log.fixes.vel_n, np.nan)
    fixes = replace(log.fixes, lla=lla, vel_n=unknown, cov_vel=np.full_like(log.fixes.cov_vel, np.nan))
    solution = run_filter(replace(log.timeline(), fixes=fixes), build_method("fixed"), options())
    assert any("11 epochs in a row (10 s) contradicted the filter" in event.text for event in solution.events)
    assert np.abs(earth.ned_between(fixes.lla[-1], solution.lla[-1])[0]) < 20


def test_long_gap_resets_or_refuses(log):
    imu = log.imu
    keep = np.flatnonzero((imu.t_ns < imu.t_ns[0] + 60_000_000_000) | (imu.t_ns > imu.t_ns[0] + 75_000_000_000))
    timeline = replace(log.timeline(), imu=select_imu(imu, keep))
    solution = run_filter(timeline, build_method("fixed"), options())
    assert any("silent for 15.0" in event.text for event in solution.events)
    assert sum("aligned" in event.text for event in solution.events) >= 2
    error, _ = errors(solution, log.truth)
    assert np.abs(error[-100:, :2]).max() < 10
    with pytest.raises(LogError, match=r"gap of 15.0\d* s is longer than gaps.bridge_s"):
        run_filter(timeline, build_method("fixed"), options(gaps=GapOptions(longer="refuse")))


def test_short_gap_is_bridged_and_told(log):
    imu = log.imu
    keep = np.flatnonzero((imu.t_ns < imu.t_ns[0] + 60_000_000_000) | (imu.t_ns > imu.t_ns[0] + 60_300_000_000))
    solution = run_filter(replace(log.timeline(), imu=select_imu(imu, keep)), build_method("fixed"), options())
    assert any("bridged" in event.text for event in solution.events)
    error, rows = errors(solution, log.truth)
    square = np.einsum("ki,kij,kj->k", error[:, :3], np.linalg.inv(solution.cov[rows, :3, :3]), error[:, :3])
    assert square.max() < 40


def test_missing_series_and_no_overlap_are_told(log):
    with pytest.raises(LogError, match="no IMU channel"):
        run_filter(Timeline(fixes=log.fixes), build_method("fixed"), options())
    with pytest.raises(LogError, match="no GNSS fixes"):
        run_filter(Timeline(imu=log.imu), build_method("fixed"), options())
    late = replace(log.fixes, t_ns=log.fixes.t_ns + 10**15)
    with pytest.raises(LogError, match="no position fix lies inside the IMU's time span"):
        run_filter(Timeline(imu=log.imu, fixes=late), build_method("fixed"), options())


def test_fixes_outside_the_imu_span_are_told(log):
    half = select_imu(log.imu, np.arange(len(log.imu) // 2))
    solution = run_filter(replace(log.timeline(), imu=half), build_method("fixed"), options())
    assert any("fixes lie outside" in event.text for event in solution.events)


def test_noise_scale_scales_the_told_noise(log):
    plain = run_filter(log.timeline(), build_method("fixed"), options())
    scaled = run_filter(log.timeline(), build_method("fixed"), options(noise_scale=3.0))
    np.testing.assert_allclose(scaled.innovations[0].nominal_std, 3 * plain.innovations[0].nominal_std)


def test_smoothing_halves_the_errors_and_stays_consistent():
    drive = synthetic_logs.simulate(SCENARIO, 4)
    forward = run_filter(drive.timeline(), build_method("fixed"), options())
    smoothed = run_filter(drive.timeline(), build_method("fixed"), options(smooth=True))
    assert smoothed.method == "fixed-smoothed"
    assert (smoothed.status == RowStatus.SMOOTHED).all()
    np.testing.assert_array_equal(smoothed.t_ns, forward.t_ns)
    np.testing.assert_allclose(smoothed.lla[-1], forward.lla[-1])
    assert (smoothed.std[:, :9] <= forward.std[:, :9] * (1 + 1e-9)).all()
    error, rows = errors(smoothed, drive.truth)
    before, _ = errors(forward, drive.truth)
    assert np.sqrt((error[:, :6] ** 2).mean()) < 0.7 * np.sqrt((before[:, :6] ** 2).mean())
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(smoothed.cov[rows, :9, :9]), error)
    assert 4 < nees.mean() < 18


@pytest.mark.parametrize("name", ["fixed", "em-offline", "auto"])
def test_progress_ends_with_one(log, name):
    shares: list[float] = []
    run_filter(log.timeline(), build_method(name), options(), shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
