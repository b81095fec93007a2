"""Cubature: the points, the published error equations, what linear models give, and the filters made of it."""

import numpy as np
import pytest

import synthetic_logs
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.error_models.pointwise import PointwiseModel
from navreplay.error_models.receiver_clock import ReceiverClock
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.measurements.fixes import position_measurement
from navreplay.mechanisation import _cubature_kernel
from navreplay.mechanisation.strapdown import Leg, NavState, Steps, integrate_steps
from navreplay.moments.cubature import Cubature
from navreplay.moments.linearised import Linearised
from navreplay.options import GRADES, FilterOptions, GateOptions, ImuNoise, RangeOptions
from navreplay.timeline import LogError, Timeline
from navreplay.update.gaussian import Gaussian
from synthetic_logs.scenarios import SCENARIOS

TACTICAL = GRADES["tactical"]
LARGE = ImuNoise(1e-4, 1e-3, 1e-3, 0.1, 1e-6, 1e-5, gyro_scale_std=1e-3, accel_scale_std=1e-3, gyro_markov_std=1e-4)


def turning_steps(count: int, dt: float = 0.01) -> Steps:
    """A climbing turn: rate and specific force that change slowly."""
    t = np.arange(1, count + 1) * dt
    rate = np.stack([0.1 * np.sin(t), 0.05 * np.cos(2 * t), 0.2 + 0.05 * t], axis=1)
    force = np.stack([1 + 0.3 * t, 2 * np.cos(t), -9.8 + 0.5 * np.sin(t)], axis=1)
    t_ns = np.rint(t * 1e9).astype(np.int64)
    return Steps(0, t_ns, np.full(count, dt), rate * dt, force * dt, np.zeros(count, dtype=np.bool_))


def flying_state() -> NavState:
    q_nb = rotation.quat_from_euler(0.2, -0.1, 2.0)
    return NavState.at(np.array([0.6, 1.9, 1000.0]), np.array([100.0, -80.0, 5.0]), q_nb)


