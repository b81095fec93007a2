"""The motion generator and the inverse mechanisation: derivatives, closed forms, and the way back through the mechanisation."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.integrate import quad

from navreplay.geodesy.earth import EARTH_RATE, gravity, gravity_n, ned_between, radii
from navreplay.geodesy.rotation import euler_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat
from navreplay.mechanisation.strapdown import NavState, mechanise
from synthetic_logs import SCENARIOS, ideal_imu, truth_at
from synthetic_logs.motion.manoeuvres import Motion, accelerate, climb, course_rate_of_bank, spiral, stop, straight, turn
from synthetic_logs.sensors.imu import sense, sense_means

DEG = pi / 180
PLACE = (45 * DEG, 7 * DEG, 200.0)
LEGS = (
    straight(5.0)
    + accelerate(20.0, 10.0)
    + turn(90 * DEG, 12 * DEG)
    + climb(5 * DEG, 20.0)
    + spiral(-200 * DEG, 9 * DEG, -4 * DEG)
    + stop(10.0, 8.0)
)


def central_difference(function, t_s, step=1e-4):
    return (function(t_s + step) - function(t_s - step)) / (2 * step)


@pytest.mark.parametrize("coordinated", [False, True])
def test_rates_are_the_derivatives(coordinated):
    path = Motion(PLACE, LEGS, coordinated=coordinated).trace(100.0)
    t_s = np.linspace(0.5, 99.5, 1501)
    motion = path.at(t_s)
    np.testing.assert_allclose(central_difference(lambda t: path.at(t).vel_n, t_s), motion.accel_n, atol=1e-6)
    before, after = path.at(t_s - 1e-4).q_nb, path.at(t_s + 1e-4).q_nb
    np.testing.assert_allclose(rotvec_from_quat(quat_multiply(quat_conjugate(before), after)) / 2e-4, motion.turn_b, atol=1e-6)
    moved = ned_between(path.at(t_s - 0.01).lla, path.at(t_s + 0.01).lla) / 0.02
    np.testing.assert_allclose(moved, motion.vel_n, atol=3e-4)
    assert np.ptp(motion.accel_n, axis=0).min() > 1


def test_profiles_are_smooth_to_the_third_derivative_at_every_knot():
    path = Motion(PLACE, LEGS).trace(90.0)
    knots = path.profile.x[1:-1]
    for order in range(4):
        derivative = path.profile.derivative(order) if order else path.profile
        before, after = derivative(knots - 1e-9), derivative(knots + 1e-9)
        np.testing.assert_allclose(before, after, atol=1e-6)


def test_legs_reach_what_they_name():
    path = Motion(PLACE, LEGS, course=10 * DEG).trace(120.0)
    ends = np.cumsum([5.0, 10.0, 90 / 12 + 2, 20.0, 200 / 9 + 4, 8.0, 10.0])
    at_ends = path.at(ends)
    euler = euler_from_quat(at_ends.q_nb)
    np.testing.assert_allclose(np.linalg.norm(at_ends.vel_n, axis=1), [0, 20, 20, 20, 20, 0, 0], atol=1e-12)
    np.testing.assert_allclose(euler[:, 2] / DEG, [10, 10, 100, 100, -100, -100, -100], atol=1e-9)
    np.testing.assert_allclose(euler[:, 1], 0, atol=1e-12)
    assert at_ends.lla[3, 2] > 220
    assert at_ends.lla[4, 2] < at_ends.lla[3, 2] - 20
    np.testing.assert_array_equal(at_ends.lla[5], at_ends.lla[6])


def test_loop_repeats_and_without_one_the_motion_goes_on_straight():
    loop = accelerate(10.0, 5.0) + stop(5.0, 5.0)
    speeds = np.linalg.norm(Motion(PLACE, straight(1.0), loop).trace(100.0).at(6.0 + 15.0 * np.arange(6)).vel_n, axis=1)
    np.testing.assert_allclose(speeds, 10.0)
    onward = Motion(PLACE, accelerate(10.0, 5.0)).trace(300.0).at(np.array([5.0, 100.0, 300.0]))
    np.testing.assert_allclose(onward.vel_n[:, 0], 10.0)


@pytest.mark.parametrize("make", [lambda: turn(5 * DEG, 10 * DEG), lambda: climb(3 * DEG, 8.0), lambda: climb(pi / 2, 20.0)])
def test_impossible_legs_are_refused(make):
    with pytest.raises(ValueError, match=r"longer than 0 s|below 90 degrees"):
        make()


def test_position_along_meridian_and_parallel_matches_closed_forms():
    north = Motion(PLACE, straight(60.0), speed=100.0).trace(600.0).at(np.array([600.0])).lla[0]
    arc, _ = quad(lambda lat: float(radii(lat)[0]) + PLACE[2], PLACE[0], north[0], epsabs=1e-6, epsrel=1e-13)
    assert arc == pytest.approx(60000.0, abs=1e-6)
    east = Motion(PLACE, straight(60.0), speed=100.0, course=pi / 2).trace(600.0).at(np.array([600.0])).lla[0]
    _, normal = radii(PLACE[0])
    assert (east[1] - PLACE[1]) * (normal + PLACE[2]) * np.cos(PLACE[0]) == pytest.approx(60000.0, abs=1e-6)
    assert (east[0] - PLACE[0]) * 6.4e6 == pytest.approx(0, abs=1e-6)


def test_standing_imu_senses_gravity_and_earth_rate():
    path = Motion(PLACE, straight(10.0), course=pi / 2).trace(10.0)
    t_s = np.linspace(0.0, 10.0, 11)
    facing_east = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    expected_gyro = [0.0, -EARTH_RATE * np.cos(PLACE[0]), -EARTH_RATE * np.sin(PLACE[0])]
    for gyro, accel in (sense(path, t_s), sense_means(path, t_s[:-1], t_s[1:])):
        np.testing.assert_allclose(gyro, np.tile(expected_gyro, (len(gyro), 1)), atol=1e-16)
        np.testing.assert_allclose(accel, np.tile(facing_east @ -gravity_n(PLACE[0], PLACE[2]), (len(accel), 1)), atol=1e-12)


def test_eastward_speed_lightens_by_eotvos():
    speed = 100.0
    path = Motion(PLACE, straight(10.0), speed=speed, course=pi / 2).trace(10.0)
    _, accel = sense(path, np.array([5.0]))
    _, normal = radii(PLACE[0])
    eotvos = 2 * EARTH_RATE * speed * np.cos(PLACE[0]) + speed**2 / (normal + PLACE[2])
    assert -accel[0, 2] == pytest.approx(gravity(PLACE[0], PLACE[2]) - eotvos, abs=1e-12)


def test_level_circle_has_centripetal_force_on_a_car_and_none_on_a_banked_aircraft():
    rate, speed = course_rate_of_bank(20 * DEG, 30.0), 30.0
    legs = turn(3 * pi, rate)
    at = np.array([20.0])
    gyro, accel = sense(Motion(PLACE, legs, speed=speed).trace(40.0), at)
    earth_and_coriolis = 2 * EARTH_RATE * speed
    assert accel[0, 1] == pytest.approx(speed * rate, abs=earth_and_coriolis)
    assert gyro[0, 2] == pytest.approx(rate, abs=2 * EARTH_RATE)
    gyro, accel = sense(Motion(PLACE, legs, speed=speed, coordinated=True).trace(40.0), at)
    assert accel[0, 1] == pytest.approx(0, abs=0.01)
    np.testing.assert_allclose(gyro[0], [0, rate * np.sin(20 * DEG), rate * np.cos(20 * DEG)], atol=2 * EARTH_RATE)


def test_means_equal_the_integral_of_the_rates():
    path = Motion(PLACE, LEGS, coordinated=True).trace(60.0)
    edges = np.linspace(14.0, 24.0, 1001)
    gyro, accel = sense_means(path, edges[:-1], edges[1:])
    fine = np.linspace(14.0, 24.0, 50001)
    for means, values in zip((gyro, accel), sense(path, fine), strict=True):
        blocks = values[:-1].reshape(1000, 50, 3).sum(axis=1) + (values[50::50] - values[:-1:50]) / 2
        np.testing.assert_allclose(means, blocks / 50, atol=2e-8)


@pytest.mark.parametrize(
    ("name", "rate"), [("static", 100.0), ("car-city", 100.0), ("car-highway", 100.0), ("uav-flight", 400.0)]
)
def test_ideal_imu_through_the_mechanisation_returns_the_trajectory_to_millimetres(name, rate):
    journey = replace(SCENARIOS[name].journey, increments=True, imu_rate=rate, duration=600.0)
    imu = ideal_imu(journey)
    truth = truth_at(journey, imu.t_ns)
    navigated = mechanise(imu, NavState.at(truth.lla[0], truth.vel_n[0], truth.q_nb[0]))
    assert np.abs(ned_between(truth.lla[1:], navigated.lla)).max() < 5e-3
    assert np.abs(navigated.vel_n - truth.vel_n[1:]).max() < 1e-4
    alignment = np.abs(np.einsum("ij,ij->i", navigated.q_nb, truth.q_nb[1:]))
    assert np.arccos(np.clip(alignment.min(), 0, 1)) < 1e-7
