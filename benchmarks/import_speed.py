"""Speed of importing, against the libraries, in one run: `python -m benchmarks.import_speed [--minutes 60]`.

Writes an hour of 200 Hz sensor_msgs/Imu as zstd MCAP, ROS 1 bag and ROS 2 bag (sqlite3) to a temporary directory and prints
CPU time per message (median of the repetitions), the ratio to the library's decoder, and the peak of memory while reading the
MCAP in a process of its own. The libraries read a shorter log of the same kind whole, opening included, as ours is.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from importers.containers.mcap import McapLog
from importers.containers.ros1_bag import Ros1Bag
from importers.containers.ros2_bag import Ros2Bag
from importers.rows.log import Log

TYPE = "sensor_msgs/msg/Imu"
RATE_HZ = 200
START_NS = 1_700_000_000_000_000_000
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)


def imu_messages(count: int, encoding: str) -> Iterator[tuple[int, bytes]]:
    """Time and bytes of `count` messages: one message serialised by the library, with stamp and samples replaced."""
    store = ROS1 if encoding == "ros1" else ROS2
    types = store.types
    vector, stamp = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"](0, 0)
    head = (0,) if encoding == "ros1" else ()
    header = types["std_msgs/msg/Header"](*head, stamp, "imu_link")
    cov = np.diag([1e-6, 1e-6, 1e-6]).ravel()
    quaternion = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    message = types[TYPE](header, quaternion, cov, vector(1.0, 2.0, 3.0), cov, vector(4.0, 5.0, 6.0), cov)
    serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
    raw = bytearray(serialize(message, TYPE))
    gyro_at, accel_at = raw.index(np.array([1.0, 2, 3]).tobytes()), raw.index(np.array([4.0, 5, 6]).tobytes())
    samples = np.random.default_rng(1).normal(size=(count, 6)) * 0.1
    for i in range(count):
        t_ns = START_NS + i * (1_000_000_000 // RATE_HZ)
        raw[4:12] = np.array(divmod(t_ns, 1_000_000_000), dtype="<u4").tobytes()
        raw[gyro_at : gyro_at + 24] = samples[i, :3].tobytes()
        raw[accel_at : accel_at + 24] = samples[i, 3:].tobytes()
        yield t_ns, bytes(raw)


def write_mcap(path: Path, count: int) -> None:
    """The log as zstd MCAP."""
    definition, _ = ROS2.generate_msgdef(TYPE, ros_version=2)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema(TYPE, "ros2msg", definition.encode())
        channel = writer.register_channel("/imu", "cdr", schema)
        for t_ns, raw in imu_messages(count, "cdr"):
            writer.add_message(channel, t_ns, raw, t_ns)
        writer.finish()


def write_ros1(path: Path, count: int) -> None:
    """The log as ROS 1 bag."""
    with Writer1(path) as bag:
        connection = bag.add_connection("/imu", TYPE, typestore=ROS1)
        for t_ns, raw in imu_messages(count, "ros1"):
            bag.write(connection, t_ns, raw)


def write_ros2(path: Path, count: int) -> None:
    """The log as ROS 2 bag with sqlite3 storage."""
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connection = bag.add_connection("/imu", TYPE, typestore=ROS2)
        for t_ns, raw in imu_messages(count, "cdr"):
            bag.write(connection, t_ns, raw)


def read_imu(reader: Callable[[str], Log], path: Path) -> None:
    """Open a log and read its channel."""
    reader(str(path)).read(("/imu",))


def decode_with_mcap_ros2(path: Path) -> None:
    """Decode all messages with mcap-ros2-support."""
    with path.open("rb") as file:
        for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            continue


def decode_with_any_reader(path: Path) -> None:
    """Decode all messages with rosbags' AnyReader."""
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)


def cpu_seconds(run: Callable[[], object]) -> float:
    """CPU time of one run."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def peak_megabytes(path: Path) -> float:
    """Peak resident memory [MB] of a process that reads the MCAP, as Linux counts it."""
    program = (
        "import re, sys; from importers.containers.mcap import McapLog; log = McapLog(sys.argv[1]); log.read(('/imu',));"
        "print(int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) / 1024)"
    )
    return float(subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, check=True, text=True).stdout)


def main() -> None:
    """Write, time, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=int, default=60, help="length of the log")
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    count = options.minutes * 60 * RATE_HZ
    few = min(count, 20_000)
    cases: list[tuple[str, Callable[[Path, int], None], Callable[[str], Log], Callable[[Path], None], str]] = [
        ("imu.mcap", write_mcap, McapLog, decode_with_mcap_ros2, "mcap-ros2-support"),
        ("imu.bag", write_ros1, Ros1Bag, decode_with_any_reader, "rosbags AnyReader"),
        ("imu_ros2", write_ros2, Ros2Bag, decode_with_any_reader, "rosbags AnyReader"),
    ]
    with tempfile.TemporaryDirectory() as scratch:
        for name, write, reader, decode, library in cases:
            path = Path(scratch) / name
            short = Path(scratch) / f"short_{name}"
            write(path, count)
            write(short, few)
            read_imu(reader, path)  # the first run compiles or loads the kernels
            times = [
                (cpu_seconds(partial(read_imu, reader, path)) / count, cpu_seconds(partial(decode, short)) / few)
                for _ in range(options.repetitions)
            ]
            ours, theirs = (statistics.median(column) * 1e6 for column in zip(*times, strict=True))
            print(f"{name:9} {count} messages: {ours:.2f} us each; {library} {theirs:.1f} us; {theirs / ours:.0f} times faster")
        print(f"imu.mcap  peak memory of a process reading it: {peak_megabytes(Path(scratch) / 'imu.mcap'):.0f} MB")


if __name__ == "__main__":
    main()
