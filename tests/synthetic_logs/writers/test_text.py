"""Written logs, read back by the formats' own libraries: the same values to the last bit the format can hold."""

import csv
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import FixStatus, LogError
from synthetic_logs import FORMATS, SCENARIOS, simulate, with_duration, write

LOG = simulate(with_duration(SCENARIOS["car-short"], 12.0), 5)
RANGES = simulate(with_duration(SCENARIOS["ranges-open"], 5.0), 5)
WITHOUT_VELOCITY = simulate(with_duration(SCENARIOS["aircraft-spiral"], 5.0), 5)
FLU = np.array([1.0, -1.0, -1.0])
TOPICS = {
    "/imu/data": "sensor_msgs/msg/Imu",
    "/gnss/fix": "sensor_msgs/msg/NavSatFix",
    "/gnss/vel": "geometry_msgs/msg/TwistStamped",
}


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def stamp_ns(header):
    fraction = header.stamp.nanosec if hasattr(header.stamp, "nanosec") else header.stamp.nsec
    return header.stamp.sec * 1_000_000_000 + fraction


def read_mcap(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [(m.schema.name, m.channel.topic, m.message.log_time, m.decoded_message) for m in reader.iter_decoded_messages()]


def read_bag(reader, decode):
    with reader:
        return [(c.msgtype, c.topic, t_ns, decode(data, c.msgtype)) for c, t_ns, data in reader.messages()]


def read_back(path):
    if path.suffix == ".mcap":
        return read_mcap(path)
    if path.suffix == ".bag":
        return read_bag(rosbag1.Reader(path), get_typestore(Stores.ROS1_NOETIC).deserialize_ros1)
    return read_bag(rosbag2.Reader(path), get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr)


@pytest.mark.parametrize("name", ["log.mcap", "log.bag", "log"])
def test_ros_files_hold_every_value_exactly(tmp_path, name):
    path = write(LOG, tmp_path / name)[0]
    messages = read_back(path)
    times = [t_ns for _, _, t_ns, _ in messages]
    assert times == sorted(times)
    assert {topic: type_ for type_, topic, _, _ in messages} == TOPICS
    assert all(stamp_ns(message.header) == t_ns for _, _, t_ns, message in messages)
    by_topic = {topic: [m for _, t, _, m in messages if t == topic] for topic in TOPICS}
    check_imu(by_topic["/imu/data"])
    check_fixes(by_topic["/gnss/fix"])
    check_velocities(by_topic["/gnss/vel"])


def check_stamps(messages, t_ns):
    np.testing.assert_array_equal(gps_from_utc(np.array([stamp_ns(m.header) for m in messages])), t_ns)


def check_imu(messages):
    check_stamps(messages, LOG.imu.t_ns)
    np.testing.assert_array_equal([xyz(m.angular_velocity) for m in messages], LOG.imu.gyro * FLU)
    np.testing.assert_array_equal([xyz(m.linear_acceleration) for m in messages], LOG.imu.accel * FLU)
    assert messages[0].linear_acceleration.z > 9
    assert messages[0].header.frame_id == "imu"
    assert messages[0].orientation_covariance[0] == -1
    assert messages[0].orientation.w == 1


def check_fixes(messages):
    check_stamps(messages, LOG.fixes.t_ns)
    lla = np.array([[m.latitude, m.longitude, m.altitude] for m in messages])
    np.testing.assert_array_equal(lla[:, :2], np.degrees(LOG.fixes.lla[:, :2]))
    np.testing.assert_array_equal(lla[:, 2], LOG.fixes.lla[:, 2])
    covariance = np.array([m.position_covariance for m in messages]).reshape(-1, 3, 3)
    np.testing.assert_array_equal(covariance, np.tile(np.diag([2.25, 2.25, 6.25]), (len(messages), 1, 1)))
    assert {m.position_covariance_type for m in messages} == {2 + 1}
    assert {(m.status.status, m.status.service) for m in messages} == {(0, 1)}
    assert messages[0].header.frame_id == "gnss"


def check_velocities(messages):
    check_stamps(messages, LOG.fixes.t_ns)
    east_north_up = LOG.fixes.vel_n[:, [1, 0, 2]] * [1, 1, -1]
    np.testing.assert_array_equal([xyz(m.twist.linear) for m in messages], east_north_up)
    np.testing.assert_array_equal([xyz(m.twist.angular) for m in messages], 0)


def test_mcap_is_compressed_indexed_and_the_same_each_time(tmp_path):
    first, second = write(LOG, tmp_path / "a.mcap")[0], write(LOG, tmp_path / "b.mcap")[0]
    assert first.read_bytes() == second.read_bytes()
    with first.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    assert summary.statistics.message_count == len(LOG.imu) + 2 * len(LOG.fixes)


def test_bare_sqlite_file_holds_the_rows_of_the_one_in_the_directory(tmp_path):
    directory = write(LOG, tmp_path / "bag")[0]
    bare = write(LOG, tmp_path / "bare.db3")[0]
    assert bare.is_file()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag", "bag.truth.csv", "bare.db3", "bare.truth.csv"]
    assert sqlite_rows(bare) == sqlite_rows(directory / "bag.db3")
    assert len(sqlite_rows(bare)[1]) == len(LOG.imu) + 2 * len(LOG.fixes)


def sqlite_rows(path):
    with closing(sqlite3.connect(path)) as database:
        topics = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
        return topics, database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id").fetchall()


def test_log_without_velocity_has_no_velocity_topic(tmp_path):
    messages = read_back(write(WITHOUT_VELOCITY, tmp_path / "log.mcap")[0])
    assert {topic for _, topic, _, _ in messages} == {"/imu/data", "/gnss/fix"}


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (FixStatus.SINGLE, 0),
        (FixStatus.DIFFERENTIAL, 1),
        (FixStatus.FLOAT, 2),
        (FixStatus.FIXED, 2),
        (FixStatus.DEAD_RECKONING, 0),
    ],
)
def test_fix_status_maps_to_what_navsatfix_knows(tmp_path, status, expected):
    scenario = with_duration(SCENARIOS["static"], 2.0)
    log = simulate(replace(scenario, gnss=replace(scenario.gnss, status=status)), 1)
    messages = read_back(write(log, tmp_path / "log.mcap")[0])
    assert {m.status.status for type_, _, _, m in messages if type_.endswith("NavSatFix")} == {expected}


