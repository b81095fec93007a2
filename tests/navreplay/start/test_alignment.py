"""Initial alignment: levelling, every source of heading, and what it says of itself."""

from dataclasses import replace

import numpy as np
import pytest

import synthetic_logs
from navreplay.geodesy import earth, rotation
from navreplay.options import GRADES, AlignmentOptions, ImuNoise
from navreplay.start.alignment import align, level
from navreplay.start.ground_motion import find_initial_standstill, find_motion
from navreplay.start.heading import Sources
from navreplay.timeline import AttitudeSeries, GnssFixSeries, ImuSeries, LogError

CAR = synthetic_logs.SCENARIOS["car-short"]
SPIRAL = synthetic_logs.SCENARIOS["aircraft-spiral"]


@pytest.fixture(scope="module")
def car() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(CAR, 5)


def sources(log: synthetic_logs.SyntheticLog, **changes) -> Sources:
    options = AlignmentOptions(**changes)
    return Sources(log.imu, log.fixes, None, None, log.scenario.imu.noise, options)


def attitude_error(log: synthetic_logs.SyntheticLog, found) -> np.ndarray:
    true = log.truth.q_nb[np.argmin(np.abs(log.truth.t_ns - found.t_ns))]
    return rotation.rotvec_from_quat(rotation.quat_multiply(true, rotation.quat_conjugate(found.q_nb)))


def without_velocity(fixes: GnssFixSeries) -> GnssFixSeries:
    return replace(fixes, vel_n=np.full_like(fixes.vel_n, np.nan), cov_vel=np.full_like(fixes.cov_vel, np.nan))


def after(log: synthetic_logs.SyntheticLog, seconds: float) -> synthetic_logs.SyntheticLog:
    """The log without its first seconds."""
    start = log.imu.t_ns[0] + int(seconds * 1e9)
    late, fix = log.imu.t_ns >= start, log.fixes.t_ns >= start
    imu = ImuSeries(log.imu.t_ns[late], log.imu.gyro[late], log.imu.accel[late], log.imu.increments)
    fixes = GnssFixSeries(*(getattr(log.fixes, name)[fix] for name in GnssFixSeries.__slots__))
    return replace(log, imu=imu, fixes=fixes)


def test_level_of_a_tilted_body():
    q = rotation.quat_from_euler(0.2, -0.3, 1.0)
    accel = rotation.matrix_from_quat(q).T @ [0, 0, -9.8]
    assert level(accel) == pytest.approx((0.2, -0.3))


def test_standstill_ends_when_the_car_sets_off(car):
    speed = np.hypot(*car.truth.vel_n[:, :2].T)
    sets_off = car.truth.t_ns[np.argmax(speed > 0.05)]
    assert abs(find_initial_standstill(car.imu, car.fixes) - sets_off) < 3_000_000_000


def test_no_standstill_in_motion(car):
    moving = after(car, 45)
    assert find_initial_standstill(moving.imu, moving.fixes) == moving.imu.t_ns[0]


def test_constant_cruise_is_not_taken_for_a_standstill():
    """Without turns or accelerations only GNSS tells that the vehicle moves."""
    n = 2000
    t = 10**18 + 10_000_000 * np.arange(n)
    imu = ImuSeries(t, np.zeros((n, 3)), np.tile([0, 0, -9.8], (n, 1)))
    k = 19
    lla = earth.move_lla(np.array([0.8, 0.1, 0.0]), 30.0 * np.arange(k)[:, None] * [1.0, 0, 0])
    unknown = np.full((k, 3, 3), np.nan)
    fixes = GnssFixSeries(t[::100][:k], lla, np.full((k, 3), np.nan), unknown, unknown, np.ones(k, dtype=np.int8))
    assert find_initial_standstill(imu, fixes) <= t[200]


def test_uniform_flight_is_no_standstill_however_noisy_its_positions():
    """80 m/s with positions of 10 m: the way of the first second may pass for noise, that of two cannot."""
    for seed in range(1, 21):
        log = synthetic_logs.simulate(synthetic_logs.with_duration(SPIRAL, 30.0), seed)
        told = np.tile(np.diag(np.square([10.0, 10.0, 16.0])), (len(log.fixes), 1, 1))
        fixes = replace(without_velocity(log.fixes), cov_pos=told)
        assert find_initial_standstill(log.imu, fixes) == log.imu.t_ns[0]


def test_course_alignment_reaches_back_to_the_standstill(car):
    found = align(sources(car))
    assert found.t_ns < car.imu.t_ns[0] + 2_000_000_000
    assert "at rest" in found.text
    assert "course over ground" in found.text
    error = attitude_error(car, found)
    assert abs(error[2]) < np.radians(2)
    # accelerometer bias, to which the filter ties the tilt
    assert np.abs(error[:2]).max() < 4 * CAR.imu.noise.accel_bias_std / 9.8


def test_setting_off_backwards_is_seen(car):
    """The same drive with the body turned about: the car backs out of its place."""
    half_turn = np.diag([-1.0, -1.0, 1.0])
    imu = replace(car.imu, gyro=car.imu.gyro @ half_turn, accel=car.imu.accel @ half_turn)
    found = align(replace(sources(car), imu=imu))
    assert "backwards" in found.text
    forwards = align(sources(car))
    turn = rotation.quat_multiply(rotation.quat_conjugate(forwards.q_nb), found.q_nb)
    assert np.linalg.norm(rotation.rotvec_from_quat(turn)) == pytest.approx(np.pi, abs=0.05)


