"""u-blox streams and ROS messages of u-blox receivers: the same measurements, and damage that costs itself only."""

import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from importers import InputSettings, LogError, load_timeline
from importers.broadcast.glonass import decode_strings
from importers.broadcast.gps import decode_lnav
from importers.ublox.measurements import RAWX_BLOCK, measurement_columns
from importers.ublox.stream import UbxLog, is_ubx
from navreplay.geodesy.earth import lla_from_ecef
from navreplay.geodesy.time_scales import LEAP_SECONDS, gps_from_utc
from navreplay.measurements.least_squares import solve_points
from navreplay.options import RangeOptions
from navreplay.timeline import RangeSeries
from tests.helpers.paths import DATA

SAMPLE = DATA / "walk_0827.ubx"
RECEIVER_DEG_M = (40.0967, -105.1471, 1580.0)
"""What the receiver itself says in the sample's NAV-PVT."""


def ranges_of(path: Path) -> RangeSeries:
    ranges = load_timeline([path]).ranges
    assert ranges is not None
    return ranges


def test_the_stream_alone_gives_positions() -> None:
    timeline = load_timeline([SAMPLE])
    assert timeline.ranges is not None
    points = solve_points(timeline.ranges, RangeOptions())[0]
    assert points.solved.all()
    lla = lla_from_ecef(points.pos_e)
    off_m = (np.degrees(lla[:, :2]) - RECEIVER_DEG_M[:2]) * [111e3, 85e3]
    # The receiver's own position hangs on its base station, which stands some metres off (docs/ranges.md).
    assert np.abs(np.median(off_m, axis=0)).max() < 10
    assert abs(np.median(lla[:, 2]) - RECEIVER_DEG_M[2]) < 15


def test_measurements_are_counted_and_one_signal_is_used() -> None:
    timeline = load_timeline([SAMPLE])
    ranges, (use, words) = timeline.ranges, timeline.provenance.channels
    assert ranges is not None
    assert (use.read, use.used) == (558, 118)
    assert use.rejected == {
        "system not in input.range.systems": 22,
        "signal not in input.range.signals": 374,
        "no ephemeris": 31,
        "satellite unhealthy": 13,
    }
    assert (words.role, words.read, words.used) == ("ephemeris", 621, 621)
    assert set(ranges.signal) == {"1C", "1P"}
    assert np.isfinite(ranges.range_rate).all()
    assert (ranges.pseudorange_std > 0).all()
    other = load_timeline([SAMPLE], InputSettings.model_validate({"range": {"signals": {"G": ["5Q", "5I"]}, "systems": ["G"]}}))
    assert other.ranges is not None
    assert set(other.ranges.signal) <= {"5Q", "5I"}


def test_fields_of_a_measurement() -> None:
    rows = np.zeros(4, RAWX_BLOCK)
    rows["prMes"], rows["doMes"], rows["cno"], rows["trkStat"] = 2.1e7, -1000.0, 45, [1, 1, 1, 0]
    rows["gnssId"], rows["svId"], rows["sigId"], rows["freqId"] = [0, 6, 1, 3], [5, 3, 133, 11], [0, 0, 0, 1], [0, 8, 0, 0]
    rows["prStdev"], rows["doStdev"] = 0x15, 3
    columns = measurement_columns(np.zeros(4, dtype=np.int64), rows)
    assert columns["sat"].tolist() == ["G05", "R03", "S33", "C11"]
    assert columns["signal"].tolist() == ["1C", "1C", "", "2I"]
    assert columns["range_rate"][0] == pytest.approx(1000 * 299_792_458.0 / 1575.42e6, rel=1e-12)
    assert columns["range_rate"][1] == pytest.approx(1000 * 299_792_458.0 / 1602.5625e6, rel=1e-12)
    assert columns["pseudorange_std"][0] == 0.32
    assert np.isnan(columns["pseudorange"]).tolist() == [False, False, False, True]


def test_noise_between_messages_costs_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.ubx"
    path.write_bytes(b"$GNGGA,1*00\r\n\xb5\x62\x02" + SAMPLE.read_bytes() + b"\xb5\x62\x02\x15")
    assert len(ranges_of(path)) == len(ranges_of(SAMPLE))


def test_a_cut_stream_and_a_wrong_checksum_are_told(tmp_path: Path) -> None:
    data = bytearray(SAMPLE.read_bytes())
    start = data.index(b"\xb5\x62\x02\x15")
    data[start + 40] ^= 1
    path = tmp_path / "a.ubx"
    path.write_bytes(bytes(data[: data.rindex(b"\xb5\x62\x02") + 20]))
    timeline = load_timeline([path])
    assert timeline.provenance.channels[0].rejected["checksum wrong"] == 1
    assert any("ends within a message" in note for note in timeline.provenance.damage)


