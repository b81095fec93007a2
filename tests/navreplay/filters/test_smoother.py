"""The smoother against batch least squares on a small linear problem."""

from dataclasses import replace

import numpy as np

from navreplay.filters.smoother import ForwardPass, smooth
from navreplay.mechanisation.strapdown import NavState

SIZE, COUNT = 6, 8


class Linear:
    """Six error states that are velocity and gyro bias, plainly added."""

    def retract(self, state: NavState, correction: np.ndarray) -> NavState:
        return replace(state, vel_n=state.vel_n + correction[:3], gyro_bias=state.gyro_bias + correction[3:])

    def difference(self, true: NavState, computed: NavState) -> np.ndarray:
        return np.concatenate([true.vel_n - computed.vel_n, true.gyro_bias - computed.gyro_bias])


def vector(state: NavState) -> np.ndarray:
    return np.concatenate([state.vel_n, state.gyro_bias])


def state_of(x: np.ndarray) -> NavState:
    return replace(NavState.at(np.zeros(3), x[:3], np.array([1.0, 0, 0, 0])), gyro_bias=x[3:])


def random_covariance(rng: np.random.Generator, scale: float) -> np.ndarray:
    root = rng.normal(size=(SIZE, SIZE)) * scale
    return root @ root.T + scale**2 * np.eye(SIZE)


def test_smoothed_states_are_those_of_batch_least_squares():
    rng = np.random.default_rng(8)
    phi = np.eye(SIZE) + 0.3 * rng.normal(size=(COUNT, SIZE, SIZE))
    q = np.array([random_covariance(rng, 0.2) for _ in range(COUNT)])
    h = rng.normal(size=(COUNT, 2, SIZE))
    z = rng.normal(size=(COUNT, 2))
    r = 0.3 * np.eye(2)
    p = random_covariance(rng, 1.0)

    prior_x, prior_p, posterior_x, posterior_p = [], [], [], []
    x, cov = np.zeros(SIZE), p
    for k in range(COUNT):
        if k > 0:
            x, cov = phi[k] @ x, phi[k] @ cov @ phi[k].T + q[k]
        prior_x.append(state_of(x).pack())
        prior_p.append(cov)
        if k % 2 == 0:  # every other node has no measurement
            gain = cov @ h[k].T @ np.linalg.inv(h[k] @ cov @ h[k].T + r)
            x, cov = x + gain @ (z[k] - h[k] @ x), cov - gain @ h[k] @ cov
        posterior_x.append(state_of(x).pack())
        posterior_p.append(cov)
    forward = ForwardPass(*map(np.array, (posterior_x, posterior_p, prior_x, prior_p)), phi)
    states, covariances = smooth(forward, Linear())

    # all states at once: prior, dynamics and measurements as rows of one weighted problem
    information = np.zeros((COUNT * SIZE, COUNT * SIZE))
    right = np.zeros(COUNT * SIZE)
    block = [slice(k * SIZE, (k + 1) * SIZE) for k in range(COUNT)]
    information[block[0], block[0]] += np.linalg.inv(p)
    for k in range(1, COUNT):
        row = np.zeros((SIZE, COUNT * SIZE))
        row[:, block[k]], row[:, block[k - 1]] = np.eye(SIZE), -phi[k]
        information += row.T @ np.linalg.inv(q[k]) @ row
    for k in range(0, COUNT, 2):
        information[block[k], block[k]] += h[k].T @ np.linalg.inv(r) @ h[k]
        right[block[k]] += h[k].T @ np.linalg.inv(r) @ z[k]
    batch = np.linalg.solve(information, right)
    batch_cov = np.linalg.inv(information)
    for k in range(COUNT):
        np.testing.assert_allclose(vector(NavState.unpack(states[k])), batch[block[k]], atol=1e-9)
        np.testing.assert_allclose(covariances[k], batch_cov[block[k], block[k]], atol=1e-9)
    np.testing.assert_array_equal(states[-1], forward.states[-1])
