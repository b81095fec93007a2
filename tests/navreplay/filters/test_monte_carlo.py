"""Consistency over seeds: average NEES against chi-square bounds, errors against the covariance that the filter states."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import synthetic_logs
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.options import AlignmentOptions, FilterOptions, GateOptions

BLOCKS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}


def run_seeds(scenario: synthetic_logs.Scenario, seeds: range, method: str = "fixed") -> tuple[np.ndarray, np.ndarray]:
    """Errors (seeds, k, 9) and covariances (seeds, k, 9, 9) at the rows that lie on the truth's epochs."""
    # these cars do not slip: their course is their heading but for the noise of the velocity
    alignment = AlignmentOptions(course_std=np.radians(0.3))
    gate = GateOptions(probability=1.0)
    options = FilterOptions(imu_noise=scenario.imu.noise, alignment=alignment, gate=gate, output_rate=1.0)
    errors, covariances = [], []
    for seed in seeds:
        log = synthetic_logs.simulate(scenario, seed)
        solution = run_filter(log.timeline(), build_method(method), options)
        rows = np.isin(solution.t_ns, log.truth.t_ns)
        at = np.searchsorted(log.truth.t_ns, solution.t_ns[rows])
        turn = rotation.quat_multiply(log.truth.q_nb[at], rotation.quat_conjugate(solution.q_nb[rows]))
        position = earth.ned_between(solution.lla[rows], log.truth.lla[at])
        velocity = log.truth.vel_n[at] - solution.vel_n[rows]
        errors.append(np.hstack([position, velocity, rotation.rotvec_from_quat(turn)]))
        covariances.append(solution.cov[rows, :9, :9])
    return np.array(errors), np.array(covariances)


def calm(scenario: synthetic_logs.Scenario) -> synthetic_logs.Scenario:
    """The scenario with accelerometer biases that tilt the levelled start by 0.2 deg.

    With the 8 mg (0.5 deg) of its grade the first minute shows what a linearised filter must: the square of the tilt passes
    for a vertical bias, and the velocity's NEES averages 3.2 instead of 3.
    """
    return replace(scenario, imu=replace(scenario.imu, noise=replace(scenario.imu.noise, accel_bias_std=0.03)))


@pytest.mark.parametrize(
    ("name", "duration", "method"),
    [
        ("car-short", 120.0, "fixed"),
        pytest.param("car-short", 120.0, "ckf", marks=pytest.mark.slow),
        pytest.param("car-city", 400.0, "fixed", marks=pytest.mark.slow),
        pytest.param("uav-flight", 400.0, "fixed", marks=pytest.mark.slow),
        pytest.param("uav-flight", 400.0, "ckf", marks=pytest.mark.slow),
    ],
)
def test_nees_lies_in_its_bounds_and_errors_match_the_covariance(name, duration, method):
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS[name], duration)
    scenario = calm(scenario) if name == "car-short" else scenario
    seeds = 50
    errors, covariances = run_seeds(scenario, range(100, 100 + seeds), method)
    for block in BLOCKS.values():
        e, p = errors[:, :, block], covariances[:, :, block, block]
        nees = np.einsum("ski,ski->sk", e, np.linalg.solve(p, e[..., None])[..., 0]).mean(axis=0)
        low, high = chi2.ppf([0.025, 0.975], 3 * seeds) / seeds
        inside = (nees > low) & (nees < high)
        assert inside.mean() >= 0.9, (name, block, inside.mean(), nees.mean())
        ratio = np.sqrt((e**2).mean(axis=0) / np.diagonal(p, axis1=2, axis2=3).mean(axis=0))
        assert np.abs(np.median(ratio, axis=0) - 1).max() < 0.15


def test_nis_is_white_and_of_the_right_size():
    scenario = synthetic_logs.SCENARIOS["car-short"]
    options = FilterOptions(imu_noise=scenario.imu.noise, gate=GateOptions(probability=1.0))
    squares, products = [], []
    for seed in range(10):
        log = synthetic_logs.simulate(scenario, seed)
        position = run_filter(log.timeline(), build_method("fixed"), options).innovations[0]
        whitened = position.residual / position.std
        squares.append(position.nis)
        products.append((whitened[1:] * whitened[:-1]).mean(axis=1))
    count = sum(len(nis) for nis in squares)
    low, high = chi2.ppf([0.001, 0.999], 3 * count) / count
    assert low < np.concatenate(squares).mean() < high
    assert abs(np.concatenate(products).mean()) < 4 / np.sqrt(3 * count)


def test_an_overconfident_filter_is_caught():
    """The bounds above can fail: told an IMU ten times too good, the filter falls out of them."""
    scenario = synthetic_logs.SCENARIOS["car-short"]
    noise = scenario.imu.noise
    better = replace(noise, gyro_noise=noise.gyro_noise / 10, accel_noise=noise.accel_noise / 10, accel_bias_std=1e-3)
    log = synthetic_logs.simulate(scenario, 0)
    solution = run_filter(log.timeline(), build_method("fixed"), FilterOptions(imu_noise=better, gate=GateOptions(1.0)))
    velocity = next(series for series in solution.innovations if series.kind == "velocity")
    assert velocity.nis.mean() > chi2.ppf(0.999, 3 * len(velocity.nis)) / len(velocity.nis)
