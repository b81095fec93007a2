"""The smoother against batch least squares on a small linear problem."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.filters._backward_kernel import carry_back
from navreplay.filters.smoother import ForwardPass, smooth
from navreplay.mechanisation.strapdown import NavState

SIZE, COUNT = 6, 8


class Linear:
    """Six error states that are velocity and gyro bias, plainly added."""

    def retract(self, state: NavState, correction: np.ndarray) -> NavState:
        return replace(state, vel_n=state.vel_n + correction[..., :3], gyro_bias=state.gyro_bias + correction[..., 3:6])

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
    corrected = np.arange(0, COUNT, 2)
    priors = np.array(prior_x)[corrected], np.array(prior_p)[corrected]
    forward = ForwardPass(np.array(posterior_x), np.array(posterior_p), phi, corrected, *priors)
    states, covariances = smooth(forward, Linear()), forward.covariances

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


def plain(forward: ForwardPass, considered: int) -> tuple[np.ndarray, np.ndarray]:
    """The smoother as Rauch, Tung and Striebel write it, a gain and an inverse for every node."""
    n = SIZE - considered
    prior_x, prior_p = forward.states.copy(), forward.covariances.copy()
    prior_x[forward.corrected], prior_p[forward.corrected] = forward.prior_states, forward.prior_covariances
    x, cov = forward.states.copy(), forward.covariances.copy()
    for k in range(len(x) - 2, -1, -1):
        cross = cov[k, :n, :] @ forward.transitions[k + 1, :n, :].T
        gain = cross @ np.linalg.inv(prior_p[k + 1, :n, :n])
        error = (vector(NavState.unpack(x[k + 1])) - vector(NavState.unpack(prior_x[k + 1])))[:n]
        x[k] = state_of(vector(NavState.unpack(x[k])) + np.append(gain @ error, np.zeros(considered))).pack()
        change = cov[k + 1] - prior_p[k + 1]
        cov[k, :n, :n] += gain @ change[:n, :n] @ gain.T
        cov[k, :n, n:] += gain @ change[:n, n:]
        cov[k, n:, :n] = cov[k, :n, n:].T
    return x, cov


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("considered", [0, 2])
def test_the_fast_form_is_the_plain_one(considered: int, driven: bool) -> None:
    """Over nodes with and without corrections; biases behind the states, which may drive them or not."""
    rng = np.random.default_rng(4)
    count, n = 60, SIZE - considered
    corrected = np.sort(rng.choice(np.arange(1, count), 12, replace=False))
    phi = np.tile(np.eye(SIZE), (count, 1, 1))
    phi[:, :n, :n] += 0.1 * rng.normal(size=(count, n, n))
    if driven:
        phi[:, :n, n:] = 0.1 * rng.normal(size=(count, n, considered))
    x, cov = np.zeros(SIZE), random_covariance(rng, 1.0)
    cov[:n, n:] = cov[n:, :n] = 0.0
    states, covariances, prior_states, prior_covariances = [state_of(x).pack()], [cov], [], []
    for k in range(1, count):
        noise = np.zeros((SIZE, SIZE))
        noise[:n, :n] = 0.01 * np.eye(n)
        x, cov = phi[k] @ x, phi[k] @ cov @ phi[k].T + noise
        if k in corrected:
            prior_states.append(state_of(x).pack())
            prior_covariances.append(cov)
            h = rng.normal(size=(2, SIZE))
            gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + 0.1 * np.eye(2))
            gain[n:] = 0.0
            keep = np.eye(SIZE) - gain @ h
            x, cov = x + gain @ (rng.normal(size=2) - h @ x), keep @ cov @ keep.T + 0.1 * gain @ gain.T
        states.append(state_of(x).pack())
        covariances.append(cov)
    priors = np.array(prior_states), np.array(prior_covariances)
    forward = ForwardPass(np.array(states), np.array(covariances), phi, corrected, *priors)
    expected_states, expected_cov = plain(forward, considered)
    found = smooth(forward, Linear(), considered)
    np.testing.assert_allclose(found, expected_states, atol=1e-9 * np.abs(expected_states).max())
    scale = np.sqrt(np.einsum("ki,kj->kij", *[np.diagonal(expected_cov, axis1=1, axis2=2)] * 2))
    np.testing.assert_allclose(forward.covariances / scale, expected_cov / scale, atol=1e-8)


def test_the_kernel_is_its_python_twin() -> None:
    rng = np.random.default_rng(2)
    phi = np.eye(SIZE) + 0.1 * rng.normal(size=(5, SIZE, SIZE))
    cov = np.array([random_covariance(rng, 1.0) for _ in range(5)])
    outcomes = []
    for carry in (carry_back, carry_back.py_func):
        pull, loss, tie = np.ones(4), np.eye(4), np.ones((4, 2))
        covariances, moves = cov.copy(), np.zeros((5, 4))
        carry(phi, covariances, pull, loss, tie, moves)
        outcomes.append((covariances, moves, pull, loss, tie))
    for fast, slow in zip(*outcomes, strict=True):
        np.testing.assert_allclose(fast, slow, rtol=1e-12, atol=1e-12)
