"""A log format of one's own: a text that begins with `#steps`, then seconds of GPS time, three rates, three accelerations."""

import numpy as np

from importers.formats import Format
from importers.rows.log import Log, Table
from importers.settings import InputSettings
from importers.text.log import TextLog


def read_steps(path: str) -> Table:
    """Rows of an IMU in forward-right-down [s, rad/s, m/s^2]."""
    rows = np.loadtxt(path, ndmin=2)
    t_ns = np.rint(rows[:, 0] * 1e9).astype(np.int64)
    return Table(t_ns, {"t_gps_ns": t_ns, "gyro": rows[:, 1:4], "accel": rows[:, 4:7]}, len(rows))


def open_steps(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """The log, where the head is of this format."""
    if not head.startswith(b"#steps"):
        return None
    return TextLog(path, "steps", "navreplay/imu", lambda: read_steps(path))


STEPS = Format("steps", "steps of a made-up IMU, as text", (".steps",), open_steps)
