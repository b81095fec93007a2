"""What becomes of decoded messages: axes, units, covariances, time bases, order, choice of channels, accounting."""

from dataclasses import replace

import numpy as np
import pytest

from importers.rows.axes import axes_matrix
from importers.rows.log import Table
from importers.rows.screening import longest_increasing
from importers.settings import InputSettings
from navreplay.geodesy.rotation import euler_from_quat, matrix_from_euler
from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import FixStatus, LogError
from tests.helpers.memory_log import FIX, IMU, T0_GPS_NS, TWIST, fix_table, imu_table, load_tables, stamps


def uses(timeline):
    return {use.name: use for use in timeline.provenance.channels}


def test_ros_axes_units_and_time(tmp_path):
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table()), "/fix": (FIX, fix_table())})
    np.testing.assert_array_equal(timeline.imu.gyro[0], [0.01, -0.02, -0.03])
    np.testing.assert_array_equal(timeline.imu.accel[0], [0.1, -0.2, -9.8])
    assert timeline.imu.t_ns[0] == T0_GPS_NS
    np.testing.assert_allclose(np.diagonal(timeline.fixes.cov_pos[0]), [4, 1, 9])
    assert uses(timeline)["/imu"].used == 200
    assert "/imu: its stamps are taken as UTC" in timeline.provenance.assumptions


@pytest.mark.parametrize(("base", "shift_s"), [("utc", 0), ("gps", -18), ("tai", -37)])
def test_time_bases_of_stamps(tmp_path, base, shift_s):
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table())}, {"imu": {"time_base": base, "time_offset_s": 0.5}})
    assert timeline.imu.t_ns[0] == T0_GPS_NS + round((shift_s + 0.5) * 1e9)


def test_stamps_from_power_on_are_set_by_the_recorder_or_a_time_reference(tmp_path):
    table = imu_table(**{"header.stamp": 10**9 + np.arange(200) * 10**7})
    delay = np.full(200, 3_000_000)
    delay[7] = 1_000_000
    table = replace(table, log_time_ns=stamps(200, 100) + delay)
    settings = {"imu": {"time_base": "boot"}}
    by_recorder = load_tables(tmp_path, {"/imu": (IMU, table)}, settings)
    assert by_recorder.imu.t_ns[0] == T0_GPS_NS + 1_000_000
    reference = {"header.stamp": np.array([10**9, 2 * 10**9]), "time_ref": stamps(2, 1)}
    clock = ("sensor_msgs/msg/TimeReference", Table(stamps(2, 1), reference, 2))
    by_reference = load_tables(tmp_path, {"/imu": (IMU, table), "/time": clock}, settings)
    assert by_reference.imu.t_ns[0] == T0_GPS_NS
    assert uses(by_reference)["/time"].role == "time"


def test_a_newer_leap_second_table_is_used(tmp_path):
    table = tmp_path / "leap-seconds.list"
    table.write_text("3692217600 37 # 1 Jan 2017\n3960000000 38 # an invented one\n")
    start = (3960000000 - 2_208_988_800 + 100) * 10**9
    imu = imu_table(**{"header.stamp": start + np.arange(200) * 10**7})
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu)}, {"leap_seconds": str(table)})
    assert timeline.imu.t_ns[0] - gps_from_utc(np.array([start]))[0] == 10**9


def test_axes_letters_and_mounting():
    np.testing.assert_array_equal(axes_matrix("flu"), np.diag([1, -1, -1]))
    np.testing.assert_array_equal(axes_matrix("rfu") @ [1, 2, 3], [2, 1, -3])
    np.testing.assert_array_equal(axes_matrix("bru") @ [1, 2, 3], [-1, 2, -3])
    np.testing.assert_allclose(axes_matrix("frd", (1, 2, 3)), matrix_from_euler(*np.radians([1, 2, 3])))
    with pytest.raises(ValueError, match="right-handed"):
        InputSettings.model_validate({"imu": {"axes": "fru"}})
    with pytest.raises(ValueError, match="three letters"):
        InputSettings.model_validate({"imu": {"axes": "xyz"}})


def test_g_and_degrees_are_recognised_and_told(tmp_path):
    accel = np.tile([0.01, 0.02, 1.0], (200, 1))
    gyro = np.tile([1.0, 2.0, 30.0], (200, 1))
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table(linear_acceleration=accel, angular_velocity=gyro))})
    np.testing.assert_allclose(timeline.imu.accel[0], np.array([0.01, -0.02, -1.0]) * 9.80665)
    np.testing.assert_allclose(timeline.imu.gyro[0], np.radians([1.0, -2.0, -30.0]))
    told = " ".join(timeline.provenance.assumptions)
    assert "taken as g" in told
    assert "taken as deg/s" in told


