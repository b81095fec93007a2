"""Mechanisation and its linearisation: closed forms, reference implementation, finite differences."""

import numpy as np
import pytest

from navreplay.error_models.ned import Propagated
from navreplay.geodesy import earth, rotation
from navreplay.mechanisation import _ned_kernel, _strapdown_kernel
from navreplay.mechanisation._kernel_arrays import Driving, StepRows
from navreplay.mechanisation.strapdown import NavState, integrate_steps, make_steps, mechanise, split_at_long_gaps
from navreplay.timeline import ImuSeries

NO_CUTS = np.empty(0, dtype=np.int64)


def times(n: int, dt_ns: int = 10_000_000) -> np.ndarray:
    return 1_400_000_000_000_000_000 + dt_ns * np.arange(n, dtype=np.int64)


def wandering_imu(n: int = 101, seed: int = 1) -> ImuSeries:
    rng = np.random.default_rng(seed)
    t = times(n)
    phase = np.arange(n)[:, None] * 0.05
    gyro = 0.4 * np.sin(phase + [0, 1, 2]) + rng.normal(0, 0.01, (n, 3))
    accel = np.array([0, 0, -9.8]) + 2 * np.sin(phase * 1.3 + [2, 0, 1]) + rng.normal(0, 0.05, (n, 3))
    return ImuSeries(t, gyro, accel)


def start_state(**changes: np.ndarray) -> NavState:
    values = {
        "lla": np.array([0.8, 0.3, 250.0]),
        "vel_n": np.array([12.0, -7.0, 0.5]),
        "q_nb": rotation.quat_from_euler(0.05, -0.1, 2.0),
        "gyro_bias": np.array([1e-3, -2e-3, 5e-4]),
        "accel_bias": np.array([0.02, 0.01, -0.03]),
        "gyro_scale": np.array([1e-3, -5e-4, 2e-3]),
        "accel_scale": np.array([-1e-3, 5e-4, 1e-3]),
    }
    return NavState(**(values | changes))


def test_at_rest_stays_at_rest():
    lla = np.array([0.8, 0.3, 250.0])
    q = rotation.quat_from_euler(0.05, -0.1, 2.0)
    c_bn = rotation.matrix_from_quat(q).T
    n = 6001
    gyro = np.tile(c_bn @ earth.earth_rate_n(lla[0]), (n, 1))
    accel = np.tile(c_bn @ -earth.gravity_n(lla[0], lla[2]), (n, 1))
    path = mechanise(ImuSeries(times(n), gyro, accel), NavState.at(lla, np.zeros(3), q))
    assert np.abs(earth.ned_between(lla, path.lla[-1])).max() < 1e-6
    np.testing.assert_allclose(path.vel_n[-1], 0, atol=1e-8)
    np.testing.assert_allclose(np.abs(path.q_nb[-1] @ q), 1, atol=1e-14)


def test_pure_coning_keeps_its_mean_attitude():
    """Classical coning: an attitude that nutates at constant angle must not drift (Savage 1998, part 1)."""
    n, dt, angle, rate = 2001, 0.01, 0.02, 2 * np.pi * 5
    t = np.arange(n) * dt
    rotvec = angle * np.stack([np.cos(rate * t), np.sin(rate * t), 0 * t], axis=1)
    true = rotation.quat_from_rotvec(rotvec)
    # the rate of q(t) by its analytic derivative: w = 2 q* dq/dt
    derivative = np.stack(
        [0 * t, -np.sin(angle / 2) * rate * np.sin(rate * t), np.sin(angle / 2) * rate * np.cos(rate * t), 0 * t], axis=1
    )
    fine = 2 * rotation.quat_multiply(rotation.quat_conjugate(true), derivative)[:, 1:]
    imu = ImuSeries(times(n), fine + 0, np.zeros((n, 3)))
    steps = make_steps(imu, NO_CUTS)
    q = true[0]
    for rotvec_step in steps.dtheta:
        q = rotation.quat_multiply(q, rotation.quat_from_rotvec(rotvec_step))
    drift = rotation.rotvec_from_quat(rotation.quat_multiply(rotation.quat_conjugate(true[-1]), q))
    naive = angle**2 / 2 * rate * t[-1]  # what the coning motion would cost without correction, of this order
    assert np.abs(drift).max() < 0.02 * naive


def test_cutting_a_step_changes_nothing_that_matters():
    imu = wandering_imu()
    whole = integrate_steps(make_steps(imu, NO_CUTS), start_state())
    cuts = imu.t_ns[[10, 33, 70]] + np.array([1, 4_000_000, 9_999_999])
    steps = make_steps(imu, cuts)
    assert len(steps) == len(imu) - 1 + 3
    cut = integrate_steps(steps, start_state())
    np.testing.assert_allclose(cut[-1], whole[-1], atol=1e-6)
    assert steps.dt.sum() == pytest.approx(1.0, abs=1e-12)


def test_kernel_equals_its_python_twin():
    imu = wandering_imu(21)
    steps = make_steps(imu, NO_CUTS)
    arguments = (start_state().pack(), steps.dt, steps.dtheta, steps.dvel)
    fast, slow = np.empty((20, 28)), np.empty((20, 28))
    _strapdown_kernel.integrate(*arguments, fast)
    _strapdown_kernel.integrate.py_func(*arguments, slow)
    np.testing.assert_allclose(fast, slow, rtol=1e-13, atol=1e-13)