def test_a_stream_without_navigation_data_asks_for_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.ubx"
    data = SAMPLE.read_bytes()
    start = data.index(b"\xb5\x62\x02\x15")
    length = struct.unpack("<H", data[start + 4 : start + 6])[0] + 8
    path.write_bytes(data[start : start + length])
    assert is_ubx(path.read_bytes())
    with pytest.raises(LogError, match=r"no ephemeris \d+; add the navigation file"):
        load_timeline([path])


def test_weeks_of_gps_are_those_near_the_log() -> None:
    table = UbxLog(str(SAMPLE)).read(("RXM-SFRBX",))["RXM-SFRBX"]
    gps = table.columns["gnssId"] == 0
    number, words = table.columns["svId"][gps].astype(np.int64), table.columns["dwrd"][gps]
    near_ns = int(table.log_time_ns[0])
    now, _, _ = decode_lnav("G", number, words, near_ns)
    before, _, _ = decode_lnav("G", number, words, near_ns - 1024 * 604_800 * 10**9)
    assert (now["toe_ns"] - before["toe_ns"] == 1024 * 604_800 * 10**9).all()
    assert (np.abs(now["toe_ns"] - near_ns) < 2 * 3600 * 10**9).all()


def glonass_string(fields: list[tuple[int, int]]) -> list[int]:
    """Words of a string from its fields (value, width); negative values as sign and magnitude."""
    bits = "0" + "".join(
        f"{'1' if value < 0 else '0'}{abs(value):0{width - 1}b}" if value < 0 else f"{value:0{width}b}"
        for value, width in fields
    )
    bits = bits.ljust(96, "0")
    return [int(bits[i : i + 32], 2) for i in (0, 32, 64)]


def test_glonass_strings_give_state_clock_and_time() -> None:
    day = 1 + (np.datetime64("2021-04-12") - np.datetime64("2020-01-01")).astype(int)
    x = [(-614_400, 24), (-3, 5), (17_612_800, 27)]
    y = [(1_677_721, 24), (2, 5), (-41_984_000, 27)]
    z = [(3_219_000, 24), (0, 5), (25_395_200, 27)]
    strings = [
        glonass_string([(1, 4), (0, 2), (0, 2), (0, 12), *x]),
        glonass_string([(2, 4), (0, 3), (0, 1), (45, 7), (0, 5), *y]),
        glonass_string([(3, 4), (0, 1), (-2, 11), (0, 1), (0, 2), (0, 1), *z]),
        glonass_string([(4, 4), (36_507, 22), (0, 5), (0, 5), (0, 14), (0, 1), (0, 4), (0, 3), (int(day), 11), (5, 5), (1, 2)]),
    ]
    words = np.zeros((4, 10), dtype=np.int64)
    words[:, :3] = strings
    near_ns = int(gps_from_utc(np.array([1_618_218_000 * 10**9]))[0])
    records, good = decode_strings(np.full(4, 5), np.full(4, -3), words, near_ns, LEAP_SECONDS)
    assert good.all()
    (record,) = records
    assert record["sat"] == "R05"
    assert record["pos"].tolist() == [17_612_800 / 2**11 * 1e3, -41_984_000 / 2**11 * 1e3, 25_395_200 / 2**11 * 1e3]
    assert record["vel"].tolist() == [-614_400 / 2**20 * 1e3, 1_677_721 / 2**20 * 1e3, 3_219_000 / 2**20 * 1e3]
    assert record["acc"].tolist() == [-3 / 2**30 * 1e3, 2 / 2**30 * 1e3, 0]
    assert (record["tau"], record["gamma"]) == (36_507 / 2**30, -2 / 2**40)
    utc = np.datetime64("2021-04-12T11:15:00") - np.timedelta64(3, "h")
    assert record["toe_ns"] == gps_from_utc(np.array([utc.astype("datetime64[ns]").astype(np.int64)]))[0]
    lost = np.delete(np.arange(4), 2)
    assert len(decode_strings(np.full(3, 5), np.zeros(3), words[lost], near_ns, LEAP_SECONDS)[0]) == 0