def test_units_that_are_set_are_not_second_guessed(tmp_path):
    settings = {"imu": {"accel_unit": "m/s2", "gyro_unit": "rad/s"}}
    accel = np.tile([0.0, 0.0, 1.0], (200, 1))
    gyro = np.tile([0.0, 0.0, 30.0], (200, 1))
    table = imu_table(linear_acceleration=accel, angular_velocity=gyro)
    timeline = load_tables(tmp_path, {"/imu": (IMU, table)}, settings)
    assert timeline.imu.accel[0, 2] == -1.0
    assert timeline.imu.gyro[0, 2] == -30.0


def test_nan_and_infinite_samples_are_rejected(tmp_path):
    accel = np.tile([0.1, 0.2, 9.8], (200, 1))
    accel[3, 1], accel[5, 0], accel[6, 0] = np.nan, np.inf, -np.inf
    latitude = np.full(10, 40.0)
    latitude[2] = np.nan
    tables = {"/imu": (IMU, imu_table(linear_acceleration=accel)), "/fix": (FIX, fix_table(latitude=latitude))}
    timeline = load_tables(tmp_path, tables)
    assert dict(uses(timeline)["/imu"].rejected) == {"not finite": 3}
    assert dict(uses(timeline)["/fix"].rejected) == {"not finite": 1}
    assert (len(timeline.imu), len(timeline.fixes)) == (197, 9)


def test_no_usable_sample_is_an_error(tmp_path):
    accel = np.full((200, 3), np.nan)
    with pytest.raises(LogError, match=r"/imu: none of its 200 samples is usable \(200 not finite\)"):
        load_tables(tmp_path, {"/imu": (IMU, imu_table(linear_acceleration=accel))})


def test_duplicate_stamps_are_rejected(tmp_path):
    t = stamps(200, 100)
    t[50] = t[49]
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table(**{"header.stamp": t}))})
    assert dict(uses(timeline)["/imu"].rejected) == {"time not increasing": 1}


def test_small_disorder_is_sorted_and_told(tmp_path):
    t = stamps(200, 100)
    t[[50, 51]] = t[[51, 50]]
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table(**{"header.stamp": t}))})
    assert len(timeline.imu) == 200
    assert any(
        "1 stamp was out of order by at most 0.01 s; the samples were sorted" in note
        for note in timeline.provenance.assumptions
    )


@pytest.mark.parametrize(("row", "jump_s"), [(50, -7200), (50, 7200)])
def test_a_lone_jump_costs_one_sample(tmp_path, row, jump_s):
    t = stamps(200, 100)
    t[row] += jump_s * 10**9
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table(**{"header.stamp": t}))})
    assert dict(uses(timeline)["/imu"].rejected) == {"time not increasing": 1}
    assert any("time jumps back" in note for note in timeline.provenance.assumptions)


def test_longest_increasing_run():
    np.testing.assert_array_equal(longest_increasing(np.array([1, 9, 2, 3, 3, 0, 4])), [0, 2, 3, 6])
    assert len(longest_increasing(np.empty(0, dtype=np.int64))) == 0


def test_stamps_of_1970_are_refused_with_the_way_out(tmp_path):
    table = imu_table(**{"header.stamp": np.arange(200) * 10**7})
    with pytest.raises(LogError, match=r"200 of 200 stamps lie before 1990.*stamp = 'log'"):
        load_tables(tmp_path, {"/imu": (IMU, table)})
    table = replace(table, log_time_ns=stamps(200, 100))
    assert len(load_tables(tmp_path, {"/imu": (IMU, table)}, {"imu": {"stamp": "log"}}).imu) == 200


def test_a_few_unset_stamps_are_rejected(tmp_path):
    t = stamps(200, 100)
    t[:3] = np.arange(3) * 10**7
    timeline = load_tables(tmp_path, {"/imu": (IMU, imu_table(**{"header.stamp": t}))})
    assert dict(uses(timeline)["/imu"].rejected) == {"stamp before 1990": 3}


def test_zero_negative_and_untyped_covariances_are_unknown(tmp_path):
    cov = np.tile(np.diag([1.0, 4.0, 9.0]).ravel(), (10, 1))
    kind = np.full(10, 3)
    cov[0], cov[1, 0], kind[2] = 0.0, -1.0, 0
    cov[3, 1] = cov[3, 3] = 5.0
    table = fix_table(position_covariance=cov, position_covariance_type=kind)
    timeline = load_tables(tmp_path, {"/fix": (FIX, table)})
    assert np.isnan(timeline.fixes.cov_pos[:, 0, 0]).tolist() == [True, True, True] + [False] * 7
    np.testing.assert_allclose(timeline.fixes.cov_pos[3], np.diag([4.0, 1.0, 9.0]))
    told = " ".join(timeline.provenance.assumptions)
    assert "1 of 10 rows have a zero on the diagonal" in told
    assert "1 of 10 rows have a negative variance" in told
    assert "1 of 10 rows have correlations beyond one" in told
    assert uses(timeline)["/fix"].used == 10