def test_sensor_mounted_sideways_is_warned_of(car):
    quarter = rotation.matrix_from_euler(0, 0, -np.pi / 2)
    imu = replace(car.imu, gyro=car.imu.gyro @ quarter.T, accel=car.imu.accel @ quarter.T)
    found = align(replace(sources(car), imu=imu))
    assert len(found.warnings) == 1
    assert "to the right of the IMU's x axis" in found.warnings[0]
    angle = float(found.warnings[0].split("lies ")[1].split(" deg")[0])
    assert abs(abs(angle) - 90) < 25


@pytest.mark.parametrize("velocity", [True, False])
def test_alignment_in_motion(velocity):
    log = synthetic_logs.simulate(synthetic_logs.SCENARIOS["uav-flight"], 2)
    moving = after(log, 180)
    moving = moving if velocity else replace(moving, fixes=without_velocity(moving.fixes))
    found = align(sources(moving))
    assert "in motion" in found.text
    error = attitude_error(log, found)
    assert (np.abs(error) < 4 * np.sqrt(np.diag(found.cov_att)) + 0.01).all()
    assert np.abs(error[:2]).max() < np.radians(6)


def test_positions_alone_align_a_cruising_aircraft():
    log = synthetic_logs.simulate(SPIRAL, 0)
    found = align(sources(log))
    assert np.abs(np.degrees(attitude_error(log, found))).max() < 6


def test_gyrocompass_with_good_gyros():
    noise = ImuNoise(1e-7, 1e-5, 5e-9, 1e-4, 1e-12, 1e-9)
    lla, yaw, n = np.array([0.8, 0.1, 100.0]), 2.2, 60_001
    c_bn = rotation.matrix_from_euler(0.02, -0.05, yaw).T
    rng = np.random.default_rng(4)
    gyro = c_bn @ earth.earth_rate_n(lla[0]) + rng.normal(0, 1e-6, (n, 3))
    accel = np.tile(c_bn @ -earth.gravity_n(lla[0], lla[2]), (n, 1))
    t = 10**18 + 10_000_000 * np.arange(n)
    k = 500
    unknown = np.full((k, 3, 3), np.nan)
    fixes = GnssFixSeries(t[::100][:k], np.tile(lla, (k, 1)), np.zeros((k, 3)), unknown, unknown, np.ones(k, dtype=np.int8))
    imu = ImuSeries(t, gyro, accel)
    found = align(Sources(imu, fixes, None, None, noise, AlignmentOptions()))
    assert "gyrocompass" in found.text
    np.testing.assert_allclose(rotation.euler_from_quat(found.q_nb), [0.02, -0.05, yaw], atol=1e-3)
    with pytest.raises(LogError, match="gyrocompass with these gyros would err"):
        align(Sources(imu, fixes, None, None, GRADES["consumer"], AlignmentOptions(method="gyrocompass")))


def test_given_angles_are_taken_as_they_are(car):
    given = (0.01, -0.02, 1.3)
    found = align(sources(car, method="given", given=given, given_std=(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(rotation.euler_from_quat(found.q_nb), given)
    assert not found.levelled
    assert found.cov_att[2, 2] == pytest.approx(0.09)
    with pytest.raises(LogError, match="'given' without angles"):
        align(sources(car, method="given"))


def test_heading_of_an_attitude_channel(car):
    k = len(car.truth)
    attitude = AttitudeSeries(car.truth.t_ns, car.truth.q_nb, np.tile(np.eye(3) * 1e-4, (k, 1, 1)))
    found = align(replace(sources(car), attitude=attitude))
    assert "attitude channel" in found.text
    assert abs(attitude_error(car, found)[2]) < 1e-3
    assert found.cov_att[2, 2] == pytest.approx(1e-4)
    with pytest.raises(LogError, match="holds no attitude"):
        align(sources(car, method="attitude"))


def test_heading_of_the_reference_only_when_told(car):
    with_reference = replace(sources(car), reference=car.truth)
    assert "reference" not in align(with_reference).text
    told = replace(with_reference, options=AlignmentOptions(method="reference"))
    assert abs(attitude_error(car, align(told))[2]) < 1e-3
    bare = replace(car.truth, q_nb=np.full_like(car.truth.q_nb, np.nan))
    with pytest.raises(LogError, match="reference holds no attitude"):
        align(replace(told, reference=bare))


def test_heading_stays_unknown_without_motion():
    log = synthetic_logs.simulate(synthetic_logs.with_duration(synthetic_logs.SCENARIOS["static"], 60), 1)
    found = align(Sources(log.imu, log.fixes, None, None, GRADES["consumer"], AlignmentOptions()))
    assert "heading is unknown" in found.warnings[0]
    assert found.cov_att[2, 2] > 3


def test_course_from_positions_alone(car):
    bare = without_velocity(car.fixes)
    assert find_motion(bare, 2.0).any()
    found = align(replace(sources(car), fixes=bare))
    assert abs(attitude_error(car, found)[2]) < np.radians(12)
