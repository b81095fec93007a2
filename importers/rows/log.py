"""What every reader of a log format offers: channels, and each channel's messages as columns."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from navreplay.timeline import Times

__all__ = ["Channel", "Log", "Table", "local_path"]


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a log. name: the topic, or the file's name where a file is one channel. type: full message type
    (``sensor_msgs/msg/Imu``, ``foxglove.LocationFix``) or the name of a layout. encoding: ``cdr``, ``ros1``, ``json``,
    ``protobuf``, ``text``. count: messages, None where only reading would tell. layout: what its table holds once a mapping
    was applied, empty where the type tells. rank: of several channels that can serve, the lowest goes first. note: what the
    mapping assumes."""

    name: str
    type: str
    encoding: str
    count: int | None
    layout: str = ""
    rank: int = 0
    note: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Table:
    """Messages of one channel as columns of equal length, in file order.

    log_time_ns: (n,) int64 receive time in the file's own base (UTC for ROS), or a copy of the stamps where a format has none.
    columns: by field path. A scalar field is (n,), a fixed array (n, k). ROS and Foxglove conventions: ``header.stamp`` and
    every time or duration an int64 column of nanoseconds; Vector3 and Point (n, 3); Quaternion (n, 4) in the order x, y, z, w;
    covariances (n, 9) or (n, 36) row-major; strings an object column. Nested fields keep their dots
    (``pose.pose.position``, ``twist.twist.linear``, ``status.status``).
    read: messages found in the file. rejected: messages that could not be decoded, count per reason; read = n + rejected.
    notes: sentences on what was recognised while reading.
    """

    log_time_ns: Times
    columns: Mapping[str, np.ndarray]
    read: int
    rejected: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


class Log(Protocol):
    """A log opened for reading. notes: plain sentences on damage found and what was salvaged."""

    path: str
    format: str

    @property
    def notes(self) -> tuple[str, ...]:
        """What is told of damage."""
        ...

    def channels(self) -> tuple[Channel, ...]:
        """All channels, in the order of the file."""
        ...

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """The tables of the named channels, in one pass over the file. Raises LogError for an unknown name."""
        ...


def local_path(log: Log) -> Path:
    """The file or folder of a log that is here; of a fetched one, the copy."""
    return Path(getattr(log, "local", log.path))