def test_status_of_fixes(tmp_path):
    status = np.array([-1, 0, 1, 2, 2, 2, 0, 0, 0, 0])
    cov = np.tile(np.diag([1.0, 1.0, 1.0]).ravel(), (10, 1)) * np.array([1, 1, 1, 1e-4, 0.25, 4, 1, 1, 1, 1])[:, None]
    table = fix_table(**{"status.status": status, "position_covariance": cov})
    timeline = load_tables(tmp_path, {"/fix": (FIX, table)})
    kinds = [FixStatus.SINGLE, FixStatus.DIFFERENTIAL, FixStatus.FIXED, FixStatus.FLOAT, FixStatus.DIFFERENTIAL]
    assert timeline.fixes.status[:5].tolist() == kinds
    assert dict(uses(timeline)["/fix"].rejected) == {"no fix": 1}
    strict = load_tables(tmp_path, {"/fix": (FIX, table)}, {"fix": {"min_status": "float"}})
    assert dict(uses(strict)["/fix"].rejected) == {"no fix": 1, "status below min_status": 7}


def test_impossible_positions_are_rejected(tmp_path):
    latitude, longitude = np.full(10, 40.0), np.full(10, -105.0)
    latitude[0], latitude[1], longitude[1] = 91.0, 0.0, 0.0
    timeline = load_tables(tmp_path, {"/fix": (FIX, fix_table(latitude=latitude, longitude=longitude))})
    assert dict(uses(timeline)["/fix"].rejected) == {"no such position": 1, "position 0, 0": 1}


def test_heights_above_mean_sea_level(tmp_path):
    settings = {"fix": {"height": "msl", "geoid_separation_m": -17.0}}
    timeline = load_tables(tmp_path, {"/fix": (FIX, fix_table())}, settings)
    np.testing.assert_allclose(timeline.fixes.lla[:, 2], 1583.0)
    with pytest.raises(ValueError, match="needs geoid_separation_m"):
        InputSettings.model_validate({"fix": {"height": "msl"}})


def twist(velocity, n=10, shift_ns=0):
    t = stamps(n, 1) + shift_ns
    return TWIST, Table(t, {"header.stamp": t, "twist.linear": np.tile(velocity, (n, 1))}, n)


@pytest.mark.parametrize(
    ("velocity", "words"), [((10.0, 0.0, 1.0), "east, north, up"), ((0.0, 10.0, -1.0), "north, east, down")]
)
def test_the_frame_of_velocities_is_recognised_by_the_motion(tmp_path, velocity, words):
    timeline = load_tables(tmp_path, {"/fix": (FIX, fix_table()), "/vel": twist(velocity, shift_ns=500_000)})
    assert len(timeline.fixes) == 10
    np.testing.assert_allclose(timeline.fixes.vel_n, np.tile([0.0, 10.0, -1.0], (10, 1)))
    assert any(f"recognised as {words}" in note for note in timeline.provenance.assumptions)


def test_velocities_between_the_fixes_become_rows_of_their_own(tmp_path):
    timeline = load_tables(tmp_path, {"/fix": (FIX, fix_table()), "/vel": twist((10.0, 0.0, 0.0), shift_ns=2_000_000)})
    assert len(timeline.fixes) == 20
    assert timeline.fixes.has_position.sum() == timeline.fixes.has_velocity.sum() == 10


def test_velocities_of_the_vehicle_frame_are_left_out_or_refused(tmp_path):
    tables = {"/fix": (FIX, fix_table()), "/vel": twist((-10.0, -10.0, 0.0))}
    timeline = load_tables(tmp_path, tables)
    assert not timeline.fixes.has_velocity.any()
    assert uses(timeline)["/vel"].role == "unused"
    assert any("neither ENU nor NED" in note for note in timeline.provenance.assumptions)
    with pytest.raises(LogError, match=r"/vel: .*set input\.fix\.velocity_frame"):
        load_tables(tmp_path, tables, {"fix": {"velocity_channel": "/vel"}})


