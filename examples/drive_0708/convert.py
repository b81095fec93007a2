"""Converts the original files of drive_0708 to one MCAP file of ROS 2 messages: python convert.py FOLDER OUT.mcap

FOLDER holds imu_1934.csv, imu_1934.csv.tag and gnss_1934_sf.pos as published. The values are kept as they are, in the sensor's
own axes (x back, y right, z up); only units change (g to m/s^2, deg/s to rad/s) and time becomes UTC. The delay between
sampling and logging of the IMU stays in: drive.toml corrects it, where the user sees it.
"""

import argparse
import struct
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

STANDARD_GRAVITY = 9.80665
GPS_MINUS_UTC_S = 18  # on the day of the drive
IMU, FIX, VELOCITY = "/imu/data", "/gnss/fix", "/gnss/velocity"

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
NAV_STATUS = {1: 2, 2: 1, 4: 1, 5: 0}  # RTKLIB's Q to NavSatStatus: fixed GBAS, float and differential SBAS, single none


def read_imu(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """UTC nanoseconds (n,) and ax, ay, az [m/s^2], gx, gy, gz [rad/s] (n, 6).

    The device counts milliseconds of its own clock; the time tag of RTKLIB tells when the first and the last line arrived.
    """
    lines = (folder / "imu_1934.csv").read_text().splitlines()
    rows = np.array([[float(word) for word in line.split(",")] for line in lines if line.count(",") == 6])
    tag = (folder / "imu_1934.csv.tag").read_bytes()
    _, start_s, start_fraction = struct.unpack_from("<IId", tag, 60)
    last_tick_ms, _ = struct.unpack_from("<II", tag, len(tag) - 8)
    device_ms = rows[:, 6] - rows[0, 6]
    since_start_s = device_ms / device_ms[-1] * (last_tick_ms / 1000)
    start_ns = (start_s - GPS_MINUS_UTC_S) * 1_000_000_000 + round(start_fraction * 1e9)
    # Whole microseconds: the device itself counts milliseconds.
    t_ns = start_ns + np.rint(since_start_s * 1e6).astype(np.int64) * 1000
    return t_ns, np.hstack([rows[:, 0:3] * STANDARD_GRAVITY, np.radians(rows[:, 3:6])])


def read_fixes(folder: Path) -> Iterator[tuple[int, np.ndarray]]:
    """UTC nanoseconds and the columns behind the time of each line of the position file."""
    with (folder / "gnss_1934_sf.pos").open() as file:
        for line in file:
            if line.startswith("%"):
                continue
            day, clock, *values = line.split()
            whole, fraction = clock.split(".")
            gps = datetime.strptime(f"{day} {whole}", "%Y/%m/%d %H:%M:%S").replace(tzinfo=UTC)
            t_ns = (int(gps.timestamp()) - GPS_MINUS_UTC_S) * 1_000_000_000 + int(fraction.ljust(9, "0"))
            yield t_ns, np.array(values, dtype=np.float64)


def make_header(t_ns: int, frame: str) -> object:
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=t_ns // 1_000_000_000, nanosec=t_ns % 1_000_000_000)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def make_vector(xyz: np.ndarray) -> object:
    return TYPES["geometry_msgs/msg/Vector3"](*map(float, xyz))


def make_imu(t_ns: int, row: np.ndarray) -> object:
    no_orientation = np.zeros(9)
    no_orientation[0] = -1
    return TYPES["sensor_msgs/msg/Imu"](
        header=make_header(t_ns, "imu"),
        orientation=TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        orientation_covariance=no_orientation,
        angular_velocity=make_vector(row[3:6]),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=make_vector(row[0:3]),
        linear_acceleration_covariance=np.zeros(9),
    )


def make_fix(t_ns: int, row: np.ndarray) -> object:
    status = TYPES["sensor_msgs/msg/NavSatStatus"](status=NAV_STATUS[int(row[3])], service=1)
    return TYPES["sensor_msgs/msg/NavSatFix"](
        header=make_header(t_ns, "gnss"),
        status=status,
        latitude=float(row[0]),
        longitude=float(row[1]),
        altitude=float(row[2]),
        position_covariance=np.diag(row[[6, 5, 7]] ** 2).ravel(),
        position_covariance_type=2,
    )


def make_velocity(t_ns: int, row: np.ndarray) -> object:
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = np.diag(row[[17, 16, 18]] ** 2)
    twist = TYPES["geometry_msgs/msg/Twist"](linear=make_vector(row[[14, 13, 15]]), angular=make_vector(np.zeros(3)))
    return TYPES["geometry_msgs/msg/TwistWithCovarianceStamped"](
        header=make_header(t_ns, "enu"),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=covariance.ravel()),
    )


def make_messages(folder: Path) -> list[tuple[int, str, object]]:
    """(UTC nanoseconds, topic, message) in the order of time."""
    messages = [(int(t), IMU, make_imu(int(t), row)) for t, row in zip(*read_imu(folder), strict=True)]
    for t, row in read_fixes(folder):
        messages += [(t, FIX, make_fix(t, row)), (t, VELOCITY, make_velocity(t, row))]
    return sorted(messages, key=lambda message: message[0])


def write_mcap(path: Path, messages: list[tuple[int, str, object]]) -> None:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4_000_000, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="navreplay examples/drive_0708/convert.py")
        channels = {}
        for topic in (IMU, FIX, VELOCITY):
            name = next(message.__msgtype__ for _, at, message in messages if at == topic)
            definition, _ = STORE.generate_msgdef(name, ros_version=2)
            schema = writer.register_schema(name, "ros2msg", definition.encode())
            channels[topic] = (name, writer.register_channel(topic, "cdr", schema))
        for t_ns, topic, message in messages:
            name, channel = channels[topic]
            writer.add_message(channel, log_time=t_ns, publish_time=t_ns, data=bytes(STORE.serialize_cdr(message, name)))
        writer.finish()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with the original files")
    parser.add_argument("out", type=Path, help="MCAP file to write")
    arguments = parser.parse_args()
    write_mcap(arguments.out, make_messages(arguments.folder))


if __name__ == "__main__":
    main()
