"""A log in memory, for tests of what becomes of messages once they are decoded."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from importers.load import build_timeline
from importers.roles.selection import choose_channels
from importers.rows.log import Channel, Table
from importers.settings import InputSettings
from navreplay.timeline import Timeline

T0_UNIX_S = 1_752_000_000
T0_GPS_NS = (T0_UNIX_S - 315_964_800 + 18) * 10**9


@dataclass
class MemoryLog:
    path: str
    tables: dict[str, tuple[str, Table]]
    format: str = "memory"
    notes: tuple[str, ...] = field(default=())

    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, type, "memory", table.read) for name, (type, table) in self.tables.items())

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        return {name: self.tables[name][1] for name in names}


def load_tables(folder: Path, tables: dict[str, tuple[str, Table]], settings: dict[str, object] | None = None) -> Timeline:
    """The timeline of channels in one log, by channel: type and table."""
    path = folder / "memory.log"
    path.write_bytes(b"memory")
    log = MemoryLog(str(path), tables)
    options = InputSettings.model_validate(settings or {})
    choices = choose_channels([log], options, None)
    read = {(id(log), choice.channel.name): tables[choice.channel.name][1] for choice in choices}
    return build_timeline([log], choices, read, options)


def stamps(n: int, rate_hz: float, start_s: float = 0.0) -> np.ndarray:
    return T0_UNIX_S * 10**9 + np.rint((start_s + np.arange(n) / rate_hz) * 1e9).astype(np.int64)


def imu_table(n: int = 200, **changed: np.ndarray) -> Table:
    """A level IMU at rest, as a ROS driver tells it: forward, left, up."""
    t = stamps(n, 100)
    columns = {
        "header.stamp": t,
        "angular_velocity": np.tile([0.01, 0.02, 0.03], (n, 1)),
        "linear_acceleration": np.tile([0.1, 0.2, 9.8], (n, 1)),
    } | changed
    return Table(np.array(columns["header.stamp"]), columns, n)


def fix_table(n: int = 10, **changed: np.ndarray) -> Table:
    """A receiver moving east at 10 m/s, once a second."""
    columns = {
        "header.stamp": stamps(n, 1),
        "latitude": np.full(n, 40.0),
        "longitude": -105.0 + np.arange(n) * 10 / (6386897.5 * np.cos(np.radians(40.0))) * 180 / np.pi,
        "altitude": np.full(n, 1600.0),
        "position_covariance": np.tile(np.diag([1.0, 4.0, 9.0]).ravel(), (n, 1)),
        "position_covariance_type": np.full(n, 3),
        "status.status": np.zeros(n, dtype=np.int8),
    } | changed
    return Table(np.array(columns["header.stamp"]), columns, n)


IMU = "sensor_msgs/msg/Imu"
FIX = "sensor_msgs/msg/NavSatFix"
TWIST = "geometry_msgs/msg/TwistStamped"
