"""The ballistic flight and its star sensor: consistent with the mechanisation, with what is drawn, with the launch frame."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from navreplay.geodesy.earth import EARTH_RATE, ecef_from_lla, ned_between, quat_en
from navreplay.geodesy.launch_frame import LaunchFrame
from navreplay.geodesy.rotation import euler_from_quat, matrix_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat
from navreplay.mechanisation.strapdown import NavState, mechanise
from synthetic_logs import SCENARIOS, ideal_imu, simulate, truth_at, with_duration
from synthetic_logs.motion.ballistic import BallisticFlight

ARCSEC = pi / 180 / 3600
FLIGHT = SCENARIOS["ballistic"].journey.motion


@pytest.fixture(scope="module")
def path():
    return FLIGHT.trace(601.0)


def test_acceleration_and_turn_are_derivatives_of_velocity_and_attitude(path):
    t_s, step = np.linspace(0.5, 600.0, 300), 1e-3
    before, now, after = path.at(t_s - step), path.at(t_s), path.at(t_s + step)
    np.testing.assert_allclose((after.vel_n - before.vel_n) / (2 * step), now.accel_n, atol=1e-4)
    np.testing.assert_allclose(ned_between(before.lla, after.lla) / (2 * step), now.vel_n, atol=1e-3)
    turn = rotvec_from_quat(quat_multiply(quat_conjugate(before.q_nb), after.q_nb)) / (2 * step)
    np.testing.assert_allclose(turn, now.turn_b, atol=1e-8)


def test_the_flight_climbs_burns_out_and_falls_back(path):
    start, highest, end = path.at(np.array([0.0, 370.0, 600.0])).lla[:, 2]
    assert start == pytest.approx(0, abs=1e-6)
    assert 2.5e5 < highest < 4.5e5
    assert 0 < end < highest
    first = path.at(np.array([0.0]))
    np.testing.assert_allclose(first.vel_n, 0, atol=1e-8)
    assert euler_from_quat(first.q_nb)[0, 1] == pytest.approx(pi / 2, abs=1e-7)


def test_the_imu_senses_thrust_along_its_nose_then_nothing():
    imu = ideal_imu(SCENARIOS["ballistic"].journey)
    t_s = (imu.t_ns - imu.t_ns[0]) / 1e9
    np.testing.assert_allclose(imu.accel[:, 1:], 0, atol=1e-6)
    assert imu.accel[0, 0] == pytest.approx(18.0, abs=0.01)
    np.testing.assert_allclose(imu.accel[t_s > 110.0], 0, atol=1e-6)
    np.testing.assert_allclose(imu.gyro[:, [0, 2]], 0, atol=1e-12)
    assert np.trapezoid(imu.gyro[:, 1], t_s) == pytest.approx(-pi / 4, abs=1e-6)


def test_the_mechanisation_returns_the_flight_to_a_centimetre():
    journey = SCENARIOS["ballistic"].journey
    imu = ideal_imu(journey)
    truth = truth_at(journey, imu.t_ns)
    navigated = mechanise(imu, NavState.at(truth.lla[0], truth.vel_n[0], truth.q_nb[0]))
    assert np.abs(ned_between(truth.lla[1:], navigated.lla)).max() < 0.01
    error = rotvec_from_quat(quat_multiply(navigated.q_nb, quat_conjugate(truth.q_nb[1:])))
    assert np.abs(error).max() < 0.001 * ARCSEC


def test_launch_frame_and_earth_convert_into_each_other(path):
    t_s = np.linspace(0.0, 600.0, 50)
    motion = path.at(t_s)
    frame = FLIGHT.frame
    state = frame.from_earth(t_s, motion.lla, motion.vel_n, motion.q_nb)
    lla, vel_n, q_nb = frame.to_earth(t_s, state)
    np.testing.assert_allclose(ned_between(motion.lla, lla), 0, atol=1e-7)
    np.testing.assert_allclose(vel_n, motion.vel_n, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", q_nb, motion.q_nb)), 1, atol=1e-14)
    np.testing.assert_allclose(state.position[0], 0, atol=1e-6)
    nose = matrix_from_quat(state.q_lb)[:, :, 0]
    np.testing.assert_allclose(nose[0], [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(nose[-1], [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-9)


def test_the_launch_point_moves_with_the_turning_earth():
    frame = LaunchFrame((0.7, 0.4, 100.0), 0.3)
    lla, still = np.array(frame.lla), np.array([1.0, 0.0, 0.0, 0.0])
    state = frame.from_earth(np.array(0.0), lla, np.zeros(3), still)
    later = frame.from_earth(np.array(1.0), lla, np.zeros(3), still)
    speed = EARTH_RATE * np.hypot(*ecef_from_lla(lla)[:2])
    np.testing.assert_allclose(state.velocity, speed * np.array([np.sin(0.3), 0, np.cos(0.3)]), atol=1e-9)
    np.testing.assert_allclose(later.position, state.velocity, atol=0.02)


def test_star_sensor_errs_as_it_is_told_and_noise_windows_multiply_the_variance():
    log = simulate(SCENARIOS["ballistic"], 3)
    truth = truth_at(log.scenario.journey, log.attitude.t_ns)
    q_eb = quat_multiply(quat_en(truth.lla[:, 0], truth.lla[:, 1]), truth.q_nb)
    error = rotvec_from_quat(quat_multiply(quat_conjugate(q_eb), log.attitude.q))
    np.testing.assert_allclose(error, log.attitude_errors.rotation, atol=1e-12)
    np.testing.assert_allclose(error.std(axis=0), ARCSEC, rtol=0.05)
    noisy = simulate(SCENARIOS["ballistic-step"], 3)
    t_s = (log.imu.t_ns - log.imu.t_ns[0]) / 1e9
    inside = (t_s >= 200) & (t_s < 400)
    ideal = ideal_imu(log.scenario.journey).gyro + log.gyro_errors.bias
    np.testing.assert_array_equal(noisy.imu.gyro[~inside], log.imu.gyro[~inside])
    np.testing.assert_allclose((noisy.imu.gyro - ideal)[inside], np.sqrt(10) * (log.imu.gyro - ideal)[inside], rtol=1e-6)
    assert (log.imu.gyro - ideal).std() == pytest.approx(ARCSEC, rel=0.01)
    star = replace(log.scenario.stars, noise_windows=((5.0, 10.0, 3.0),))
    short = with_duration(replace(log.scenario, stars=star), 20.0)
    assert np.trace(simulate(short, 3).attitude_errors.cov[120]) == pytest.approx(27 * ARCSEC**2)


def test_fuel_that_runs_out_before_burn_out_is_refused():
    with pytest.raises(ValueError, match="outlast"):
        BallisticFlight((0.7, 2.0, 0.0), 1.0, exhaustion=100.0)
