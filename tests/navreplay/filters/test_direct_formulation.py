"""The closed-loop error-state filter against a direct extended Kalman filter, written out here: the same estimates."""

from dataclasses import replace

import numpy as np

import synthetic_logs
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.mechanisation.strapdown import NavState, Steps, integrate_steps, make_steps
from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, ImuNoise

UAV = synthetic_logs.SCENARIOS["uav-flight"]
STEPS = np.array([1e-8, 1e-8, 0.1, 1e-3, 1e-3, 1e-3, *[1e-5] * 3, *[1e-6] * 3, *[1e-4] * 3])
"""Of the differences by which the mechanisation is linearised: latitude, longitude [rad], height, and so on."""


def shift(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """A packed state moved by d (15,): all of it additive but the quaternion, which is turned by a rotation vector in n."""
    y = x.copy()
    y[:6] += d[:6]
    y[6:10] = rotation.quat_multiply(rotation.quat_from_rotvec(d[6:9]), x[6:10])
    y[10:16] += d[9:]
    return y


def subtract(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    turn = rotation.rotvec_from_quat(rotation.quat_multiply(y[6:10], rotation.quat_conjugate(x[6:10])))
    return np.concatenate([y[:6] - x[:6], turn, y[10:16] - x[10:16]])


def mechanise(x: np.ndarray, steps: Steps, part: slice) -> np.ndarray:
    """f of a state over some steps."""
    some = Steps(steps.start_ns, *(a[part] for a in (steps.t_ns, steps.dt, steps.dtheta, steps.dvel, steps.bridged)))
    return integrate_steps(some, NavState.unpack(x))[-1]


def predict(x: np.ndarray, p: np.ndarray, steps: Steps, part: slice, noise: ImuNoise) -> tuple[np.ndarray, np.ndarray]:
    """f and its Jacobian by central differences, with half of the noise before and half behind."""
    density = np.repeat([0.0, noise.accel_noise, noise.gyro_noise, noise.gyro_bias_walk, noise.accel_bias_walk], 3) ** 2
    half = np.diag(density) * steps.dt[part].sum() / 2
    moved = mechanise(x, steps, part)
    columns = []
    for i, h in enumerate(STEPS):
        ends = [mechanise(shift(x, sign * h * np.eye(15)[i]), steps, part) for sign in (1, -1)]
        columns.append((subtract(ends[0], moved) - subtract(ends[1], moved)) / (2 * h))
    phi = np.array(columns).T
    return moved, phi @ (p + half) @ phi.T + half


def metres(lla: np.ndarray) -> np.ndarray:
    """(15,) units of the additive position in metres NED."""
    meridian, normal = earth.radii(lla[0])
    return np.array([meridian + lla[2], (normal + lla[2]) * np.cos(lla[0]), -1.0, *[1.0] * 12])


def test_ekf_is_the_direct_formulation():
    """The state is latitude, longitude, height, velocity, attitude and biases; z = (latitude, longitude, height, velocity)."""
    journey = replace(UAV.journey, duration=60.0, lever_b=(0.0, 0.0, 0.0))
    log = synthetic_logs.simulate(replace(UAV, journey=journey), 2)
    angles = tuple(rotation.euler_from_quat(log.truth.q_nb[0]) + np.radians([0.2, -0.3, 1.0]))
    chosen = FilterOptions(
        imu_noise=UAV.imu.noise,
        alignment=AlignmentOptions("given", given=angles),
        gate=GateOptions(probability=1.0),
        output_rate=0.0,
    )
    solution = run_filter(log.timeline(), build_method("ekf"), chosen)

    steps = make_steps(log.imu, np.empty(0, dtype=np.int64)).after(int(solution.t_ns[0]))
    x = NavState(
        *(a[0] for a in (solution.lla, solution.vel_n, solution.q_nb, solution.gyro_bias, solution.accel_bias)),
        *np.zeros((2, 3)),
    ).pack()
    p = solution.cov[0] / metres(x) / metres(x)[:, None]
    h = np.eye(6, 15)
    fixes, first = log.fixes, 0
    for row in np.flatnonzero(fixes.t_ns > solution.t_ns[0]):
        stop = int(np.searchsorted(steps.t_ns, fixes.t_ns[row])) + 1
        for begin in range(first, stop, 5):
            x, p = predict(x, p, steps, slice(begin, min(begin + 5, stop)), UAV.imu.noise)
        first = stop
        unit = metres(x)[:6]
        told = np.zeros((6, 6))
        told[:3, :3], told[3:, 3:] = fixes.cov_pos[row], fixes.cov_vel[row]
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + told / unit / unit[:, None])
        x = shift(x, gain @ (np.append(fixes.lla[row], fixes.vel_n[row]) - x[:6]))
        p = (np.eye(15) - gain @ h) @ p

    std = solution.std[-1]
    last = NavState(
        *(a[-1] for a in (solution.lla, solution.vel_n, solution.q_nb, solution.gyro_bias, solution.accel_bias)),
        *np.zeros((2, 3)),
    )
    np.testing.assert_allclose(subtract(x, last.pack()) * metres(x) / std, 0, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diagonal(p)) * np.abs(metres(x)) / std, 1, atol=0.005)
    assert np.abs(earth.ned_between(solution.lla[0], solution.lla[-1])).max() > 300
