"""MCAP: encodings, compressions, missing index, damage, and what the user is told."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from foxglove.messages import LocationFix, Pose, PoseInFrame, Quaternion, Timestamp, Vector3
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

from importers.containers.mcap import McapLog
from importers.containers.record_scan import scan_mcap
from importers.rows.log import Channel
from navreplay.timeline import LogError
from tests.helpers.log_samples import IMU, ROS1, ROS2, START_NS, assert_imus, imu_rows, raw_imus, write_mcap

COUNT = 500
NO_INDEX = {
    "index_types": IndexType.NONE,
    "use_statistics": False,
    "use_summary_offsets": False,
    "repeat_channels": False,
    "repeat_schemas": False,
}


def chunk_extents(path: Path) -> list[tuple[int, int]]:
    """Extent of the content of each chunk record."""
    opcode, start, stop, _ = scan_mcap(np.frombuffer(path.read_bytes(), dtype=np.uint8), 8)
    return [(int(a), int(b)) for op, a, b in zip(opcode, start, stop, strict=True) if op == Opcode.CHUNK]


def flip(path: Path, offset: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset] ^= 0x10
    path.write_bytes(content)


@pytest.mark.parametrize("options", [{}, NO_INDEX, {"use_chunking": False}, {**NO_INDEX, "use_chunking": False}], ids=str)
@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_ros_messages(tmp_path: Path, encoding: str, compression: CompressionType, options: dict) -> None:
    store = ROS1 if encoding == "ros1" else ROS2
    path = write_mcap(tmp_path / "log.mcap", raw_imus(store, COUNT), encoding, compression, **options)
    log = McapLog(str(path))
    assert log.channels() == (Channel("/imu", IMU, encoding, COUNT),)
    table = log.read(("/imu",))["/imu"]
    assert (table.read, table.rejected) == (COUNT, {})
    assert_imus(table, COUNT)
    assert log.notes == (), "the file was closed, with or without an index"


@pytest.mark.parametrize("options", [{"repeat_schemas": False}, {"repeat_channels": False}], ids=str)
def test_summary_that_repeats_not_all_is_completed_by_reading(tmp_path: Path, options: dict) -> None:
    log = McapLog(str(write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), **options)))
    assert log.channels() == (Channel("/imu", IMU, "cdr", COUNT),)
    assert_imus(log.read(("/imu",))["/imu"], COUNT)


def test_broken_record_in_a_chunk_without_checksum(tmp_path: Path) -> None:
    options = {"compression": CompressionType.NONE, "enable_crcs": False}
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), **options)
    (start, stop) = chunk_extents(path)[1]
    head = path.read_bytes().index(b"imu_link", (start + stop) // 2) - 16 - 22 - 9
    content = bytearray(path.read_bytes())
    assert content[head] == Opcode.MESSAGE
    content[head + 8] = 0xFF
    path.write_bytes(content)
    log = McapLog(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == COUNT
    assert 20 < table.rejected["lost to damage in the file"] < 40
    assert any("is damaged inside" in note for note in log.notes)


def test_schema_without_text_takes_the_standard_type(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "cdr", writer.register_schema(IMU, "ros2msg", b""))
        for t_ns, raw in raw_imus(ROS2, 20):
            writer.add_message(channel, t_ns + 1, raw, t_ns)
        writer.finish()
    assert_imus(McapLog(str(path)).read(("/imu",))["/imu"], 20)


def write_json(path: Path, messages: list[bytes], schema_name: str = "foxglove.LocationFix") -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(schema_name, "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/gnss", "json", schema)
        for i, message in enumerate(messages):
            writer.add_message(channel, START_NS + i, message, START_NS + i)
        writer.finish()
    return path


def test_json_location_fix(tmp_path: Path) -> None:
    fixes = [
        {
            "timestamp": {"sec": 1_700_000_000 + i, "nsec": 500},
            "frame_id": "gnss",
            "latitude": 35 + (i > 0) * 0.25,
            "longitude": -139.5,
            "altitude": None if i == 1 else 10.0,
            "position_covariance": list(range(9)),
            "position_covariance_type": 2,
            "valid": True,
            "pose": {"position": {"x": 1, "y": 2.5, "z": 3}, "name": "a"},
            "satellites": [{"id": 1}],
        }
        for i in range(3)
    ]
    log = McapLog(str(write_json(tmp_path / "log.mcap", [json.dumps(fix).encode() for fix in fixes])))
    assert log.channels() == (Channel("/gnss", "foxglove.LocationFix", "json", 3),)
    columns = log.read(("/gnss",))["/gnss"].columns
    assert columns["timestamp"].tolist() == [(1_700_000_000 + i) * 10**9 + 500 for i in range(3)]
    assert columns["latitude"].tolist() == [35.0, 35.25, 35.25]
    assert np.array_equal(columns["altitude"], [10.0, np.nan, 10.0], equal_nan=True)
    assert columns["position_covariance"].shape == (3, 9)
    assert columns["position_covariance_type"].dtype == np.int64
    assert columns["valid"].dtype == bool
    assert columns["pose.position"].tolist() == [[1, 2.5, 3]] * 3
    assert columns["pose.name"].tolist() == ["a"] * 3
    assert columns["satellites"].tolist() == [[{"id": 1}]] * 3


def test_json_that_is_none_is_rejected(tmp_path: Path) -> None:
    path = write_json(tmp_path / "log.mcap", [b'{"a": 1}', b"{", b"[1]", b'{"a": 2, "b": 0.5}', b"\xff"])
    table = McapLog(str(path)).read(("/gnss",))["/gnss"]
    assert (table.read, table.rejected) == (5, {"not a JSON object": 3})
    assert table.log_time_ns.tolist() == [START_NS, START_NS + 3]
    assert table.columns["a"].tolist() == [1, 2]
    assert np.array_equal(table.columns["b"], [np.nan, 0.5], equal_nan=True)


def write_protobuf(path: Path, kind: type, messages: list) -> Path:
    schema = kind.get_schema()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
        channel = writer.register_channel("/gnss", "protobuf", number)
        for i, message in enumerate(messages):
            writer.add_message(channel, START_NS + i, message if isinstance(message, bytes) else message.encode(), START_NS + i)
        writer.finish()
    return path


def test_protobuf_location_fix(tmp_path: Path) -> None:
    fixes = [
        LocationFix(
            timestamp=Timestamp(1_700_000_000, i),
            frame_id="gnss",
            latitude=35.0 + i / 3,
            longitude=-139.0,
            altitude=7.0,
            position_covariance=[float(k) for k in range(9)],
        )
        for i in range(4)
    ]
    log = McapLog(str(write_protobuf(tmp_path / "log.mcap", LocationFix, [*fixes, b"\xff\xff"])))
    assert log.channels() == (Channel("/gnss", "foxglove.LocationFix", "protobuf", 5),)
    table = log.read(("/gnss",))["/gnss"]
    assert (table.read, table.rejected) == (5, {"not decodable as foxglove.LocationFix": 1})
    assert table.columns["timestamp"].tolist() == [1_700_000_000 * 10**9 + i for i in range(4)]
    assert table.columns["latitude"].tolist() == [35.0 + i / 3 for i in range(4)]
    assert table.columns["position_covariance"].tolist() == [list(range(9))] * 4
    assert table.columns["frame_id"].tolist() == ["gnss"] * 4
    assert table.columns["position_covariance_type"].tolist() == [0] * 4


def test_protobuf_pose_in_frame(tmp_path: Path) -> None:
    pose = Pose(position=Vector3(x=1.0, y=2.0, z=3.0), orientation=Quaternion(x=0.1, y=0.2, z=0.3, w=0.9))
    message = PoseInFrame(timestamp=Timestamp(5, 6), frame_id="map", pose=pose)
    columns = McapLog(str(write_protobuf(tmp_path / "log.mcap", PoseInFrame, [message]))).read(("/gnss",))["/gnss"].columns
    assert columns["pose.position"].tolist() == [[1.0, 2.0, 3.0]]
    assert columns["pose.orientation"].tolist() == [[0.1, 0.2, 0.3, 0.9]]
    assert columns["timestamp"].tolist() == [5_000_000_006]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.77, 0.999])
def test_truncated_file_is_read_up_to_the_end(tmp_path: Path, fraction: float, compression: CompressionType) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), compression=compression)
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * fraction)])
    whole = sum(stop <= fraction * len(content) for _, stop in chunk_extents(path))
    log = McapLog(str(path))
    table = log.read(("/imu",))["/imu"]
    assert "no usable index (was the recording closed?); the file was read through from its start" in log.notes
    assert len(table.log_time_ns) >= whole * 50
    assert table.rejected == {}
    assert_imus(table, COUNT, 0, len(table.log_time_ns))


def test_messages_of_a_cut_chunk_are_salvaged(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), compression=CompressionType.NONE, chunk_size=10**6)
    (start, stop), *_ = chunk_extents(path)
    path.write_bytes(path.read_bytes()[: (start + stop) // 2])
    log = McapLog(str(path))
    table = log.read(("/imu",))["/imu"]
    assert 0.45 * COUNT < len(table.log_time_ns) < 0.5 * COUNT
    assert "is cut off" in " ".join(log.notes)
    assert_imus(table, COUNT, 0, len(table.log_time_ns))


@pytest.mark.parametrize("options", [{}, {"use_statistics": False, "repeat_channels": False}], ids=["statistics", "none"])
@pytest.mark.parametrize("compression", list(CompressionType))
def test_flipped_bit_costs_one_chunk(tmp_path: Path, compression: CompressionType, options: dict) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), compression=compression, **options)
    extents = chunk_extents(path)
    start, stop = extents[2]
    flip(path, (start + stop) // 2)
    log = McapLog(str(path))
    table = log.read(("/imu",))["/imu"]
    lost = table.rejected["in a damaged chunk"]
    assert table.read == COUNT
    assert 0 < lost < COUNT / (len(extents) - 1)
    assert any(f"the chunk at byte {start} " in note and note.endswith("was left out") for note in log.notes)
    rows = (table.columns["header.stamp"] - START_NS) // 5_000_000
    assert table.columns["orientation"].tobytes() == imu_rows(COUNT)[rows, :4].tobytes()


@pytest.mark.parametrize("byte", [1, 3, 8])
def test_damaged_record_length_costs_at_most_its_chunk(tmp_path: Path, byte: int) -> None:
    """The length in a chunk's record head: too long within the file, beyond the file, absurd."""
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT), compression=CompressionType.NONE)
    start, _ = chunk_extents(path)[2]
    flip(path, start - 9 + byte)
    log = McapLog(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == COUNT
    assert len(table.log_time_ns) >= COUNT - 60
    assert any(note.startswith("damaged from byte") for note in log.notes)


def test_flipped_opcode_is_balanced(tmp_path: Path) -> None:
    """A chunk whose record calls itself something else is missing, and counted by the statistics."""
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT))
    start, _ = chunk_extents(path)[1]
    content = bytearray(path.read_bytes())
    content[start - 9] = 0x20
    path.write_bytes(content)
    table = McapLog(str(path)).read(("/imu",))["/imu"]
    assert table.read == COUNT == len(table.log_time_ns) + table.rejected["lost to damage in the file"]


