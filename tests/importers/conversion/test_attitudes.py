"""Attitudes from logs: every type and frame, directions, boresight, accuracy, round trips, and what is wrong with them."""

from dataclasses import replace

import numpy as np
import pytest

from importers.load import load_timeline
from importers.preflight.attitudes import check_attitudes
from importers.preflight.checks import preflight
from importers.rows.log import Table
from importers.settings import InputSettings
from navreplay.geodesy.rotation import (
    frd_from_flu_body,
    frd_ned_from_flu_enu,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
    scalar_last_from_first,
)
from navreplay.geodesy.time_scales import earth_rotation_angle
from navreplay.timeline import AttitudeSeries, LogError
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.memory_log import IMU, imu_table, load_tables, stamps

ARCSEC = np.pi / 180 / 3600
STARS = simulate(with_duration(SCENARIOS["ballistic"], 30.0), 4)
Q_NB = quat_from_euler(0.1, 0.2, 0.3)
N = 10


def quaternions(q, cov=None):
    """A channel of the same attitude N times, as ROS writes it: scalar last."""
    columns = {"header.stamp": stamps(N, 1), "quaternion": np.tile(scalar_last_from_first(q), (N, 1))}
    return "geometry_msgs/msg/QuaternionStamped", Table(stamps(N, 1), columns, N)


def load_attitude(folder, channel, **settings):
    tables = {"/imu": (IMU, imu_table()), "/q": channel}
    return load_tables(folder, tables, {"attitude": {"channel": "/q", **settings}})


def assert_turns_by(found, expected):
    np.testing.assert_allclose(rotvec_from_quat(quat_multiply(found, quat_conjugate(expected))), 0, atol=1e-12)


def test_conventions_and_directions_lead_to_the_same_attitude(tmp_path):
    ros = frd_ned_from_flu_enu(Q_NB)
    for q, settings in (
        (ros, {}),
        (quat_conjugate(ros), {"direction": "frame_to_body"}),
        (Q_NB, {"convention": "ned"}),
        (-2.0 / 2.05 * Q_NB, {"convention": "ned"}),
    ):
        assert_turns_by(load_attitude(tmp_path, quaternions(q), **settings).attitude.q[0], Q_NB)


def test_boresight_is_taken_out(tmp_path):
    sensor = quat_multiply(Q_NB, quat_from_euler(*np.radians([10.0, -20.0, 30.0])))
    timeline = load_attitude(tmp_path, quaternions(sensor), convention="ned", boresight_deg=[10.0, -20.0, 30.0])
    assert_turns_by(timeline.attitude.q[0], Q_NB)


def test_told_accuracy_is_about_the_axes_of_the_sensor(tmp_path):
    timeline = load_attitude(tmp_path, quaternions(Q_NB), convention="ned", sigma_arcsec=[1.0, 1.0, 10.0])
    c_nb = matrix_from_quat(Q_NB)
    np.testing.assert_allclose(c_nb.T @ timeline.attitude.cov[0] @ c_nb, np.diag([1.0, 1.0, 100.0]) * ARCSEC**2, atol=1e-22)


def test_earth_fixed_attitudes_of_a_flu_body(tmp_path):
    timeline = load_attitude(tmp_path, quaternions(frd_from_flu_body(Q_NB)), frame="earth")
    assert timeline.attitude.frame == "earth"
    assert_turns_by(timeline.attitude.q[0], Q_NB)


def test_inertial_attitudes_lose_the_rotation_of_the_earth(tmp_path):
    timeline = load_attitude(tmp_path, quaternions(Q_NB), convention="ned", frame="inertial", ut1_utc_s=0.1)
    attitude = timeline.attitude
    assert attitude.frame == "earth"
    angle = earth_rotation_angle(attitude.t_ns, 0.1)
    turn = np.stack([np.zeros(N), np.zeros(N), -angle], axis=-1)
    assert_turns_by(attitude.q, quat_multiply(quat_from_rotvec(turn), np.tile(Q_NB, (N, 1))))
    per_second = np.diff(np.unwrap(angle)) / np.diff(attitude.t_ns / 1e9)
    np.testing.assert_allclose(per_second, 7.292115e-5, rtol=1e-6)


