"""This program's own CSV layouts, by their header: IMU, fixes, attitudes, trajectories and solutions (docs/formats.md)."""

from collections.abc import Mapping

import numpy as np

from importers.rows.clock import is_time
from importers.rows.log import Table
from importers.rows.tables import diagonal_covariance, drop_absurd, status_codes
from importers.text.table import Selection, parse_text, read_bytes, select_columns
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import FixStatus, LogError

__all__ = ["find_layout", "read_layout"]

_LLA = ("lat_deg", "lon_deg", "height_m")
_VEL = ("vel_n_mps", "vel_e_mps", "vel_d_mps")
_STD = ("std_n_m", "std_e_m", "std_d_m")
_STD_VEL = ("std_vn_mps", "std_ve_mps", "std_vd_mps")
_Q = ("q_nb_w", "q_nb_x", "q_nb_y", "q_nb_z")
_Q_EARTH = ("q_eb_w", "q_eb_x", "q_eb_y", "q_eb_z")
_STD_ATT = ("std_x_rad", "std_y_rad", "std_z_rad")
_EULER = ("roll_deg", "pitch_deg", "yaw_deg")
_GYRO = ("gyro_x_radps", "gyro_y_radps", "gyro_z_radps")
_ACCEL = ("accel_x_mps2", "accel_y_mps2", "accel_z_mps2")
_MEAN_GYRO = tuple(f"mean_{name}" for name in _GYRO)
_MEAN_ACCEL = tuple(f"mean_{name}" for name in _ACCEL)
_WEEK = ("gps_week", "gps_tow_s")

_LAYOUTS: dict[str, tuple[str, ...]] = {
    "navreplay/imu": ("t_gps_ns", *_GYRO, *_ACCEL),
    "navreplay/imu_mean": ("t_gps_ns", *_MEAN_GYRO, *_MEAN_ACCEL),
    "navreplay/trajectory": ("t_gps_ns", *_LLA, *_Q),
    "navreplay/attitude": ("t_gps_ns", *_Q_EARTH),
    "navreplay/fix": ("t_gps_ns", *_LLA),
    "navreplay/range": ("t_gps_ns", "sat", "signal", "pseudorange_m", "sat_x_m"),
    "navreplay/solution": (*_WEEK, *_LLA, *_EULER),
}
"""Required columns by layout; the first that fits is meant."""

_GROUPS: dict[str, tuple[tuple[str, ...], ...]] = {
    "gyro": (_GYRO, _MEAN_GYRO),
    "accel": (_ACCEL, _MEAN_ACCEL),
    "lla": (_LLA,),
    "vel_n": (_VEL,),
    "std_pos": (_STD,),
    "std_vel": (_STD_VEL,),
    "std_att": (_STD_ATT,),
    "q_nb": (_Q,),
    "q_eb": (_Q_EARTH,),
    "euler": (_EULER,),
}
_STATUS = {"": int(FixStatus.UNKNOWN), "nan": int(FixStatus.UNKNOWN)} | {status.name: int(status) for status in FixStatus}


def find_layout(first_line: str) -> str | None:
    """Name of the layout whose columns the header line holds, None when there is none."""
    names = {name.strip() for name in first_line.replace('"', "").split(",")}
    return next((layout for layout, columns in _LAYOUTS.items() if names.issuperset(columns)), None)


def read_layout(path: str, layout: str) -> Table:
    """A file in one of the own layouts. Raises LogError when it cannot be read or holds no rows."""
    text = parse_text(read_bytes(path), delimiter=",", header=True, comment="#")
    index = {name: i for i, name in enumerate(text.names)}
    wanted = {name for group in _GROUPS.values() for columns in group for name in columns} | {"t_gps_ns", *_WEEK}
    with_status = layout == "navreplay/fix" and "status" in index
    selection = select_columns(
        text,
        {name: i for name, i in index.items() if name in wanted and i in text.frame.columns},
        {"status": index["status"]} if with_status else None,
        [name for name in ("t_gps_ns",) if name in index],
    )
    if selection.read == 0:
        raise LogError(f"{path}: the file holds a header but no rows; was the recording stopped before it began?")
    return _build_table(selection)


def _build_table(selection: Selection) -> Table:
    columns, timed = _drop_untimed(selection)
    out: dict[str, np.ndarray] = {}
    for key, choices in _GROUPS.items():
        names = next((names for names in choices if columns.keys() >= set(names)), None)
        if names is not None:
            out[key] = drop_absurd(np.column_stack([columns[name] for name in names]).astype(np.float64))
    if "lla" in out:
        out["lla"] = out["lla"] * [np.pi / 180, np.pi / 180, 1.0]
    if "euler" in out:
        out["q_nb"] = quat_from_euler(*np.radians(out.pop("euler")).T)
    for key, cov in (("std_pos", "cov_pos"), ("std_vel", "cov_vel"), ("std_att", "cov_att")):
        if key in out:
            out[cov] = diagonal_covariance(out.pop(key))
    if "status" in columns:
        out["status"] = status_codes(columns["status"], _STATUS)
    if "t_gps_ns" in columns:
        t_ns = columns["t_gps_ns"].astype(np.int64)
    else:
        t_ns = gps_from_week_tow(columns["gps_week"].astype(np.int64), columns["gps_tow_s"])
    out["t_gps_ns"] = t_ns
    return Table(t_ns, out, selection.read, timed.rejected)


def _drop_untimed(selection: Selection) -> tuple[Mapping[str, np.ndarray], Selection]:
    """Rows without a time cannot be placed; every other empty cell is merely unknown."""
    keys = [key for key in ("t_gps_ns", *_WEEK) if key in selection.columns]
    timed = np.logical_and.reduce([is_time(selection.columns[key], "ns" if key == "t_gps_ns" else "s") for key in keys])
    if timed.all():
        return selection.columns, selection
    columns = {name: values[timed] for name, values in selection.columns.items()}
    rejected = dict(selection.rejected) | {"no time": int((~timed).sum())}
    return columns, Selection(columns, selection.read, rejected)
