"""ROS 1 and ROS 2 bags: compressions, storages, unclosed and damaged ones, and what the user is told."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from importers.containers.bag_records import MAGIC, Op
from importers.containers.record_scan import scan_bag
from importers.containers.ros1_bag import Ros1Bag
from importers.containers.ros2_bag import Ros2Bag
from importers.rows.log import Channel
from navreplay.timeline import LogError
from tests.helpers.log_samples import FIX, IMU, ROS2, START_NS, assert_imus, imu_rows, raw_imus, write_mcap, write_ros1_bag

COUNT = 500
COMPRESSIONS = [None, *Writer1.CompressionFormat]


def chunk_extents(path: Path) -> list[tuple[int, int]]:
    """Extent of the data of each chunk record."""
    op, _, _, _, start, stop, _ = scan_bag(np.frombuffer(path.read_bytes(), dtype=np.uint8), len(MAGIC))
    return [(int(a), int(b)) for kind, a, b in zip(op, start, stop, strict=True) if kind == Op.CHUNK]


def replace_bytes(path: Path, offset: int, new: bytes) -> None:
    content = bytearray(path.read_bytes())
    content[offset : offset + len(new)] = new
    path.write_bytes(content)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_ros1(tmp_path: Path, compression: Writer1.CompressionFormat | None) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", COUNT, compression)
    log = Ros1Bag(str(path))
    assert log.channels() == (Channel("/imu", IMU, "ros1", COUNT),)
    table = log.read(("/imu",))["/imu"]
    assert (table.read, table.rejected, log.notes) == (COUNT, {}, ())
    assert_imus(table, COUNT)
    assert table.columns["header.seq"].tolist() == [7] * COUNT


def test_ros1_equals_any_reader(tmp_path: Path) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", 40, Writer1.CompressionFormat.LZ4)
    table = Ros1Bag(str(path)).read(("/imu",))["/imu"]
    with AnyReader([path]) as reader:
        messages = [(t_ns, reader.deserialize(raw, connection.msgtype)) for connection, t_ns, raw in reader.messages()]
    assert table.log_time_ns.tolist() == [t_ns for t_ns, _ in messages]
    for name in ("orientation", "angular_velocity", "linear_acceleration"):
        axes = "xyzw"[: table.columns[name].shape[1]]
        assert table.columns[name].tolist() == [
            [getattr(getattr(message, name), axis) for axis in axes] for _, message in messages
        ]
        covariance = np.array([getattr(message, f"{name}_covariance") for _, message in messages])
        assert table.columns[f"{name}_covariance"].tobytes() == covariance.tobytes()


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("fraction", [0.15, 0.5, 0.85, 0.999])
def test_truncated_ros1_bag(tmp_path: Path, fraction: float, compression: Writer1.CompressionFormat | None) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", COUNT, compression)
    content = path.read_bytes()
    whole = sum(stop <= fraction * len(content) for _, stop in chunk_extents(path))
    path.write_bytes(content[: int(fraction * len(content))])
    log = Ros1Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert "no usable index (was the recording closed?); the bag was read through from its start" in log.notes
    assert len(table.log_time_ns) >= min(whole * 50, COUNT - 20)
    assert_imus(table, COUNT, 0, len(table.log_time_ns))


def test_unindexed_ros1_bag(tmp_path: Path) -> None:
    """A bag as a recorder that was killed leaves it: index_pos is 0, no index at the end."""
    path = write_ros1_bag(tmp_path / "log.bag", COUNT)
    content = path.read_bytes()
    at = content.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(content[:at] + bytes(8) + content[at + 8 : chunk_extents(path)[-1][1]])
    log = Ros1Bag(str(path))
    assert log.channels() == (Channel("/imu", IMU, "ros1", COUNT),)
    assert_imus(log.read(("/imu",))["/imu"], COUNT)


@pytest.mark.parametrize("compression", list(Writer1.CompressionFormat))
def test_flipped_bits_in_a_ros1_chunk(tmp_path: Path, compression: Writer1.CompressionFormat) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", COUNT, compression)
    start, _ = chunk_extents(path)[2]
    replace_bytes(path, start, b"\x55" * 40)
    log = Ros1Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    lost = table.rejected["in a damaged chunk"]
    assert table.read == COUNT
    assert 40 < lost < 70
    assert any(note.endswith("does not decompress and was left out") for note in log.notes)
    rows = (table.columns["header.stamp"] - START_NS) // 5_000_000
    assert table.columns["orientation"].tobytes() == imu_rows(COUNT)[rows, :4].tobytes()


def test_broken_record_inside_a_ros1_chunk(tmp_path: Path) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", COUNT)
    start, stop = chunk_extents(path)[1]
    at = path.read_bytes().index(b"op=\x02", (start + stop) // 2) - 4
    replace_bytes(path, at, b"\xff\xff\xff\xff")
    log = Ros1Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == COUNT
    assert 20 < table.rejected["lost to damage in the file"] < 60
    assert any("is damaged inside" in note for note in log.notes)


def test_broken_chunk_record_is_jumped_over(tmp_path: Path) -> None:
    path = write_ros1_bag(tmp_path / "log.bag", COUNT)
    start, _ = chunk_extents(path)[1]
    replace_bytes(path, start - 4, b"\xff\xff\xff\x7f")
    log = Ros1Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == COUNT
    assert len(table.log_time_ns) >= COUNT - 60
    assert any(note.startswith("damaged from byte") for note in log.notes)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"#ROSBAG V1.2\n", "not a ROS 1 bag of format 2.0: the file does not begin as one"),
        (b"#ROSBAG V2.0\n", "no connection could be read from this bag; it holds no messages or is damaged beyond use"),
        (b"#ROSBAG V2.0\n" + b"\xff" * 5000, "no connection could be read from this bag"),
    ],
)
def test_useless_bag_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "log.bag"
    path.write_bytes(content)
    with pytest.raises(LogError) as error:
        Ros1Bag(str(path))
    assert str(error.value).startswith(f"{path}: {message}")
    assert "\n" not in str(error.value)


def test_unknown_topic(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"no channel imu in this log; did you mean /imu\?"):
        Ros1Bag(str(write_ros1_bag(tmp_path / "log.bag", 3))).read(("imu",))


def write_ros2_bag(path: Path, count: int, plugin: StoragePlugin, mode: CompressionMode | None = None) -> Path:
    bag = Writer2(path, version=9, storage_plugin=plugin)
    if mode:
        bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection("/imu", IMU, typestore=ROS2)
        bag.add_connection("/fix", FIX, typestore=ROS2)
        for t_ns, raw in raw_imus(ROS2, count):
            bag.write(connection, t_ns + 1, raw)
    return path


@pytest.mark.parametrize("mode", [None, CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_ros2(tmp_path: Path, plugin: StoragePlugin, mode: CompressionMode | None) -> None:
    log = Ros2Bag(str(write_ros2_bag(tmp_path / "log", COUNT, plugin, mode)))
    assert log.channels() == (Channel("/imu", IMU, "cdr", COUNT), Channel("/fix", FIX, "cdr", 0))
    tables = log.read(("/imu", "/fix"))
    assert (tables["/imu"].read, tables["/imu"].rejected, log.notes) == (COUNT, {}, ())
    assert_imus(tables["/imu"], COUNT)
    assert tables["/fix"].read == 0


def test_bare_storage_file(tmp_path: Path) -> None:
    path = write_ros2_bag(tmp_path / "log", COUNT, StoragePlugin.SQLITE3) / "log.db3"
    assert_imus(Ros2Bag(str(path)).read(("/imu",))["/imu"], COUNT)


def test_storage_without_definitions_takes_the_standard_types(tmp_path: Path) -> None:
    """Recorders before ROS 2 Iron wrote none."""
    path = write_ros2_bag(tmp_path / "log", 20, StoragePlugin.SQLITE3)
    database = sqlite3.connect(path / "log.db3")
    database.execute("DROP TABLE message_definitions")
    database.commit()
    database.close()
    assert_imus(Ros2Bag(str(path)).read(("/imu",))["/imu"], 20)


def test_recording_that_was_not_closed_has_no_metadata(tmp_path: Path) -> None:
    path = write_ros2_bag(tmp_path / "log", COUNT, StoragePlugin.SQLITE3)
    (path / "metadata.yaml").unlink()
    log = Ros2Bag(str(path))
    assert_imus(log.read(("/imu",))["/imu"], COUNT)
    assert log.notes == ("metadata.yaml is missing (was the recording closed?); all storage files of the directory were read",)


def split_bag(path: Path) -> Path:
    """A bag of two MCAP parts with 300 and 200 messages."""
    path.mkdir()
    raws = raw_imus(ROS2, COUNT)
    write_mcap(path / "log_0.mcap", raws[:300])
    write_mcap(path / "log_1.mcap", raws[300:], compression=CompressionType.LZ4)
    topic = "{topic_metadata: {name: /imu, type: sensor_msgs/msg/Imu, serialization_format: cdr}, message_count: 500}"
    (path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n"
        "  version: 5\n"
        "  storage_identifier: mcap\n"
        "  relative_file_paths: [log_0.mcap, log_1.mcap]\n"
        f"  topics_with_message_count: [{topic}]\n"
    )
    return path


def test_split_bag(tmp_path: Path) -> None:
    log = Ros2Bag(str(split_bag(tmp_path / "log")))
    assert log.channels() == (Channel("/imu", IMU, "cdr", COUNT),)
    assert_imus(log.read(("/imu",))["/imu"], COUNT)


def test_missing_part_is_told_and_counted(tmp_path: Path) -> None:
    path = split_bag(tmp_path / "log")
    (path / "log_0.mcap").unlink()
    log = Ros2Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert log.notes == ("part log_0.mcap is listed in metadata.yaml but missing",)
    assert (table.read, table.rejected) == (COUNT, {"in a missing or damaged part": 300})
    assert_imus(table, COUNT, 300)


def test_damaged_part_is_told_and_counted(tmp_path: Path) -> None:
    path = split_bag(tmp_path / "log")
    (path / "log_1.mcap").write_bytes(b"")
    log = Ros2Bag(str(path))
    assert log.read(("/imu",))["/imu"].rejected == {"in a missing or damaged part": 200}
    assert log.notes[0].endswith("log_1.mcap: the file is empty; was the recording stopped before anything was written?")


def test_damaged_metadata(tmp_path: Path) -> None:
    path = split_bag(tmp_path / "log")
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    log = Ros2Bag(str(path))
    assert_imus(log.read(("/imu",))["/imu"], COUNT)
    assert log.notes == ("metadata.yaml is damaged; all storage files of the directory were read",)


@pytest.mark.parametrize("fraction", [0.4, 0.7, 0.95])
def test_truncated_sqlite_storage_is_read_up_to_the_damage(tmp_path: Path, fraction: float) -> None:
    path = write_ros2_bag(tmp_path / "log", 2000, StoragePlugin.SQLITE3)
    content = (path / "log.db3").read_bytes()
    (path / "log.db3").write_bytes(content[: int(len(content) * fraction)])
    log = Ros2Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == 2000 == len(table.log_time_ns) + sum(table.rejected.values())
    assert len(table.log_time_ns) > 2000 * (fraction - 0.2)
    assert any("messages before it were kept" in note for note in log.notes)
    assert_imus(table, 2000, 0, len(table.log_time_ns))


def test_truncated_file_compression(tmp_path: Path) -> None:
    path = write_ros2_bag(tmp_path / "log", COUNT, StoragePlugin.MCAP, CompressionMode.FILE)
    (packed,) = path.glob("*.zstd")
    packed.write_bytes(packed.read_bytes()[:-2000])
    log = Ros2Bag(str(path))
    table = log.read(("/imu",))["/imu"]
    assert table.read == COUNT
    assert_imus(table, COUNT, 0, len(table.log_time_ns))
    assert any("no usable index" in note for note in log.notes)


def test_directory_without_a_bag(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"no storage file \(.db3 or .mcap\) of a ROS 2 bag in it"):
        Ros2Bag(str(tmp_path))


def test_file_that_is_no_bag(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    with pytest.raises(LogError, match="cannot be read: No such file"):
        Ros2Bag(str(path))
    path.write_text("a letter")
    with pytest.raises(LogError, match="not a sqlite3 storage file of ROS 2: the file does not begin as one"):
        Ros2Bag(str(path))


def test_database_of_another_program(tmp_path: Path) -> None:
    path = tmp_path / "log.db3"
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE notes (text)")
    database.commit()
    database.close()
    with pytest.raises(
        LogError, match=r"no readable ROS 2 storage \(no such table: topics\); is the file damaged, or of another"
    ):
        Ros2Bag(str(path))
    path.write_bytes(b"not a database at all")
    with pytest.raises(LogError, match="not a sqlite3 storage file of ROS 2: the file does not begin as one"):
        Ros2Bag(str(path))