def test_the_earth_rotation_angle_is_that_of_the_iers_at_j2000():
    j2000_gps_ns = np.array([(946_728_000 - 315_964_800 + 13) * 10**9])
    assert earth_rotation_angle(j2000_gps_ns)[0] == pytest.approx(2 * np.pi * 0.7790572732640, abs=1e-12)
    a_day_later = earth_rotation_angle(j2000_gps_ns + 86_400 * 10**9)[0] - earth_rotation_angle(j2000_gps_ns)[0]
    assert a_day_later == pytest.approx(2 * np.pi * 0.00273781191135448, abs=1e-12)


def test_orientation_of_an_imu_with_its_covariance(tmp_path):
    n = 200
    cov = np.tile(np.diag([1e-4, 4e-4, 9e-4]).ravel(), (n, 1))
    cov[5] = [-1, *[0] * 8]
    cov[7] = 0
    table = imu_table(
        n, orientation=np.tile(scalar_last_from_first(frd_ned_from_flu_enu(Q_NB)), (n, 1)), orientation_covariance=cov
    )
    timeline = load_tables(tmp_path, {"/imu": (IMU, table)}, {"attitude": {"channel": "/imu"}})
    assert len(timeline.imu) == n
    assert len(timeline.attitude) == n - 1
    assert_turns_by(timeline.attitude.q[0], Q_NB)
    # about east, north, up in the log
    np.testing.assert_allclose(timeline.attitude.cov[0], np.diag([4e-4, 1e-4, 9e-4]))
    assert np.isnan(timeline.attitude.cov[6]).all()
    (use,) = [use for use in timeline.provenance.channels if use.role == "attitude"]
    assert dict(use.rejected) == {"no orientation": 1}


def test_odometry_gives_attitude_and_covariance(tmp_path):
    cov = np.zeros((N, 36))
    cov[:, [21, 28, 35]] = [1e-6, 2e-6, 3e-6]
    columns = {
        "header.stamp": stamps(N, 1),
        "pose.pose.position": np.zeros((N, 3)),
        "pose.pose.orientation": np.tile(scalar_last_from_first(frd_ned_from_flu_enu(Q_NB)), (N, 1)),
        "pose.covariance": cov,
    }
    timeline = load_attitude(tmp_path, ("nav_msgs/msg/Odometry", Table(stamps(N, 1), columns, N)))
    assert_turns_by(timeline.attitude.q[0], Q_NB)
    np.testing.assert_allclose(timeline.attitude.cov[0], np.diag([2e-6, 1e-6, 3e-6]))


@pytest.mark.parametrize(
    ("columns", "head", "row"),
    [
        ({"q_w": "a", "q_x": "b", "q_y": "c", "q_z": "d"}, "t,a,b,c,d", Q_NB),
        ({"roll": "a", "pitch": "b", "yaw": "c"}, "t,a,b,c", np.degrees([0.1, 0.2, 0.3])),
    ],
)
def test_tables_of_quaternions_or_angles_against_stated_axes(tmp_path, columns, head, row):
    path = tmp_path / "stars.csv"
    rows = "\n".join(f"{1_400_000_000 + i},{','.join(map(repr, map(float, row)))}" for i in range(N))
    path.write_text(f"{head}\n{rows}\n", encoding="utf-8")
    mapping = {"match": "stars.csv", "role": "attitude", "time": {"column": "t"}, "columns": columns}
    settings = InputSettings.model_validate({"csv": [mapping], "attitude": {"frame": "earth", "sigma_arcsec": [2, 2, 2]}})
    attitude = load_timeline([path], settings).attitude
    assert attitude.frame == "earth"
    assert_turns_by(attitude.q[0], Q_NB)
    np.testing.assert_allclose(attitude.cov[0], 4 * ARCSEC**2 * np.eye(3), atol=1e-24)