def test_gps_fix_and_location_fix(tmp_path):
    columns = dict(fix_table().columns) | {"track": np.full(10, 90.0), "speed": np.full(10, 10.0), "climb": np.full(10, 1.0)}
    gps = load_tables(tmp_path, {"/gps": ("gps_common/msg/GPSFix", Table(stamps(10, 1), columns, 10))})
    np.testing.assert_allclose(gps.fixes.vel_n, np.tile([0.0, 10.0, -1.0], (10, 1)), atol=1e-12)
    columns = {name: column for name, column in fix_table().columns.items() if name not in ("header.stamp", "status.status")}
    table = Table(stamps(10, 1), columns | {"timestamp": stamps(10, 1)}, 10)
    location = load_tables(tmp_path, {"/loc": ("foxglove.LocationFix", table)})
    assert location.fixes.t_ns[0] == T0_GPS_NS
    assert set(location.fixes.status.tolist()) == {FixStatus.UNKNOWN}


def test_attitude_is_used_only_where_named_and_turned_to_ned(tmp_path):
    east = np.tile([0.0, 0.0, 0.0, 1.0], (10, 1))
    east[3] = 0.0
    table = Table(stamps(10, 1), {"header.stamp": stamps(10, 1), "quaternion": east}, 10)
    tables = {"/q": ("geometry_msgs/msg/QuaternionStamped", table), "/imu": (IMU, imu_table())}
    assert load_tables(tmp_path, tables).attitude is None
    timeline = load_tables(tmp_path, tables, {"attitude": {"channel": "/q"}})
    np.testing.assert_allclose(np.degrees(euler_from_quat(timeline.attitude.q[0])), [0, 0, 90], atol=1e-9)
    assert dict(uses(timeline)["/q"].rejected) == {"not finite or not a quaternion": 1}


def test_ambiguous_channels_are_listed_with_the_setting(tmp_path):
    tables = {"/a/imu": (IMU, imu_table()), "/b/imu": (IMU, imu_table())}
    with pytest.raises(LogError, match=r"2 channels can serve as imu: /a/imu .*; /b/imu .*--set input\.imu\.channel=/a/imu"):
        load_tables(tmp_path, tables)
    timeline = load_tables(tmp_path, tables, {"imu": {"channel": "/b/imu"}})
    assert [(use.name, use.role, use.read) for use in timeline.provenance.channels] == [
        ("/a/imu", "unused", 0),
        ("/b/imu", "imu", 200),
    ]


def test_a_wrong_topic_lists_those_there(tmp_path):
    tables = {"/imu": (IMU, imu_table()), "/fix": (FIX, fix_table())}
    with pytest.raises(LogError, match=r"has no channel /imu/data, which input\.imu\.channel names; there is /imu, /fix"):
        load_tables(tmp_path, tables, {"imu": {"channel": "/imu/data"}})
    with pytest.raises(
        LogError, match=r"/fix is sensor_msgs/msg/NavSatFix, which cannot serve as imu .*channels that can: /imu"
    ):
        load_tables(tmp_path, tables, {"imu": {"channel": "/fix"}})


def test_a_message_without_its_fields_is_named(tmp_path):
    table = Table(stamps(3, 1), {"header.stamp": stamps(3, 1)}, 3)
    with pytest.raises(LogError, match="/imu says it is sensor_msgs/msg/Imu but has no field angular_velocity"):
        load_tables(tmp_path, {"/imu": (IMU, table)})


def test_reference_from_fixes_and_by_status(tmp_path):
    status = np.array([0, 2] * 5)
    cov = np.tile(np.diag([1e-4, 1e-4, 1e-4]).ravel(), (10, 1))
    tables = {"/fix": (FIX, fix_table(**{"status.status": status, "position_covariance": cov}))}
    settings = {"reference": {"from_fixes": True, "status": ["fixed"]}, "fix": {"lever_arm_m": [1, 2, 3]}}
    timeline = load_tables(tmp_path, tables, settings)
    assert len(timeline.reference) == 5
    np.testing.assert_array_equal(timeline.reference_lever_b, [1, 2, 3])
    assert any("not an independent one" in note for note in timeline.provenance.assumptions)


def test_rows_beside_a_speed_jump_are_dropped_from_a_reference(tmp_path):
    longitude = fix_table().columns["longitude"].copy()
    longitude[4] += 0.01
    table = fix_table(longitude=longitude)
    settings = {"reference": {"channel": "/ref", "max_speed_jump_mps": 25.0}, "fix": {"channel": "none"}}
    timeline = load_tables(tmp_path, {"/ref": (FIX, table)}, settings)
    assert len(timeline.reference) == 7
    assert dict(uses(timeline)["/ref"].rejected) == {"beside a speed jump": 3}
