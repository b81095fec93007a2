"""KF-GINS text files: IMU increments (7 columns) and GNSS positions (7 columns, 13 with velocity), in seconds of the GPS week.

Layout: README of KF-GINS (i2Nav group, Wuhan University).
"""

import numpy as np

from importers.rows.clock import unwrap_weeks
from importers.rows.log import Table
from importers.rows.tables import diagonal_covariance, drop_absurd
from importers.text.table import Selection, parse_text, read_bytes, select_columns
from navreplay.geodesy.time_scales import WEEK_S, gps_from_week_tow
from navreplay.timeline import Floats, LogError

__all__ = ["find_kf_gins", "read_gnss", "read_imu"]

_MOST_FORCE = 20.0
_LONGEST_INCREMENT = 1.5
"""In nominal intervals: an increment behind a longer pause covers one nominal interval, not the pause."""


def find_kf_gins(path: str, head: str) -> str | None:
    """``kf_gins/imu`` or ``kf_gins/gnss`` when the first lines of a file look like one, else None. Raises LogError for
    rows of an inertial sensor that are no increments."""
    rows = [line.split() for line in head.splitlines()[:20] if line.strip() and not line.startswith("#")]
    if len(rows) > 1:
        rows = rows[:-1]
    try:
        values = np.array(rows, dtype=np.float64)
    except ValueError:
        return None
    if values.ndim != 2 or values.shape[1] not in (7, 13) or not ((values[:, 0] >= 0) & (values[:, 0] < WEEK_S)).all():
        return None
    if values.shape[1] == 7 and np.median(np.abs(values[:, 1:]), axis=0).max() < 1.0:
        _check_increments(path, values, rows)
        return "kf_gins/imu"
    on_earth = (np.abs(values[:, 1]) <= 90) & (np.abs(values[:, 2]) <= 180) & (values[:, 4:7] > 0).all(axis=1)
    return "kf_gins/gnss" if on_earth.all() else None


def _check_increments(path: str, values: Floats, rows: list[list[str]]) -> None:
    """Raises LogError where velocity increments would add up to more than gravity."""
    interval = float(np.median(np.diff(values[:, 0]))) if len(values) > 2 else 0.0
    force = float(np.median(np.linalg.norm(values[:, 4:], axis=1))) / interval if interval > 0 else 0.0
    if force > _MOST_FORCE:
        raise LogError(
            f"{path}: has the 7 columns of KF-GINS increments, but its rows, such as '{' '.join(rows[0])}', would be "
            f"{force:.3g} m/s2 where gravity is 9.8; if they are rates and accelerations, say so in an [[input.csv]]: "
            "role = 'imu', time = { column = 1, base = 'gps_tow' }, columns = { gyro_x = 2, gyro_y = 3, gyro_z = 4, "
            "accel_x = 5, accel_y = 6, accel_z = 7 }"
        )


def read_imu(path: str, gps_week: int | None) -> Table:
    """Increments of angle [rad] and velocity [m/s] in FRD axes, as means over their intervals. Raises LogError."""
    selection = _read(path, 7)
    values = _values(selection, 7)
    interval = np.diff(values[:, 0], prepend=np.nan)
    nominal = float(np.nanmedian(interval)) if len(values) > 1 else 1.0
    usual = (interval > 0) & (interval < _LONGEST_INCREMENT * nominal)
    rates = values[:, 1:] / np.where(usual, interval, nominal)[:, None]
    return _table(path, selection, gps_week, values[:, 0], {"gyro": rates[:, :3], "accel": rates[:, 3:]})


def read_gnss(path: str, gps_week: int | None) -> Table:
    """Positions [deg, deg, m] with standard deviations, and velocities where the file has them. Raises LogError."""
    width = 13 if parse_text(read_bytes(path), " ", False, comment="#").frame.shape[1] == 13 else 7
    selection = _read(path, width)
    values = _values(selection, width)
    out = {"lla": values[:, 1:4] * [np.pi / 180, np.pi / 180, 1.0], "cov_pos": diagonal_covariance(values[:, 4:7])}
    if width == 13:
        out |= {"vel_n": values[:, 7:10], "cov_vel": diagonal_covariance(values[:, 10:13])}
    return _table(path, selection, gps_week, values[:, 0], out)


def _read(path: str, width: int) -> Selection:
    text = parse_text(read_bytes(path), delimiter=" ", header=False, comment="#")
    return select_columns(text, {str(i): i for i in range(width)})


def _values(selection: Selection, width: int) -> Floats:
    """The rows (n, width) that have a time."""
    values = np.column_stack([selection.columns[str(i)] for i in range(width)]).astype(np.float64)
    return drop_absurd(values[(values[:, 0] >= 0) & (values[:, 0] < WEEK_S)])


def _table(path: str, selection: Selection, gps_week: int | None, tow_s: Floats, columns: dict[str, np.ndarray]) -> Table:
    t_ns = gps_from_week_tow(unwrap_weeks(gps_week, tow_s, path), tow_s)
    untimed = len(selection.columns["0"]) - len(tow_s)
    rejected = dict(selection.rejected) | ({"no time": untimed} if untimed else {})
    return Table(t_ns, columns | {"t_gps_ns": t_ns}, selection.read, rejected)