def test_absurd_chunk_size_is_no_allocation(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT))
    start, _ = chunk_extents(path)[0]
    content = bytearray(path.read_bytes())
    content[start + 16 : start + 24] = struct.pack("<Q", 1 << 60)
    path.write_bytes(content)
    log = McapLog(str(path))
    assert log.read(("/imu",))["/imu"].rejected["in a damaged chunk"] > 0
    assert any("declares an absurd size" in note for note in log.notes)


def test_several_channels_and_one_topic_twice(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    raws = raw_imus(ROS2, 30)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2_000)
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", ROS2.generate_msgdef(IMU, ros_version=2)[0].encode())
        numbers = [writer.register_channel(topic, "cdr", schema) for topic in ("/imu", "/other", "/imu")]
        for i, (t_ns, raw) in enumerate(raws):
            writer.add_message(numbers[i % 3], t_ns + 1, raw, t_ns)
        writer.finish()
    log = McapLog(str(path))
    assert log.channels() == (Channel("/imu", IMU, "cdr", 20), Channel("/other", IMU, "cdr", 10))
    tables = log.read(("/other", "/imu"))
    stamps = START_NS + np.arange(30) * 5_000_000
    assert tables["/other"].columns["header.stamp"].tolist() == stamps[1::3].tolist()
    assert sorted(tables["/imu"].columns["header.stamp"].tolist()) == np.delete(stamps, np.s_[1::3]).tolist()


