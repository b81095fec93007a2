"""Series of a log as serialised ROS messages, packed by the column.

sensor_msgs/Imu on /imu/data, sensor_msgs/NavSatFix on /gnss/fix, geometry_msgs/TwistStamped (velocity in ENU) on /gnss/vel,
geometry_msgs/QuaternionStamped (body to Earth-fixed axes) on /stars/attitude.
ROS conventions (REP 103, REP 145): UTC stamps, forward-left-up body axes, east-north-up covariances, ellipsoidal altitude; a
first covariance element of -1 says that there is no orientation. What ROS cannot hold: TwistStamped and QuaternionStamped have
no covariance, and NavSatFix.status knows only 0 (fix: SINGLE, and UNKNOWN, DEAD_RECKONING for want of a better), 1
(satellite-based augmentation: DIFFERENTIAL) and 2 (ground-based augmentation: FLOAT, FIXED).

All these messages have a fixed layout as long as frame_id does not change, so that a structured array is the serialised
form: CDR (OMG DDSI-RTPS, 10.2) aligns every number to its size behind a header of four bytes, ROS 1 packs them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from navreplay.geodesy.rotation import enu_from_ned, flu_from_frd, frd_from_flu_body, scalar_last_from_first
from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.timeline import AttitudeSeries, FixStatus, GnssFixSeries, ImuSeries, Times
from synthetic_logs.simulation import SyntheticLog

__all__ = ["Encoding", "Messages", "in_time_order", "messages_of"]

Encoding = Literal["cdr", "ros1"]

_S = 1_000_000_000
_GPS_SERVICE = 1
_COVARIANCE_KNOWN = 3
_NAVSAT_STATUS = {
    FixStatus.UNKNOWN: 0,
    FixStatus.SINGLE: 0,
    FixStatus.DIFFERENTIAL: 1,
    FixStatus.FLOAT: 2,
    FixStatus.FIXED: 2,
    FixStatus.DEAD_RECKONING: 0,
}


@dataclass(frozen=True, eq=False, slots=True)
class Messages:
    """Messages of one topic. type: ROS 2 name. t_ns: (n,) [UTC ns]. rows: (n,) structured array of serialised messages."""

    topic: str
    type: str
    t_ns: Times
    rows: np.ndarray[Any, np.dtype[np.void]]


def messages_of(log: SyntheticLog, encoding: Encoding) -> tuple[Messages, ...]:
    """All topics of a log but for its ranges; without those of fixes, velocity or attitudes where it has none."""
    topics = [_imu(log.imu, encoding)]
    if log.fixes is not None:
        topics.append(_fixes(log.fixes, encoding))
        if log.fixes.has_velocity.any():
            topics.append(_velocities(log.fixes, encoding))
    if log.attitude is not None:
        topics.append(_attitudes(log.attitude, encoding))
    return tuple(topics)


def in_time_order(topics: tuple[Messages, ...]) -> Iterator[tuple[int, int, bytes]]:
    """Index of the topic, time [UTC ns] and serialised message, merged in the order of time."""
    raw = [topic.rows.tobytes() for topic in topics]
    sizes = [topic.rows.itemsize for topic in topics]
    t_ns = np.concatenate([topic.t_ns for topic in topics])
    topic_index = np.repeat(np.arange(len(topics)), [len(topic.t_ns) for topic in topics])
    row_index = np.concatenate([np.arange(len(topic.t_ns)) for topic in topics])
    order = np.argsort(t_ns, kind="stable")
    for time, topic, row in zip(t_ns[order].tolist(), topic_index[order].tolist(), row_index[order].tolist(), strict=True):
        size = sizes[topic]
        yield topic, time, raw[topic][row * size : (row + 1) * size]


def _imu(imu: ImuSeries, encoding: Encoding) -> Messages:
    n = len(imu)
    unknown = np.zeros((n, 9))
    no_orientation = unknown.copy()
    no_orientation[:, 0] = -1
    fields: dict[str, np.ndarray] = {
        "orientation": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
        "orientation_covariance": no_orientation,
        "angular_velocity": flu_from_frd(imu.gyro),
        "angular_velocity_covariance": unknown,
        "linear_acceleration": flu_from_frd(imu.accel),
        "linear_acceleration_covariance": unknown,
    }
    return _messages("/imu/data", "sensor_msgs/msg/Imu", imu.t_ns, "imu", fields, encoding)


def _fixes(fixes: GnssFixSeries, encoding: Encoding) -> Messages:
    n = len(fixes)
    rotated = enu_from_ned(np.swapaxes(enu_from_ned(fixes.cov_pos), 1, 2))
    fields: dict[str, np.ndarray] = {
        "status": np.array([_NAVSAT_STATUS[FixStatus(status)] for status in fixes.status.tolist()], dtype=np.int8),
        "service": np.full(n, _GPS_SERVICE, dtype=np.uint16),
        "latitude": np.degrees(fixes.lla[:, 0]),
        "longitude": np.degrees(fixes.lla[:, 1]),
        "altitude": fixes.lla[:, 2],
        "position_covariance": rotated.reshape(n, 9),
        "position_covariance_type": np.full(n, _COVARIANCE_KNOWN, dtype=np.uint8),
    }
    return _messages("/gnss/fix", "sensor_msgs/msg/NavSatFix", fixes.t_ns, "gnss", fields, encoding)


def _velocities(fixes: GnssFixSeries, encoding: Encoding) -> Messages:
    known = fixes.has_velocity
    linear = enu_from_ned(fixes.vel_n[known])
    fields: dict[str, np.ndarray] = {"linear": linear, "angular": np.zeros_like(linear)}
    return _messages("/gnss/vel", "geometry_msgs/msg/TwistStamped", fixes.t_ns[known], "enu", fields, encoding)


def _attitudes(attitude: AttitudeSeries, encoding: Encoding) -> Messages:
    fields: dict[str, np.ndarray] = {"quaternion": scalar_last_from_first(frd_from_flu_body(attitude.q))}
    return _messages("/stars/attitude", "geometry_msgs/msg/QuaternionStamped", attitude.t_ns, "ecef", fields, encoding)


def _messages(
    topic: str, type_: str, t_ns: Times, frame: str, fields: Mapping[str, np.ndarray], encoding: Encoding
) -> Messages:
    utc_ns = utc_from_gps(t_ns)
    columns = {**_header(utc_ns, frame, encoding), **fields}
    rows = np.zeros(len(t_ns), dtype=_layout(columns, encoding))
    for name, column in columns.items():
        rows[name] = column
    return Messages(topic, type_, utc_ns, rows)


def _header(utc_ns: Times, frame: str, encoding: Encoding) -> dict[str, np.ndarray]:
    n = len(utc_ns)
    text = frame.encode() + (b"\0" if encoding == "cdr" else b"")
    sequence = {"seq": np.arange(n, dtype=np.uint32)} if encoding == "ros1" else {"cdr": np.full(n, 0x0100, dtype="<u4")}
    return {
        **sequence,
        "sec": (utc_ns // _S).astype("<u4"),
        "nanosec": (utc_ns % _S).astype("<u4"),
        "frame_length": np.full(n, len(text), dtype="<u4"),
        "frame_id": np.full(n, text, dtype=f"S{len(text)}"),
    }


def _layout(columns: Mapping[str, np.ndarray], encoding: Encoding) -> np.dtype[np.void]:
    formats, offsets, end = [], [], 0
    for column in columns.values():
        dtype = column.dtype.newbyteorder("<")
        if encoding == "cdr" and dtype.kind != "S":
            # the encapsulation header does not count for alignment
            end += -(end - 4) % dtype.itemsize
        formats.append((dtype, column.shape[1:]))
        offsets.append(end)
        end += dtype.itemsize * int(np.prod(column.shape[1:]))
    return np.dtype({"names": list(columns), "formats": formats, "offsets": offsets, "itemsize": end})
