"""Small logs for the decoder tests, written with the libraries' own writers."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

IMU = "sensor_msgs/msg/Imu"
FIX = "sensor_msgs/msg/NavSatFix"
START_NS = 1_700_000_000_000_000_000
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)


def header(store: Typestore, t_ns: int, frame_id: str) -> Any:
    """std_msgs/Header of either ROS."""
    stamp = store.types["builtin_interfaces/msg/Time"](t_ns // 10**9, t_ns % 10**9)
    first = (7,) if store is ROS1 else ()
    return store.types["std_msgs/msg/Header"](*first, stamp, frame_id)


def imu(store: Typestore, t_ns: int, values: Iterable[float], frame_id: str = "imu_link") -> Any:
    """sensor_msgs/Imu holding 37 values in the order of its fields."""
    v = np.array(list(values), dtype=np.float64)
    vector, quaternion = store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"]
    return store.types[IMU](
        header(store, t_ns, frame_id),
        quaternion(*v[:4].tolist()),
        v[4:13],
        vector(*v[13:16].tolist()),
        v[16:25],
        vector(*v[25:28].tolist()),
        v[28:37],
    )


def nav_sat_fix(store: Typestore, t_ns: int, lla: tuple[float, float, float] = (48.0, 11.0, 500.0)) -> Any:
    """sensor_msgs/NavSatFix at a place [deg, deg, m] with a standard deviation of a metre."""
    status = store.types["sensor_msgs/msg/NavSatStatus"](0, 1)
    return store.types[FIX](header(store, t_ns, "gnss"), status, *lla, np.eye(3).ravel(), 2)


def imu_rows(count: int) -> np.ndarray:
    """(count, 37) values, all different."""
    return np.random.default_rng(5).normal(size=(count, 37))


def raw_imus(store: Typestore, count: int) -> list[tuple[int, bytes]]:
    """Stamps and serialised messages of `imu_rows` at 200 Hz."""
    serialize = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
    rows = imu_rows(count)
    times = [START_NS + i * 5_000_000 for i in range(count)]
    return [(t_ns, bytes(serialize(imu(store, t_ns, row), IMU))) for t_ns, row in zip(times, rows, strict=True)]


def write_mcap(
    path: Path,
    messages: Iterable[tuple[int, bytes]],
    encoding: str = "cdr",
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 20_000,
    topic: str = "/imu",
    **options: Any,
) -> Path:
    """An MCAP of one channel of sensor_msgs/Imu."""
    store, version, language = (ROS1, 1, "ros1msg") if encoding == "ros1" else (ROS2, 2, "ros2msg")
    definition, _ = store.generate_msgdef(IMU, ros_version=version)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=compression, **options)
        writer.start()
        name = "sensor_msgs/Imu" if encoding == "ros1" else IMU
        schema = writer.register_schema(name, language, definition.encode())
        channel = writer.register_channel(topic, encoding, schema)
        for t_ns, raw in messages:
            writer.add_message(channel, t_ns + 1, raw, t_ns)
        writer.finish()
    return path


def write_ros1_bag(path: Path, count: int, compression: Writer1.CompressionFormat | None = None, chunk: int = 20_000) -> Path:
    """A ROS 1 bag of one topic /imu."""
    bag = Writer1(path)
    if compression:
        bag.set_compression(compression)
    bag.chunk_threshold = chunk
    with bag:
        connection = bag.add_connection("/imu", IMU, typestore=ROS1)
        for t_ns, raw in raw_imus(ROS1, count):
            bag.write(connection, t_ns + 1, raw)
    return path


def assert_imus(table: Any, count: int, first: int = 0, last: int | None = None) -> None:
    """The table holds exactly the values and stamps of `imu_rows`, bit for bit."""
    rows = imu_rows(count)[first:last]
    columns = table.columns
    found = np.hstack(
        [
            columns[name]
            for name in (
                "orientation",
                "orientation_covariance",
                "angular_velocity",
                "angular_velocity_covariance",
                "linear_acceleration",
                "linear_acceleration_covariance",
            )
        ]
    )
    stamps = START_NS + np.arange(count)[first:last] * 5_000_000
    assert found.dtype == np.float64
    assert found.tobytes() == rows.tobytes()
    assert columns["header.stamp"].tolist() == stamps.tolist()
    assert table.log_time_ns.tolist() == (stamps + 1).tolist()
    assert set(columns["header.frame_id"]) == {"imu_link"}
