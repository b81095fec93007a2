"""ULog: as pyulog reads it, whole drives out of it, and damage that costs itself only."""

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyulog import ULog as Judge

from importers import LogError, load_timeline, open_log
from importers.autopilots.boot_clock import tie_clock
from importers.autopilots.ulog import ULOG_MAGIC, open_ulog
from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import FixStatus, Timeline

UTC_US = 1_700_000_000_000_000
BOOT_US = 5_000_000
DELAY_US = 110_000
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
FORMATS = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
    "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint8_t clipping;uint8_t[3] _padding0;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;"
    "int32_t alt_ellipsoid;float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "int32_t timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;uint8_t[2] _padding0;",
    "sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;double altitude_msl_m;"
    "double altitude_ellipsoid_m;float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "uint8_t fix_type;bool vel_ned_valid;uint8_t[6] _padding0;",
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;uint8_t[4] _padding0;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float vz;uint8_t[4] _padding0;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "esc": "uint64_t timestamp;cell[2] cells;uint8_t number;",
    "cell": "float volt;int16_t amps;",
}
PACKED = {
    "sensor_combined": "<Q3fIi3fB",
    "vehicle_gps_position": "<QQiiii6fiB?",
    "sensor_gps": "<QQdddd6fB?",
    "vehicle_global_position": "<Qddf",
    "vehicle_local_position": "<Q3f",
    "vehicle_attitude": "<Q4f",
    "esc": "<QfhfhB",
}


def message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content


def ulog(data: Iterable[tuple[str, Sequence[float]]], topics: Sequence[str], instances: Sequence[int] | None = None) -> bytes:
    """A log with subscriptions of topics and their messages in the order given."""
    parts = [ULOG_MAGIC + b"\x01" + struct.pack("<Q", BOOT_US), message("B", bytes(40))]
    parts += [message("F", f"{name}:{fields}".encode()) for name, fields in FORMATS.items()]
    numbers = instances or [0] * len(topics)
    subscribed = enumerate(zip(numbers, topics, strict=True))
    parts += [message("A", struct.pack("<BH", instance, number) + name.encode()) for number, (instance, name) in subscribed]
    for count, (name, values) in enumerate(data):
        parts.append(message("D", struct.pack("<H", topics.index(name)) + struct.pack(PACKED[name], *values)))
        if count % 50 == 49:
            parts.append(message("S", SYNC))
    return b"".join(parts)


def drive(seconds: int = 20, gps: str = "vehicle_gps_position") -> list[tuple[str, Sequence[float]]]:
    """IMU at 100 Hz, fixes at 5 Hz that arrive 0.11 s late, the filter's own solution at 10 Hz; a clock 20 ppm fast."""
    messages: list[tuple[float, str, Sequence[float]]] = []

    def boot(t: float) -> int:
        return BOOT_US + round(t * 1e6 * (1 + 20e-6))

    for t in np.arange(seconds * 100) / 100:
        values = (boot(t), 0.01, 0.02, 0.1 * np.sin(t), 10_000, 0, 0.3, 0.0, -9.81, 0)
        messages.append((t, "sensor_combined", values))
    for t in np.arange(seconds * 5) / 5:
        lat, lon = 47.0 + 2 * t / 111_200, 8.0
        stamps = (boot(t + DELAY_US / 1e6 + 0.02 * np.sin(40 * t) ** 2), UTC_US + round(t * 1e6))
        accuracies = (0.3, 0.8, 1.2, 2.0, 0.0, 0.1)
        old = (*stamps, round(lat * 1e7), round(lon * 1e7), 450_000, 497_500, *accuracies, 0, 3, True)
        new = (*stamps, lat, lon, 450.0, 497.5, *accuracies, 3, True)
        messages.append((t + 0.13, gps, old if gps == "vehicle_gps_position" else new))
    for t in np.arange(seconds * 10) / 10 + 0.013:
        messages.append((t, "vehicle_global_position", (boot(t), 47.0 + 2 * t / 111_200, 8.0, 450.0)))
        messages.append((t, "vehicle_local_position", (boot(t), 2.0, 0.0, 0.1)))
        messages.append((t, "vehicle_attitude", (boot(t) + 3000, 1.0, 0.0, 0.0, 0.0)))
    return [(name, values) for _, name, values in sorted(messages, key=lambda part: part[0])]


ALL = ("sensor_combined", "vehicle_gps_position", "vehicle_global_position", "vehicle_local_position", "vehicle_attitude")


def load(path: Path, content: bytes) -> Timeline:
    path.write_bytes(content)
    return load_timeline([path])


def test_every_topic_is_what_pyulog_reads(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog([*drive(2), ("esc", (1, 3.5, -2, 4.5, 7, 9))], (*ALL, "esc")))
    own, judge = open_ulog(str(path)), Judge(str(path))
    assert len(judge.data_list) == len(own.topics) == 6
    assert own.lost == 0
    for topic in judge.data_list:
        rows = own.records(own.topics[topic.name, topic.multi_id])
        for name, values in topic.data.items():
            column = rows
            for part in name.replace("]", "").replace("[", ".").split("."):
                column = column[:, int(part)] if part.isdigit() else column[part]
            assert np.array_equal(column, values), (topic.name, name)