def test_no_messages(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", [])
    table = McapLog(str(path)).read(("/imu",))["/imu"]
    assert (table.read, len(table.log_time_ns), table.rejected) == (0, 0, {})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty; was the recording stopped before anything was written?"),
        (b"time,x,y\n1,2,3\n", "not an MCAP file: the file does not begin as one"),
        (b"\x89MCAP0\r\n", "no channel could be read from this MCAP file; it was cut off early, or is damaged beyond use"),
        (b"\x89MCAP0\r\n" + b"\xff" * 99, "no channel could be read from this MCAP file"),
    ],
)
def test_useless_file_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError) as error:
        McapLog(str(path))
    assert str(error.value).startswith(f"{path}: {message}")
    assert "\n" not in str(error.value)


def test_flipped_magic(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, 5))
    flip(path, 2)
    with pytest.raises(LogError, match="does not begin as one; wrong file, or damaged in its first bytes"):
        McapLog(str(path))


def test_flipped_header_record_is_survived(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT))
    flip(path, 8 + 4)
    assert_imus(McapLog(str(path)).read(("/imu",))["/imu"], COUNT)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be read: No such file or directory"):
        McapLog(str(tmp_path / "none.mcap"))


def test_unknown_topic_names_the_nearest(tmp_path: Path) -> None:
    log = McapLog(str(write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, 5), topic="/imu/data")))
    with pytest.raises(LogError, match=r"no channel /imu/dat in this log; did you mean /imu/data\?"):
        log.read(("/imu/dat",))
    with pytest.raises(LogError, match=r"no channel gnss in this log; it has /imu/data"):
        log.read(("gnss",))


def test_missing_schema_and_foreign_encoding_are_told(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/bare", "cdr", 0)
        foreign = writer.register_channel("/foreign", "cbor", writer.register_schema("x", "", b""))
        broken = writer.register_channel("/broken", "protobuf", writer.register_schema("x", "protobuf", b"\xff\xff"))
        for number in (channel, foreign, broken):
            writer.add_message(number, 1, b"\0\1\0\0", 1)
        writer.finish()
    log = McapLog(str(path))
    tables = log.read(("/bare", "/foreign", "/broken"))
    for name, reason in (
        ("/bare", "its schema 0 is missing in the file, so its cdr messages cannot be read"),
        ("/foreign", "message encoding 'cbor' is not supported; cdr, ros1, json and protobuf are"),
        ("/broken", "the protobuf descriptors of type x are damaged; the channel cannot be read"),
    ):
        assert (tables[name].read, tables[name].rejected, len(tables[name].log_time_ns)) == (1, {reason: 1}, 0)