def draw_covariance(seed: int, size: int, scale: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    std = scale * np.array([5.0] * 3 + [0.3] * 3 + [0.01] * 3 + [1e-4] * 3 + [0.02] * 3 + [1e-3] * (size - 15))
    root = np.tril(rng.normal(size=(size, size))) * 0.3 + np.eye(size)
    return std[:, None] * (root @ root.T) * std


@pytest.mark.parametrize("seed", range(20))
def test_on_a_linear_model_the_rule_is_the_kalman_filters_prediction(seed):
    rng = np.random.default_rng(seed)
    n = 16
    cov, f = draw_covariance(seed, n), rng.normal(size=(n, n))
    noise = 0.1 * np.eye(n)
    root, found, mean, transition, q = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty((n, n)), noise.copy()
    _cubature_kernel.fill_root(cov, root)
    reach = np.sqrt(n)
    there, back = f @ (reach * root), f @ (-reach * root)
    _cubature_kernel.add_moments(((there - back) / (2 * reach)).T.copy(), ((there + back) / 2).T.copy(), n, mean, found, q)
    _cubature_kernel.divide_by_root((f @ root).T.copy(), root, transition)
    expected = f @ cov @ f.T + noise
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(transition, f, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(mean, 0)
    np.testing.assert_array_equal(found, found.T)


def test_moments_of_a_square_are_those_of_a_gaussian():
    """Of y = x^2 with N(0, p), in one of four states: mean p; third-degree points give (n - 1) p^2 for its variance."""
    root = np.diag([0.5, 1.0, 1.0, 1.0])
    reach = 2.0
    squares = (reach * root) ** 2
    mean, cov, q = np.empty(4), np.empty((4, 4)), np.zeros((4, 4))
    _cubature_kernel.add_moments(np.zeros((4, 4)), squares.T.copy(), 4, mean, cov, q)
    np.testing.assert_allclose(mean, [0.25, 1, 1, 1])
    assert cov[0, 0] == pytest.approx(3 * 0.25**2)


def test_a_state_without_variance_keeps_none():
    cov = draw_covariance(3, 15)
    cov[12], cov[:, 12] = 0.0, 0.0
    root = np.empty((15, 15))
    _cubature_kernel.fill_root(cov, root)
    np.testing.assert_allclose(root @ root.T, cov, atol=1e-12)
    model = PointwiseModel(TACTICAL)
    moved = model.propagate(flying_state(), cov, Leg(turning_steps(20), 0, np.array([10, 20]), 0.05))
    assert np.isfinite(moved.covariances).all()
    assert moved.covariances[-1, 12, 12] < 1e-8


@pytest.mark.parametrize("additive", [False, True])
@pytest.mark.parametrize("noise", [TACTICAL, LARGE])
def test_difference_undoes_retract(additive, noise):
    model = NedErrorModel(noise)
    x = flying_state().pack()
    error = 3 * np.sqrt(np.diag(draw_covariance(1, model.size))) * np.random.default_rng(1).choice([-1, 1], model.size)
    moved, found = x.copy(), np.empty(model.size)
    metres = _cubature_kernel.metres_per_radian(x)
    _cubature_kernel.retract(moved, *metres, error, additive)
    _cubature_kernel.fill_difference(moved, x, *metres, additive, found)
    np.testing.assert_allclose(found, error, rtol=1e-6, atol=1e-9)
    if not additive:
        np.testing.assert_allclose(moved, model.retract(NavState.unpack(x), error).pack(), rtol=1e-12, atol=1e-15)
    else:
        half = np.concatenate([[0.0], error[6:9] / 2])
        added = x[6:10] + rotation.quat_multiply(half, x[6:10])
        np.testing.assert_allclose(moved[6:10], added / np.linalg.norm(added), rtol=1e-12)


def frame_rates(lla: np.ndarray, vel_n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return earth.earth_rate_n(lla[0]), earth.transport_rate_n(lla, vel_n)


def published_rates(y: np.ndarray, rate: np.ndarray, force: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Time derivative of (Q, V, P, dQ, dV, dP), computed and computed minus true, by (1), (3), (4) with the slips mended, in
    NED. error: of the gyro (3) and of the accelerometer (3)."""
    q, v, lla, dq, dv, dlla = y[:4], y[4:7], y[7:10], y[10:14], y[14:17], y[17:20]
    ie, en = frame_rates(lla, v)
    ie_true, en_true = frame_rates(lla - dlla, v - dv)
    quat = lambda w: np.concatenate([[0.0], w])  # noqa: E731
    times = rotation.quat_multiply
    true_q = q - dq
    q_dot = (times(q, quat(rate)) - times(quat(ie + en), q)) / 2
    dq_dot = (times(dq, quat(rate)) - times(quat(ie + en), dq)) / 2
    dq_dot = dq_dot + (times(true_q, quat(error[:3])) - times(quat(ie + en - ie_true - en_true), true_q)) / 2
    c, c_true = rotation.matrix_from_quat(q), rotation.matrix_from_quat(true_q)
    gravity = np.array([0.0, 0.0, float(earth.gravity(lla[0], lla[2]))])
    v_dot = c @ force - np.cross(2 * ie + en, v) + gravity
    dv_dot = (c - c_true) @ force + c_true @ error[3:] - np.cross(2 * ie_true + en_true, dv)
    dv_dot = dv_dot - np.cross(2 * (ie - ie_true) + en - en_true, v)
    dv_dot[2] -= 2 * gravity[2] * dlla[2] / 6.37e6
    return np.concatenate([q_dot, v_dot, geodetic_rate(lla, v), dq_dot, dv_dot, position_error_rate(lla, v, dlla, dv)])


def geodetic_rate(lla: np.ndarray, v: np.ndarray) -> np.ndarray:
    meridian, normal = earth.radii(lla[0])
    return np.array([v[0] / (meridian + lla[2]), v[1] / ((normal + lla[2]) * np.cos(lla[0])), -v[2]])


def position_error_rate(lla: np.ndarray, v: np.ndarray, dlla: np.ndarray, dv: np.ndarray) -> np.ndarray:
    """(4): M dV + N dP."""
    meridian, normal = earth.radii(lla[0])
    rm, rn = meridian + lla[2], normal + lla[2]
    n = np.zeros((3, 3))
    n[0, 2] = -v[0] / rm**2
    n[1, 0] = v[1] * np.tan(lla[0]) / (np.cos(lla[0]) * rn)
    n[1, 2] = -v[1] / (np.cos(lla[0]) * rn**2)
    return geodetic_rate(lla, dv) + n @ dlla


def integrate_published(start: np.ndarray, steps: Steps, error: np.ndarray) -> np.ndarray:
    """Runge-Kutta over steps within which rate and force are constant."""
    y = start
    for dt, theta, vel in zip(steps.dt, steps.dtheta, steps.dvel, strict=True):
        rate, force = theta / dt, vel / dt
        k1 = published_rates(y, rate, force, error)
        k2 = published_rates(y + k1 * dt / 2, rate, force, error)
        k3 = published_rates(y + k2 * dt / 2, rate, force, error)
        k4 = published_rates(y + k3 * dt, rate, force, error)
        y = y + (k1 + 2 * k2 + 2 * k3 + k4) * dt / 6
    return y


def test_points_obey_the_published_error_equations():
    """With their second-order terms: an attitude error of 3 deg bends dV by 1.5 cm/s in a second."""
    steps, computed = turning_steps(200, 0.005), flying_state()
    x, point = computed.pack(), computed.pack()
    error = np.concatenate([[8, -8, 15, 0.5, 0.5, -0.5], np.radians([3.0, -2.0, 3.0]), [1e-3, -2e-3, 1e-3, 0.05, -0.05, 0.1]])
    _cubature_kernel.retract(point, *_cubature_kernel.metres_per_radian(x), error, True)
    end = integrate_steps(steps, computed)[-1]
    end_point = integrate_steps(steps, NavState.unpack(point))[-1]
    start = np.concatenate([x[6:10], x[3:6], x[0:3], x[6:10] - point[6:10], x[3:6] - point[3:6], x[0:3] - point[0:3]])
    # the equations hold for the difference of the sensors' errors: true bias minus computed
    y = integrate_published(start, steps, error[9:15])
    np.testing.assert_allclose(y[:10], np.concatenate([end[6:10], end[3:6], end[0:3]]), rtol=2e-6)
    np.testing.assert_allclose(y[10:14], end[6:10] - end_point[6:10], atol=1e-8)
    np.testing.assert_allclose(y[14:17], end[3:6] - end_point[3:6], atol=1e-4)
    np.testing.assert_allclose((y[17:20] - (end[0:3] - end_point[0:3])) * [6.37e6, 5.2e6, 1], 0, atol=1e-3)
    first = linear_velocity_error(steps, computed, error)
    assert np.abs(first + (end[3:6] - end_point[3:6])).max() > 0.01


def linear_velocity_error(steps: Steps, state: NavState, error: np.ndarray) -> np.ndarray:
    """What the linear transition makes of the error in velocity."""
    ends = np.array([len(steps)])
    moved = NedErrorModel(TACTICAL).propagate(state, np.eye(15), Leg(steps, 0, ends, 0.05, keep=True))
    return (moved.transitions[0] @ error)[3:6]


@pytest.mark.parametrize("attitude_states", [3, 4])
@pytest.mark.parametrize("noise", [TACTICAL, LARGE])
def test_small_errors_move_linearly(attitude_states, noise):
    linear, model = NedErrorModel(noise), PointwiseModel(noise, attitude_states)
    cov, steps, ends = draw_covariance(2, model.size, 1e-3), turning_steps(100), np.array([30, 60, 100])
    cross = np.random.default_rng(2).normal(size=(model.size, 2)) * np.sqrt(np.diag(cov))[:, None]
    one = linear.propagate(flying_state(), cov, Leg(steps, 0, ends, 0.01, keep=True), cross)
    two = model.propagate(flying_state(), cov, Leg(steps, 0, ends, 0.01, keep=True), cross)
    std = np.sqrt(np.diagonal(one.covariances, axis1=1, axis2=2))
    scale = std[:, :, None] * std[:, None, :]
    np.testing.assert_allclose(two.covariances / scale, one.covariances / scale, atol=2e-3)
    np.testing.assert_allclose(two.noises / scale, one.noises / scale, atol=1e-3)
    np.testing.assert_allclose(two.crosses / std[:, :, None], one.crosses / std[:, :, None], atol=2e-3)
    np.testing.assert_allclose(two.states, one.states, rtol=1e-7, atol=1e-9)
    for before, after, phi, q in zip([cov, *two.covariances[:-1]], two.covariances, two.transitions, two.noises, strict=True):
        np.testing.assert_allclose(phi @ before @ phi.T + q, after, rtol=1e-9, atol=1e-12 * np.abs(after).max())


def test_second_order_terms_are_found():
    """A heading error sigma of a vehicle that accelerates by f: the mean velocity along loses f t sigma^2 / 2."""
    count, dt, sigma = 100, 0.01, np.radians(5)
    force = np.tile([3.0, 0.0, -9.81], (count, 1)) * dt
    t_ns = np.arange(1, count + 1) * 10_000_000
    steps = Steps(0, t_ns, np.full(count, dt), np.zeros((count, 3)), force, np.zeros(count, dtype=np.bool_))
    state = NavState.at(np.array([0.8, 0.1, 100.0]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    cov = np.diag([1e-4] * 6 + [1e-10, 1e-10, sigma**2] + [1e-16] * 3 + [1e-12] * 3)
    for attitude_states in (3, 4):
        model = PointwiseModel(ImuNoise(1e-9, 1e-9, 1e-9, 1e-9, 0.0, 0.0), attitude_states)
        moved = model.propagate(state, cov, Leg(steps, 0, np.array([count]), 0.05))
        lost = integrate_steps(steps, state)[-1, 3] - moved.states[-1, 3]
        assert lost == pytest.approx(3.0 * sigma**2 / 2, rel=0.05)


def test_where_points_would_mean_nothing_the_transition_is_linear():
    cov = draw_covariance(4, 15)
    cov[8] *= 100.0
    cov[:, 8] *= 100.0
    steps, ends = turning_steps(40), np.array([20, 40])
    one = NedErrorModel(TACTICAL).propagate(flying_state(), cov, Leg(steps, 0, ends, 0.05, keep=True))
    two = PointwiseModel(TACTICAL).propagate(flying_state(), cov, Leg(steps, 0, ends, 0.05, keep=True))
    np.testing.assert_array_equal(two.transitions, one.transitions)
    np.testing.assert_allclose(two.covariances, one.covariances, rtol=1e-9, atol=1e-12)


def test_the_clock_beside_the_points_moves_as_beside_the_linear_model():
    clock = ReceiverClock(("G", "E"), RangeOptions())
    model = ClockedModel(NedErrorModel(TACTICAL), clock)
    cov = draw_covariance(5, 18)
    packed = flying_state().pack()
    state = NavState.unpack(np.concatenate([packed, [100.0, 120.0, -3.0]]))
    ends = np.array([10, 40])
    one = Linearised().propagate(model, state, cov, Leg(turning_steps(40), 0, ends, 0.01))
    two = Cubature().propagate(model, state, cov, Leg(turning_steps(40), 0, ends, 0.01))
    np.testing.assert_allclose(two.states[:, -3:], one.states[:, -3:], rtol=1e-12)
    np.testing.assert_allclose(two.covariances[:, -3:, -3:], one.covariances[:, -3:, -3:], rtol=1e-9)
    std = np.sqrt(np.diagonal(one.covariances, axis1=1, axis2=2))
    apart = (two.covariances - one.covariances)[:, :15, -3:] / (std[:, :15, None] * std[:, None, -3:])
    assert np.abs(apart).max() < 0.02


def test_inputs_are_not_changed_and_results_repeat():
    model, cov, steps = NedErrorModel(TACTICAL), draw_covariance(6, 15), turning_steps(30)
    state, ends = flying_state(), np.array([10, 30])
    before = state.pack(), cov.copy(), steps.dvel.copy(), ends.copy()
    one = Cubature().propagate(model, state, cov, Leg(steps, 0, ends, 0.05))
    two = Cubature().propagate(model, state, cov, Leg(steps, 0, ends, 0.05))
    for now, then in zip((state.pack(), cov, steps.dvel, ends), before, strict=True):
        np.testing.assert_array_equal(now, then)
    np.testing.assert_array_equal(one.covariances, two.covariances)
    np.testing.assert_array_equal(one.states, two.states)


def test_what_first_order_leaves_out_of_the_measurement():
    """Over N(0, sigma^2) per axis of attitude a lever arm's mean shrinks by sigma^2; over s^2 of position a range grows by
    s^2 / r."""
    lever, sigma = np.array([1.0, 0.0, 0.0]), np.radians(2.5)
    state = flying_state()
    z = position_measurement(state, lever, state.lla, np.eye(3), 15)
    turns = np.concatenate([sign * np.sqrt(3) * sigma * np.eye(3) for sign in (1, -1)])
    arms = np.array([rotation.matrix_from_quat(rotation.quat_from_rotvec(turn)) for turn in turns]) @ (
        rotation.matrix_from_quat(state.q_nb) @ lever
    )
    linear = -z.residual + turns @ z.jacobian[:, 6:9].T
    assert np.abs(linear.mean(axis=0) - arms.mean(axis=0)).max() < 2e-3
    np.testing.assert_allclose(np.linalg.norm(arms.mean(axis=0)), 1 - sigma**2, rtol=1e-5)
    spread = np.cov(arms.T, bias=True) - np.cov(linear.T, bias=True)
    assert np.abs(spread).max() < 1e-5
    satellite, places = np.array([2.2e7, 0.0, 0.0]), 10 * np.sqrt(3) * np.concatenate([np.eye(3), -np.eye(3)])
    curved = np.linalg.norm(satellite - places, axis=1).mean() - 2.2e7
    assert curved == pytest.approx(10.0**2 / 2.2e7, rel=0.01)


METHODS = ("ckf", "hrckf", "mcsckf", "mlckf")


@pytest.mark.parametrize("name", METHODS)
def test_on_a_flight_covariances_stay_positive_and_errors_are_of_the_filters_beside(name):
    log = synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIOS["uav-flight"], 60.0), 3)
    options = FilterOptions(imu_noise=log.scenario.imu.noise, gate=GateOptions(1.0), output_rate=2.0, smooth=name == "ckf")
    solution = run_filter(log.timeline(), build_method(name), options)
    np.testing.assert_array_equal(solution.cov, np.swapaxes(solution.cov, 1, 2))
    scaled = solution.cov / (solution.std[:, :, None] * solution.std[:, None, :])
    assert np.linalg.eigvalsh(scaled).min() > 0
    beside = {"ckf": "fixed", "hrckf": "h-infinity", "mcsckf": "correntropy", "mlckf": "ml"}[name]
    other = run_filter(log.timeline(), build_method(beside), options)
    for quantity, limit in (("position", 0.1), ("velocity", 0.02), ("attitude", 0.002)):
        ours, theirs = (evaluate(s, log.truth).errors[quantity].error[-500:] for s in (solution, other))
        assert np.abs(ours - theirs).max() < limit


def test_ranges_with_and_without_imu():
    log = synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIOS["ranges-open"], 30.0), 1)
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=1.0)
    timeline = log.timeline()
    tight = run_filter(timeline, build_method("ckf"), options)
    beside = run_filter(timeline, build_method("fixed"), options)
    assert np.abs(earth.ned_between(beside.lla, tight.lla)).max() < 0.2
    alone = Timeline(ranges=timeline.ranges, fix_lever_b=timeline.fix_lever_b)
    np.testing.assert_array_equal(
        run_filter(alone, build_method("ckf"), options).cov, run_filter(alone, build_method("fixed"), options).cov
    )


def test_attitude_has_three_or_four_states():
    with pytest.raises(LogError, match=r"4 \(additive quaternion\) or 3 \(rotation vector\), got 5"):
        build_method("mlckf", {"attitude_states": 5})
    assert build_method("mlckf", {"attitude_states": 3, "window": 20}).rule == Cubature(3)


def test_the_measurement_is_first_order():
    rng = np.random.default_rng(7)
    state = flying_state()
    z = position_measurement(state, np.array([0.5, 0.2, -1.0]), state.lla, np.eye(3), 15)
    prior = Gaussian(rng.normal(size=15), draw_covariance(7, 15))
    for ours, linear in zip(Cubature().innovate(prior, z), Linearised().innovate(prior, z), strict=True):
        assert np.array_equal(ours, linear)


def test_compiled_kernel_equals_its_source():
    model, cov, steps, ends = PointwiseModel(TACTICAL), draw_covariance(8, 15), turning_steps(6), np.array([3, 6])
    fast = model.propagate(flying_state(), cov, Leg(steps, 0, ends, 0.02))
    slow = NedErrorModel(TACTICAL).propagate(flying_state(), cov, Leg(steps, 0, ends, 0.02, keep=True))
    empty, tau = np.empty((15, 0)), model.correlation_time()
    _cubature_kernel.propagate.py_func(
        flying_state().pack(), cov, empty, Leg(steps, 0, ends, 0.02).rows, ends, tau, 0.02, 1, slow
    )
    np.testing.assert_allclose(fast.states, slow.states, rtol=1e-12)
    np.testing.assert_allclose(fast.covariances, slow.covariances, rtol=1e-7, atol=1e-13)