NEW = {
    "ublox_msgs/msg/RxmRAWXMeas": "float64 pr_mes\nfloat64 cp_mes\nfloat32 do_mes\nuint8 gnss_id\nuint8 sv_id\n"
    "uint8 reserved0\nuint8 freq_id\nuint16 locktime\nint8 cno\nuint8 pr_stdev\nuint8 cp_stdev\nuint8 do_stdev\n"
    "uint8 trk_stat\nuint8 reserved1\n",
    "ublox_msgs/msg/RxmRAWX": "float64 rcv_tow\nuint16 week\nint8 leap_s\nuint8 num_meas\nuint8 rec_stat\nuint8 version\n"
    "uint8[2] reserved1\nRxmRAWXMeas[] meas\n",
    "ublox_msgs/msg/RxmSFRBX": "uint8 gnss_id\nuint8 sv_id\nuint8 reserved0\nuint8 freq_id\nuint8 num_words\nuint8 chn\n"
    "uint8 version\nuint8 reserved1\nuint32[] dwrd\n",
}
"""ublox_msgs of ROS 2."""
OLD = {
    "ublox_msgs/msg/RxmRAWX_Meas": "float64 prMes\nfloat64 cpMes\nfloat32 doMes\nuint8 gnssId\nuint8 svId\nuint8 reserved0\n"
    "uint8 freqId\nuint16 locktime\nint8 cno\nuint8 prStdev\nuint8 cpStdev\nuint8 doStdev\nuint8 trkStat\nuint8 reserved1\n",
    "ublox_msgs/msg/RxmRAWX": "float64 rcvTOW\nuint16 week\nint8 leapS\nuint8 numMeas\nuint8 recStat\nuint8 version\n"
    "uint8[2] reserved1\nRxmRAWX_Meas[] meas\n",
    "ublox_msgs/msg/RxmSFRBX": "uint8 gnssId\nuint8 svId\nuint8 reserved0\nuint8 freqId\nuint8 numWords\nuint8 chn\n"
    "uint8 version\nuint8 reserved1\nuint32[] dwrd\n",
}
"""ublox_msgs of ROS 1."""


def frames_of(path: Path) -> list[tuple[int, bytes]]:
    data, place, frames = path.read_bytes(), 0, []
    while place < len(data):
        length = struct.unpack("<H", data[place + 4 : place + 6])[0]
        frames.append((data[place + 3], data[place + 6 : place + 6 + length]))
        place += 8 + length
    return frames


def as_ros(store: Any, names: dict[str, str], kind: int, payload: bytes) -> tuple[str, Any]:
    """Topic and message of a frame."""
    if kind == 0x13:
        words = np.frombuffer(payload[8:], dtype="<u4")
        return "/sfrbx", store.types["ublox_msgs/msg/RxmSFRBX"](*payload[:8], words)
    head = struct.unpack("<dHbBBB2s", payload[:16])
    block = store.types[next(name for name in names if "Meas" in name)]
    meas = [block(*values) for values in struct.iter_unpack("<ddfBBBBHbBBBBB", payload[16:])]
    return "/rawx", store.types["ublox_msgs/msg/RxmRAWX"](*head[:6], np.frombuffer(head[6], np.uint8), meas)


@pytest.mark.parametrize("ros", [1, 2, "2 without definitions"])
def test_ros_messages_hold_the_same(tmp_path: Path, ros: int | str) -> None:
    names, base = (OLD, Stores.ROS1_NOETIC) if ros == 1 else (NEW, Stores.ROS2_HUMBLE)
    store = get_typestore(base)
    types: dict[str, Any] = {}
    for name, text in names.items():
        types |= get_types_from_msg(text, name)
    store.register(types)
    path = tmp_path / ("a.bag" if ros == 1 else "bag")
    writer = Ros1Writer(path) if ros == 1 else Ros2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    with writer:
        connections: dict[str, Any] = {}
        for i, (kind, payload) in enumerate(frames_of(SAMPLE)):
            topic, message = as_ros(store, names, kind, payload)
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(connections[topic], 1_756_402_239 * 10**9 + i, serialize(message, message.__msgtype__))
    if ros == "2 without definitions":
        (file,) = path.glob("*.db3")
        with closing(sqlite3.connect(file)) as database, database:
            assert database.execute("DELETE FROM message_definitions").rowcount >= 2
    ranges, stream = ranges_of(path), ranges_of(SAMPLE)
    for column in ("t_ns", "sat", "signal", "pseudorange", "range_rate", "cn0", "pseudorange_std", "sat_pos_e", "sat_vel_e"):
        assert np.array_equal(getattr(ranges, column), getattr(stream, column)), column