@pytest.mark.parametrize("gps", ["vehicle_gps_position", "sensor_gps"])
def test_a_flight_is_a_whole_drive(tmp_path: Path, gps: str) -> None:
    timeline = load(tmp_path / "a.ulg", ulog(drive(gps=gps), (ALL[0], gps, *ALL[2:])))
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert timeline.reference is not None
    start = int(gps_from_utc(np.array([UTC_US * 1000]))[0])
    late = (timeline.imu.t_ns - start) / 1e9 - np.arange(2000) / 100
    assert np.abs(late + DELAY_US / 1e6).max() < 0.005  # the least delay remains, the rate of the clock does not
    assert timeline.imu.increments
    np.testing.assert_allclose(timeline.imu.accel[0], [0.3, 0.0, -9.81], rtol=1e-6)
    assert timeline.fixes.t_ns.tolist() == (start + np.arange(100) * 200_000_000).tolist()
    np.testing.assert_allclose(np.degrees(timeline.fixes.lla[0, :2]), [47.0, 8.0], atol=1e-7)
    assert timeline.fixes.lla[0, 2] == pytest.approx(497.5)
    np.testing.assert_allclose(np.sqrt(np.diagonal(timeline.fixes.cov_pos[0])), [0.8, 0.8, 1.2], rtol=1e-6)
    assert set(timeline.fixes.status.tolist()) == {FixStatus.SINGLE}
    np.testing.assert_allclose(timeline.reference.lla[:, 2], 497.5)
    np.testing.assert_allclose(timeline.reference.vel_n, np.tile([2.0, 0.0, 0.1], (200, 1)), rtol=1e-6)
    assert np.isfinite(timeline.reference.q_nb).all()
    assert any("its own filter" in note or "own filter serves" in note for note in timeline.provenance.assumptions)


def test_a_second_receiver_serves_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.ulg").write_bytes(ulog(drive(2, "sensor_gps"), (ALL[0], "sensor_gps", *ALL[2:]), [0, 1, 0, 0, 0]))
    log = open_log(tmp_path / "a.ulg")
    assert [channel.name for channel in log.channels()][:1] == ["sensor_combined"]
    assert ("sensor_gps_1", "ulog/sensor_gps/spare") in [(channel.name, channel.type) for channel in log.channels()]


def test_damage_is_left_behind_at_the_next_sync_message(tmp_path: Path) -> None:
    content = ulog(drive(20), ALL)
    place = content.index(message("S", SYNC)) + 300
    timeline = load(tmp_path / "a.ulg", content[:place] + b"\xff" * 40 + content[place + 17 :])
    assert timeline.imu is not None
    assert 1850 < len(timeline.imu) < 2000
    assert any("bytes are no messages" in note for note in timeline.provenance.damage)


def test_data_appended_after_a_crash_are_read(tmp_path: Path) -> None:
    head, tail = ulog(drive(4), ALL), ulog(drive(6), ALL)
    crash = head + b"\x40\x00D\x00\x00half of a mess"
    data_of_tail = tail[tail.index(message("A", struct.pack("<BH", 0, 0) + ALL[0].encode())) :]
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<QQQ", len(crash), 0, 0)
    whole = crash[:16] + message("B", flags) + crash[16 + 43 :] + data_of_tail
    path = tmp_path / "a.ulg"
    path.write_bytes(whole)
    log = open_ulog(str(path))
    assert len(log.topics["sensor_combined", 0].start) == 1000


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (ULOG_MAGIC + b"\x01" + bytes(3000), "holds none of the topics that are read"),
        (ulog([], ALL), "holds none of the topics that are read"),
        (ulog([part for part in drive(2) if part[0] == "sensor_combined"], ALL), "no fix of the log tells the date"),
        (ULOG_MAGIC + b"\x01" + bytes(8) + message("B", bytes(8) + b"\x02" + bytes(31)), "of a version that is not known here"),
        (ulog(drive(2), ALL).replace(b"float[3] gyro_rad", b"float[3] gyro_raw"), "is defined without gyro_rad"),
    ],
)
def test_logs_that_cannot_be_used_say_why(tmp_path: Path, content: bytes, words: str) -> None:
    with pytest.raises(LogError, match=words) as caught:
        load(tmp_path / "a.ulg", content)
    assert "\n" not in str(caught.value)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 8000), cut=st.integers(0, 60), put=st.binary(max_size=20))
def test_no_damage_raises_anything_but_one_line(tmp_path: Path, place: int, cut: int, put: bytes) -> None:
    content = ulog(drive(2), ALL)
    said = ""
    try:
        load(tmp_path / "a.ulg", content[:place] + put + content[place + cut :])
    except LogError as error:
        said = str(error)
    assert "\n" not in said


def test_a_clock_is_tied_by_the_least_delay_whatever_its_rate() -> None:
    rng = np.random.default_rng(3)
    gps = np.arange(600) * 200_000_000 + 10**18
    true = (gps - 10**18) * (1 + 35e-6) + 4e9
    clock = tie_clock("log", (true + 0.1e9 + rng.exponential(0.02e9, 600)).astype(np.int64), gps)
    off = (clock.gps_ns(true.astype(np.int64)) - gps) / 1e9
    assert np.abs(off + 0.1).max() < 0.02
    with pytest.raises(LogError, match="cannot be set"):
        tie_clock("log", gps[:0], gps[:0])