@pytest.mark.parametrize("name", ["log.mcap", "log.bag", "log.db3", "log", "log.csv"])
def test_star_attitudes_come_back(tmp_path, name):
    *paths, truth = write(STARS, tmp_path / name)
    told = {} if name == "log.csv" else {"channel": "/stars/attitude", "frame": "earth", "sigma_arcsec": [1, 1, 1]}
    timeline = load_timeline(paths, InputSettings.model_validate({"attitude": told}), reference=truth)
    np.testing.assert_array_equal(timeline.attitude.t_ns, STARS.attitude.t_ns)
    sign = np.sign(np.einsum("ij,ij->i", timeline.attitude.q, STARS.attitude.q))[:, None]
    np.testing.assert_allclose(sign * timeline.attitude.q, STARS.attitude.q, atol=3e-16)
    np.testing.assert_allclose(timeline.attitude.cov, STARS.attitude.cov, rtol=1e-12, atol=1e-24)
    np.testing.assert_array_equal(timeline.imu.gyro, STARS.imu.gyro)
    assert not [finding for finding in preflight(timeline) if finding.level != "info"]


def test_bad_rows_are_counted_and_none_left_is_one_clear_line(tmp_path):
    type_, table = quaternions(Q_NB)
    q = table.columns["quaternion"].copy()
    q[2], q[3] = np.nan, 0.5 * q[3]
    timeline = load_attitude(tmp_path, (type_, replace(table, columns=table.columns | {"quaternion": q})))
    assert len(timeline.attitude) == N - 2
    with pytest.raises(LogError, match=r"/q: none of its 10 attitudes is usable: .*not finite or not a quaternion"):
        load_attitude(tmp_path, (type_, replace(table, columns=table.columns | {"quaternion": 0.5 * q})))


def test_a_heading_alone_needs_north(tmp_path):
    with pytest.raises(LogError, match="needs frame = 'navigation'"):
        load_attitude(tmp_path, quaternions(Q_NB), frame="earth", heading_only=True)


def turned(q):
    return replace(STARS.attitude, q=q)


def test_attitudes_that_fit_the_gyros_raise_nothing():
    assert check_attitudes(STARS.attitude, STARS.imu) == []


@pytest.mark.parametrize(
    ("q", "hint"),
    [
        (quat_conjugate(STARS.attitude.q), "input.attitude.direction: the"),
        (frd_from_flu_body(STARS.attitude.q), "input.attitude.convention: the"),
        (quat_conjugate(frd_from_flu_body(STARS.attitude.q)), "both are the other way"),
        (quat_multiply(STARS.attitude.q, np.broadcast_to(quat_from_euler(0, 0, 1.5), (600, 4))), "boresight_deg"),
    ],
)
def test_attitudes_that_turn_otherwise_than_the_gyros_are_refused_with_the_setting(q, hint):

    (finding,) = check_attitudes(turned(q), STARS.imu)
    assert finding.level == "error"
    assert hint in finding.hint


@pytest.mark.parametrize(("share", "frame"), [(-1.0, "earth"), (1.0, "inertial")])
def test_a_frame_that_turns_with_the_earth_or_does_not_is_told(share, frame):
    log = simulate(with_duration(SCENARIOS["ballistic"], 600.0), 4)
    angle = share * 7.292115e-5 * (log.attitude.t_ns - log.attitude.t_ns[0]) / 1e9
    turn = quat_from_rotvec(np.stack([0 * angle, 0 * angle, angle], axis=-1))
    (finding,) = check_attitudes(replace(log.attitude, q=quat_multiply(turn, log.attitude.q)), log.imu)
    assert finding.code == "attitude-frame"
    assert f"'{frame}'" in finding.hint
    assert check_attitudes(log.attitude, log.imu) == []


def test_attitudes_of_another_day_are_refused():
    later = AttitudeSeries(STARS.attitude.t_ns + 10**15, STARS.attitude.q, STARS.attitude.cov, "earth")
    (finding,) = check_attitudes(later, STARS.imu)
    assert finding.code == "no-attitude-overlap"
