"""Converts the original files of tsukishima_2020 to one MCAP file and a reference: python convert.py FOLDER

FOLDER holds imu_50hz.csv, gnss_raw_gq_l1.csv, ubox1105.csv and RTK1105.csv. Values are kept as they are, the IMU's in the
sensor's own axes (x right, y forward, z up) and with its own stamps, which turn out to be UTC. Only the satellites are moved:
the originals are turned for the signal's flight by pseudorange / c, receiver clock included, which navreplay's importer mends
(sagnac = "pseudorange"); they are stored as it understands them, to a tenth of a millimetre.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from heapq import merge
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from importers import load_timeline
from importers.settings import InputSettings
from navreplay.geodesy.earth import lla_from_ecef
from navreplay.geodesy.time_scales import gps_from_week_tow, utc_from_gps
from synthetic_logs.writers.range_messages import SCHEMA, SCHEMA_NAME, TOPIC, range_messages

HERE = Path(__file__).parent
WEEK = 2130
GPS_MINUS_UTC_S = 18.0
RANGES = {
    "match": "gnss_raw_gq_l1.csv",
    "role": "range",
    "time": {"column": "gps_tow_s", "base": "gps_tow", "week_column": "gps_week"},
    "columns": {
        **{"sat": "sat", "pseudorange": "pr_corr_m", "range_rate": "prr_mps", "cn0": "cn0_dbhz"},
        **{f"sat_{axis}": f"sat_{axis}_m" for axis in "xyz"},
        **{f"sat_v{axis}": f"sat_v{axis}_mps" for axis in "xyz"},
    },
    "corrections": {
        **{"satellite_clock": True, "relativity": True, "group_delay": True, "ionosphere": True, "troposphere": True},
        "sagnac": "pseudorange",
    },
}
STATUS = {1: "FIXED", 2: "FLOAT"}  # of RTKLIB's Q

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
Record = tuple[int, str, bytes]
"""Time [UTC ns], topic, message."""


def read_numbers(path: Path, skip: int = 0) -> np.ndarray:
    return np.loadtxt(path, delimiter=",", skiprows=skip, ndmin=2)


def utc_ns(tow_s: np.ndarray) -> np.ndarray:
    return np.asarray(utc_from_gps(gps_from_week_tow(WEEK, tow_s)))


def make_header(t_ns: int, frame: str) -> object:
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=t_ns // 1_000_000_000, nanosec=t_ns % 1_000_000_000)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def make_vector(xyz: np.ndarray) -> object:
    return TYPES["geometry_msgs/msg/Vector3"](*map(float, xyz))


def imu_records(folder: Path) -> Iterator[Record]:
    rows = read_numbers(folder / "imu_50hz.csv", skip=1)
    no_orientation = np.zeros(9)
    no_orientation[0] = -1
    for t_ns, row in zip(utc_ns(rows[:, 0] + GPS_MINUS_UTC_S).tolist(), rows, strict=True):
        message = TYPES["sensor_msgs/msg/Imu"](
            header=make_header(t_ns, "imu"),
            orientation=TYPES["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
            orientation_covariance=no_orientation,
            angular_velocity=make_vector(row[4:7]),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=make_vector(row[1:4]),
            linear_acceleration_covariance=np.zeros(9),
        )
        yield t_ns, "/imu/data", bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/Imu"))


def fix_records(folder: Path) -> Iterator[Record]:
    rows = read_numbers(folder / "ubox1105.csv")
    lla = lla_from_ecef(rows[:, 1:4])
    for t_ns, (lat, lon, height) in zip(utc_ns(rows[:, 0]).tolist(), lla, strict=True):
        message = TYPES["sensor_msgs/msg/NavSatFix"](
            header=make_header(t_ns, "gnss"),
            status=TYPES["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
            latitude=float(np.degrees(lat)),
            longitude=float(np.degrees(lon)),
            altitude=float(height),
            position_covariance=np.zeros(9),
            position_covariance_type=0,
        )
        yield t_ns, "/gnss/fix", bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/NavSatFix"))


def range_records(folder: Path) -> Iterator[Record]:
    ranges = load_timeline([folder / RANGES["match"]], InputSettings.model_validate({"csv": [RANGES]})).ranges
    rounded = replace(ranges, sat_pos_e=ranges.sat_pos_e.round(4), sat_vel_e=ranges.sat_vel_e.round(5))
    return ((t_ns, TOPIC, text) for t_ns, text in range_messages(rounded))


def write_mcap(folder: Path, path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4_000_000, compression=CompressionType.ZSTD)
        writer.start(profile="", library="navreplay examples/tsukishima_2020/convert.py")
        channels = {}
        for topic, name in (("/imu/data", "sensor_msgs/msg/Imu"), ("/gnss/fix", "sensor_msgs/msg/NavSatFix")):
            definition, _ = STORE.generate_msgdef(name, ros_version=2)
            channels[topic] = writer.register_channel(
                topic, "cdr", writer.register_schema(name, "ros2msg", definition.encode())
            )
        schema = writer.register_schema(SCHEMA_NAME, "jsonschema", json.dumps(SCHEMA).encode())
        channels[TOPIC] = writer.register_channel(TOPIC, "json", schema)
        for t_ns, topic, data in merge(imu_records(folder), fix_records(folder), range_records(folder)):
            writer.add_message(channels[topic], log_time=t_ns, publish_time=t_ns, data=data)
        writer.finish()


def write_reference(folder: Path, path: Path) -> None:
    rows = read_numbers(folder / "RTK1105.csv")
    lla = lla_from_ecef(rows[:, 1:4])
    lines = ["t_gps_ns,lat_deg,lon_deg,height_m,status"]
    for t_ns, (lat, lon, height), quality in zip(gps_from_week_tow(WEEK, rows[:, 0]).tolist(), lla, rows[:, 4], strict=True):
        lines.append(f"{t_ns},{np.degrees(lat):.9f},{np.degrees(lon):.9f},{height:.4f},{STATUS[int(quality)]}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with the original files")
    folder = parser.parse_args().folder
    write_mcap(folder, HERE / "tsukishima_2020.mcap")
    write_reference(folder, HERE / "rtk.csv")


if __name__ == "__main__":
    main()