def read_columns(path):
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    return {name: column for name, *column in zip(*rows, strict=True)}


def numbers(columns, names):
    return np.array([[float(text) if text else np.nan for text in columns[name]] for name in names]).T


def test_csv_holds_every_value_exactly(tmp_path):
    imu_path, fix_path, truth_path = write(LOG, tmp_path / "log.csv")
    assert [p.name for p in (imu_path, fix_path, truth_path)] == ["log.imu.csv", "log.fix.csv", "log.truth.csv"]
    imu = read_columns(imu_path)
    assert list(imu)[:2] == ["t_gps_ns", "gyro_x_radps"]
    assert [int(text) for text in imu["t_gps_ns"]] == LOG.imu.t_ns.tolist()
    np.testing.assert_array_equal(numbers(imu, [f"gyro_{a}_radps" for a in "xyz"]), LOG.imu.gyro)
    np.testing.assert_array_equal(numbers(imu, [f"accel_{a}_mps2" for a in "xyz"]), LOG.imu.accel)
    fix = read_columns(fix_path)
    assert [int(text) for text in fix["t_gps_ns"]] == LOG.fixes.t_ns.tolist()
    np.testing.assert_array_equal(numbers(fix, ["lat_deg", "lon_deg"]), np.degrees(LOG.fixes.lla[:, :2]))
    np.testing.assert_array_equal(numbers(fix, ["height_m"])[:, 0], LOG.fixes.lla[:, 2])
    np.testing.assert_array_equal(numbers(fix, [f"vel_{a}_mps" for a in "ned"]), LOG.fixes.vel_n)
    np.testing.assert_array_equal(numbers(fix, [f"std_{a}_m" for a in "ned"]), np.tile([1.5, 1.5, 2.5], (len(LOG.fixes), 1)))
    assert set(fix["status"]) == {"SINGLE"}


def test_truth_beside_every_log(tmp_path):
    _, truth_path = write(LOG, tmp_path / "log.mcap")
    truth = read_columns(truth_path)
    assert [int(text) for text in truth["t_gps_ns"]] == LOG.truth.t_ns.tolist()
    np.testing.assert_array_equal(numbers(truth, ["lat_deg", "lon_deg"]), np.degrees(LOG.truth.lla[:, :2]))
    np.testing.assert_array_equal(numbers(truth, [f"vel_{a}_mps" for a in "ned"]), LOG.truth.vel_n)
    np.testing.assert_array_equal(numbers(truth, [f"q_nb_{a}" for a in "wxyz"]), LOG.truth.q_nb)
    assert set(truth["std_n_m"]) == {""}


def test_csv_marks_means_and_leaves_unknown_velocity_empty(tmp_path):
    imu_path, fix_path, _ = write(WITHOUT_VELOCITY, tmp_path / "log.csv")
    assert list(read_columns(imu_path))[1:] == [f"mean_gyro_{a}_radps" for a in "xyz"] + [f"mean_accel_{a}_mps2" for a in "xyz"]
    fix = read_columns(fix_path)
    assert set(fix["vel_n_mps"]) == set(fix["std_vd_mps"]) == {""}
    assert set(fix["std_n_m"]) == {"5"}


@pytest.mark.parametrize("suffix", FORMATS)
def test_nothing_is_overwritten(tmp_path, suffix):
    log = RANGES if suffix == ".obs" else LOG
    write(log, tmp_path / f"log{suffix}")
    with pytest.raises(LogError, match=r"exists already; .*choose another name|exists already; remove this folder"):
        write(log, tmp_path / f"log{suffix}")


def test_paths_that_cannot_be_written_are_refused_in_one_line(tmp_path):
    with pytest.raises(
        LogError, match=r"no format has the extension '.xyz'; use one of .mcap, .bag, .db3, .csv, .obs, or none"
    ):
        write(LOG, tmp_path / "log.xyz")
    (tmp_path / "file").touch()
    with pytest.raises(LogError, match="cannot be written"):
        write(LOG, tmp_path / "file" / "log.mcap")


@pytest.mark.parametrize("name", ["log.mcap", "log.bag", "log.db3", "log.csv"])
def test_files_are_overwritten_only_by_force(tmp_path, name):
    paths = write(LOG, tmp_path / name)
    with pytest.raises(LogError, match="exists already"):
        write(LOG, tmp_path / name)
    paths[0].write_bytes(b"old")
    assert write(LOG, tmp_path / name, force=True) == paths
    assert paths[0].stat().st_size > 1000


def test_a_folder_is_never_overwritten(tmp_path):
    (tmp_path / "home").mkdir()
    with pytest.raises(LogError, match="remove this folder"):
        write(LOG, tmp_path / "home", force=True)
