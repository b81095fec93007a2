"""Files as other programs write them: tables of text, MCAP with JSON or ROS 2 messages, ROS 1 bags, NMEA."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from navreplay.geodesy.time_scales import utc_from_gps

__all__ = [
    "Message",
    "fix_message",
    "imu_message",
    "nmea",
    "twist_message",
    "utc",
    "write_bag",
    "write_json",
    "write_ros",
    "write_table",
]

Message = tuple[str, str, int, Any]
"""Topic, type, time of recording [UTC ns], content."""

_STORE = get_typestore(Stores.ROS2_HUMBLE)
_STORE_1 = get_typestore(Stores.ROS1_NOETIC)


def utc(t_ns: np.ndarray) -> np.ndarray:
    """Nanoseconds since 1970 (n,) of GPS times."""
    return utc_from_gps(t_ns).astype(np.int64)


def write_table(
    path: Path, columns: Mapping[str, Sequence[object]], mark: str = ",", comma: bool = False, header: bool = True
) -> None:
    """A table of text. comma: the decimal comma."""
    rows = [mark.join(_cell(value, comma) for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(([mark.join(columns)] if header else []) + rows) + "\n")


def _cell(value: object, comma: bool) -> str:
    text = value if isinstance(value, str) else repr(value.item() if isinstance(value, np.generic) else value)
    return text.replace(".", ",") if comma else text


def write_json(path: Path, messages: Iterable[Message]) -> None:
    """MCAP with JSON messages."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels: dict[str, int] = {}
        for topic, kind, t_ns, content in sorted(messages, key=lambda message: message[2]):
            if topic not in channels:
                schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], t_ns, json.dumps(content).encode(), t_ns)
        writer.finish()


def write_ros(path: Path, messages: Iterable[Message]) -> None:
    """MCAP with ROS 2 messages; content: a mapping of fields."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for topic, kind, t_ns, content in sorted(messages, key=lambda message: message[2]):
            if topic not in channels:
                definition = _STORE.generate_msgdef(kind, ros_version=2)[0]
                channels[topic] = writer.register_channel(
                    topic, "cdr", writer.register_schema(kind, "ros2msg", definition.encode())
                )
            data = bytes(_STORE.serialize_cdr(_build(_STORE, kind, content), kind))
            writer.add_message(channels[topic], t_ns, data, t_ns)
        writer.finish()


def write_bag(path: Path, messages: Iterable[Message]) -> None:
    """ROS 1 bag; content: a mapping of fields."""
    with BagWriter(path) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, t_ns, content in sorted(messages, key=lambda message: message[2]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=_STORE_1)
            data = _STORE_1.serialize_ros1(_build(_STORE_1, kind, content), kind)
            writer.write(connections[topic], t_ns, data)


def _build(store: Any, kind: str, content: Mapping[str, Any]) -> Any:
    """A message of nested mappings."""
    type_ = store.types[kind]
    values = {}
    for name, (node, detail) in store.fielddefs[kind][1]:
        value = content.get(name)
        if int(node) == 2:  # another message
            value = _build(store, detail, value or {})
        elif value is None:
            value = np.zeros(detail[1]) if int(node) == 3 else "" if detail[0] == "string" else 0
        values[name] = value
    return type_(**values)


def _header(stamp_ns: int, frame: str) -> dict[str, Any]:
    sec, nanosec = divmod(int(stamp_ns), 10**9)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def _vector(values: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", map(float, values), strict=True))


def imu_message(stamp_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> dict[str, Any]:
    """sensor_msgs/Imu without orientation."""
    return {
        "header": _header(stamp_ns, "imu"),
        "orientation_covariance": np.array([-1.0] + [0.0] * 8),
        "angular_velocity": _vector(gyro),
        "linear_acceleration": _vector(accel),
    }


def fix_message(stamp_ns: int, lla: Sequence[float], variances: Sequence[float], status: int = 0) -> dict[str, Any]:
    """sensor_msgs/NavSatFix; lla as the driver writes it, variances east, north, up."""
    return {
        "header": _header(stamp_ns, "gps"),
        "status": {"status": status, "service": 1},
        **dict(zip(("latitude", "longitude", "altitude"), map(float, lla), strict=True)),
        "position_covariance": np.diag(np.array(variances, dtype=np.float64)).ravel(),
        "position_covariance_type": 2,
    }


def twist_message(stamp_ns: int, linear: Sequence[float], frame: str) -> dict[str, Any]:
    """geometry_msgs/TwistStamped."""
    return {"header": _header(stamp_ns, frame), "twist": {"linear": _vector(linear)}}


def nmea(body: str) -> str:
    """A sentence with its checksum."""
    parity = 0
    for letter in body.encode():
        parity ^= letter
    return f"${body}*{parity:02X}"