def run_propagate(imu, state, p, interval, nodes, keep=True, tau=None, density=None):
    steps = make_steps(imu, NO_CUTS)
    n, k = len(p), len(nodes)
    tau = np.full(n - 9, np.inf) if tau is None else tau
    density = np.zeros(n) if density is None else density
    out = np.empty((k, 28)), np.empty((k, n, n)), np.empty((k, n, 0)), np.empty((k * keep, n, n)), np.empty((k * keep, n, n))
    cross = np.empty((n, 0))
    rows = StepRows(steps.dt, steps.dtheta, steps.dvel, steps.bridged)
    _ned_kernel.propagate(state.pack(), p, cross, rows, np.array(nodes), Driving(density, tau), interval, Propagated(*out))
    return out[0], out[1], *out[3:]


def disturbed(state: NavState, d: np.ndarray) -> NavState:
    q = rotation.quat_multiply(rotation.quat_from_rotvec(d[6:9]), state.q_nb)
    return NavState(
        earth.move_lla(state.lla, d[0:3]),
        state.vel_n + d[3:6],
        q,
        state.gyro_bias + d[9:12],
        state.accel_bias + d[12:15],
        state.gyro_scale + d[15:18],
        state.accel_scale + d[18:21],
        state.gyro_markov + d[21:24],
    )


def difference(true: np.ndarray, computed: np.ndarray) -> np.ndarray:
    meridian, normal = earth.radii(computed[0])
    scale = np.array([meridian + computed[2], (normal + computed[2]) * np.cos(computed[0]), -1])
    turn = rotation.rotvec_from_quat(rotation.quat_multiply(true[6:10], rotation.quat_conjugate(computed[6:10])))
    return np.concatenate([(true[:3] - computed[:3]) * scale, true[3:6] - computed[3:6], turn, true[10:25] - computed[10:25]])


def test_transition_equals_finite_differences():
    imu = wandering_imu()
    state = start_state(vel_n=np.array([120.0, -70.0, 5.0]))
    steps = make_steps(imu, NO_CUTS)
    computed = integrate_steps(steps, state)[-1]
    sizes = np.repeat([100.0, 0.1, 1e-4, 1e-4, 1e-2, 1e-3, 1e-3, 1e-4], 3)
    phi = run_propagate(imu, state, np.eye(24), 0.01, [100])[2][0]
    for i in range(24):
        d = np.zeros(24)
        d[i] = sizes[i]
        plus = difference(integrate_steps(steps, disturbed(state, d))[-1], computed)
        minus = difference(integrate_steps(steps, disturbed(state, -d))[-1], computed)
        column = (plus - minus) / (2 * sizes[i])
        np.testing.assert_allclose(phi[:, i], column, rtol=3e-3, atol=2e-5 * max(1, np.abs(column).max()))


def test_covariance_steps_of_50_ms_cost_nothing_that_matters():
    imu = wandering_imu(1001)
    p = np.diag(np.repeat([1.0, 0.1, 0.01, 1e-3, 0.05], 3) ** 2)
    density = np.repeat([0, 1e-3, 1e-4, 1e-6, 1e-5], 3) ** 2
    fine = run_propagate(imu, start_state(), p, 0.0, [1000], density=density)[1][0]
    coarse = run_propagate(imu, start_state(), p, 0.05, [1000], density=density)[1][0]
    np.testing.assert_allclose(np.sqrt(np.diag(coarse)), np.sqrt(np.diag(fine)), rtol=2e-3)


def test_covariance_is_that_of_transition_and_noise():
    imu = wandering_imu()
    p = np.diag(np.repeat([1.0, 0.1, 0.01, 1e-3, 0.05], 3) ** 2)
    tau = np.repeat([300.0, 100.0], 3)
    density = np.repeat([0, 1e-3, 1e-4, 1e-6, 1e-5], 3) ** 2
    _, covariances, transitions, noises = run_propagate(imu, start_state(), p, 0.02, [40, 100], tau=tau, density=density)
    for node in range(2):
        p = transitions[node] @ p @ transitions[node].T + noises[node]
        np.testing.assert_allclose(covariances[node], p, rtol=1e-11, atol=1e-18)
    np.testing.assert_array_equal(covariances[1], covariances[1].T)
    assert np.linalg.eigvalsh(covariances[1]).min() > 0


def test_gauss_markov_bias_fades():
    tau = np.repeat([10.0, 5.0], 3)
    states, _, transitions, _ = run_propagate(wandering_imu(), start_state(), np.eye(15), 0.05, [100], tau=tau)
    np.testing.assert_allclose(states[0, 10:13], np.exp(-0.1) * start_state().gyro_bias, rtol=1e-12)
    np.testing.assert_allclose(np.diag(transitions[0])[12:], np.exp(-0.2), rtol=1e-12)


def test_bridged_gap_widens_the_covariance():
    imu = wandering_imu(201)
    keep = np.r_[0:100, 120:201]
    gappy = ImuSeries(imu.t_ns[keep], imu.gyro[keep], imu.accel[keep])
    steps = make_steps(gappy, NO_CUTS)
    assert steps.bridged.sum() == 1
    p = np.diag(np.repeat([1.0, 0.1, 0.01, 1e-3, 0.05], 3) ** 2)
    with_gap = run_propagate(gappy, start_state(), p, 0.05, [180])[1][0]
    without = run_propagate(imu, start_state(), p, 0.05, [200])[1][0]
    assert with_gap[3, 3] > without[3, 3] + 0.9 * (0.21 * _ned_kernel.BRIDGE_ACCEL) ** 2


def test_long_gaps_split_the_series():
    imu = wandering_imu(301)
    keep = np.r_[0:100, 150:151, 200:301]
    pieces = split_at_long_gaps(ImuSeries(imu.t_ns[keep], imu.gyro[keep], imu.accel[keep]), 300_000_000)
    assert [len(piece) for piece in pieces] == [100, 101]
