"""Text files and MATLAB matrices whose columns the configuration names (``[[input.csv]]``)."""

from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from importers.rows.clock import count_ns, gps_from_gps_unix, is_time, unwrap_weeks
from importers.rows.log import Table
from importers.rows.tables import NO_FIX, diagonal_covariance, drop_absurd, status_codes
from importers.settings import Column, CsvMapping, CsvTime
from importers.text.csv_ranges import range_columns
from importers.text.table import Selection, TextTable, parse_text, read_bytes, select_columns
from navreplay.geodesy.earth import lla_from_ecef
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_tai, gps_from_utc, gps_from_week_tow
from navreplay.timeline import FixStatus, LogError, Times

__all__ = ["find_mapping", "read_mapped"]

_UNIT_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_STATUS = {"none": NO_FIX} | {status.name.lower(): int(status) for status in FixStatus}
_TEXTS = ("status", "sat", "signal")
_GROUPS = {
    "gyro": ("gyro_x", "gyro_y", "gyro_z"),
    "accel": ("accel_x", "accel_y", "accel_z"),
    "lla": ("lat", "lon", "height"),
    "ecef": ("ecef_x", "ecef_y", "ecef_z"),
    "vel_n": ("vel_n", "vel_e", "vel_d"),
    "vel_neu": ("vel_n", "vel_e", "vel_u"),
    "vel_ecef": ("vel_ecef_x", "vel_ecef_y", "vel_ecef_z"),
    "std_pos": ("std_n", "std_e", "std_d"),
    "std_vel": ("std_vn", "std_ve", "std_vd"),
    "std_att": ("std_att_x", "std_att_y", "std_att_z"),
    "euler": ("roll", "pitch", "yaw"),
    "q_nb": ("q_w", "q_x", "q_y", "q_z"),
}
_NEEDED = {
    "imu": (("gyro", "accel"),),
    "fix": (("lla",), ("ecef",)),
    "velocity": (("vel_n",), ("vel_neu",), ("vel_ecef",)),
    "attitude": (("euler",), ("q_nb",), ("yaw",)),
    "reference": (("lla",), ("ecef",)),
}


def find_mapping(path: str, mappings: tuple[CsvMapping, ...]) -> CsvMapping | None:
    """The first mapping whose pattern the file's name fits."""
    return next((mapping for mapping in mappings if fnmatch(Path(path).name, mapping.match)), None)


def read_mapped(path: str, mapping: CsvMapping, gps_week: int | None, leap: LeapSeconds) -> Table:
    """A file read as its mapping says. Raises LogError where a named column is missing or a group of columns is incomplete."""
    text = _read_matrix(path, mapping) if mapping.variable else _read_lines(path, mapping)
    place = f"{path}: the mapping for '{mapping.match}'"
    numbers = {str(quantity): _find_column(text, column, place) for quantity, column in mapping.columns.items()}
    texts = {key: numbers.pop(key) for key in _TEXTS if key in numbers} if mapping.variable is None else {}
    time_columns = mapping.time.column if isinstance(mapping.time.column, tuple) else (mapping.time.column,)
    times = {f"time {i}": _find_column(text, column, place) for i, column in enumerate(time_columns)}
    dated = mapping.time.base.startswith("datetime")
    (texts if dated else numbers).update(times)
    if mapping.time.week_column is not None:
        numbers["week"] = _find_column(text, mapping.time.week_column, place)
    counted = list(times) if not dated and mapping.time.unit == "ns" and mapping.variable is None else []
    selection = select_columns(text, numbers, texts, counted)
    if selection.read == 0:
        raise LogError(f"{path}: the file holds no rows")
    t_ns, timed = _read_times(selection, mapping.time, gps_week, leap, place)
    out = _build_columns(selection, mapping, timed, place)
    rejected = dict(selection.rejected)
    if not timed.all():
        rejected["no time"] = int((~timed).sum())
    return Table(t_ns, out | {"t_gps_ns": t_ns}, selection.read, rejected)


def _read_lines(path: str, mapping: CsvMapping) -> TextTable:
    return parse_text(read_bytes(path), mapping.delimiter, mapping.header, mapping.skip_rows, mapping.comment)


def _read_matrix(path: str, mapping: CsvMapping) -> TextTable:
    import pandas as pd
    from scipy.io import loadmat  # here, because few logs are MATLAB files and it takes a while to import
    from scipy.io.matlab import MatReadError

    try:
        variables = loadmat(path)
    except (OSError, ValueError, MatReadError, NotImplementedError) as error:
        raise LogError(f"{path}: cannot be read as a MATLAB file (version 7 or older): {error}") from error
    matrix = variables.get(mapping.variable)
    if not isinstance(matrix, np.ndarray) or matrix.ndim != 2 or matrix.dtype.kind not in "fiu":
        names = ", ".join(name for name in variables if not name.startswith("__"))
        raise LogError(f"{path}: has no numeric matrix {mapping.variable}; its variables are {names}")
    return TextTable((), pd.DataFrame(matrix), len(matrix), {})


def _find_column(text: TextTable, column: Column, place: str) -> int:
    width = text.frame.shape[1]
    if isinstance(column, str):
        if column not in text.names:
            there = ", ".join(text.names) or f"{width} columns without names"
            raise LogError(f"{place} names the column '{column}', but the file has {there}")
        place_in_line = text.names.index(column)
        if place_in_line >= width and not text.frame.empty:
            raise LogError(f"{place} names the column '{column}', but most lines of the file have only {width} fields")
        return place_in_line
    if column > width and not text.frame.empty:
        raise LogError(f"{place} names column {column}, but the file has {width} columns")
    return column - 1


def _read_times(
    selection: Selection, time: CsvTime, gps_week: int | None, leap: LeapSeconds, place: str
) -> tuple[Times, np.ndarray]:
    """GPS time of the rows that have one, and which these are."""
    parts = [selection.columns[name] for name in selection.columns if name.startswith("time ")]
    if time.base.startswith("datetime"):
        import pandas as pd

        joined = pd.Series(parts[0] if len(parts) == 1 else [" ".join(pieces) for pieces in zip(*parts, strict=True)])
        stamps = pd.to_datetime(joined, format="mixed", errors="coerce", utc=True)
        timed = stamps.notna().to_numpy()
        unix_ns = stamps[timed].dt.tz_localize(None).to_numpy().astype("datetime64[ns]").astype(np.int64)
        return (gps_from_utc(unix_ns, leap) if time.base == "datetime_utc" else gps_from_gps_unix(unix_ns)), timed
    timed = is_time(parts[0], time.unit)
    if "week" in selection.columns:
        timed &= is_time(selection.columns["week"])
    count = parts[0][timed]
    if time.base == "gps_tow":
        tow_s = count * _UNIT_S[time.unit]
        stated = selection.columns.get("week")
        week = unwrap_weeks(gps_week, tow_s, place) if stated is None else stated[timed].astype(np.int64)
        return gps_from_week_tow(week, tow_s), timed
    ns = count_ns(count, time.unit)
    if time.base in ("gps", "boot"):
        return ns, timed
    if time.base == "gps_unix":
        return gps_from_gps_unix(ns), timed
    return (gps_from_utc(ns, leap) if time.base == "utc" else gps_from_tai(ns)), timed


def _build_columns(selection: Selection, mapping: CsvMapping, timed: np.ndarray, place: str) -> dict[str, np.ndarray]:
    columns = {name: values[timed] for name, values in selection.columns.items()}
    if mapping.role == "range":
        return range_columns(columns, mapping, place)
    out: dict[str, np.ndarray] = {
        key: drop_absurd(np.column_stack([columns[name] for name in names]).astype(np.float64))
        for key, names in _GROUPS.items()
        if columns.keys() >= set(names)
    }
    if mapping.role == "attitude" and "yaw" in columns and "euler" not in out:
        out["euler"] = np.column_stack([np.zeros(len(columns["yaw"]))] * 2 + [columns["yaw"]])
        out["yaw"] = columns["yaw"]
    if not any(out.keys() >= set(keys) for keys in _NEEDED[mapping.role]):
        wanted = " or ".join(", ".join(_GROUPS.get(key, (key,))) for keys in _NEEDED[mapping.role] for key in keys)
        raise LogError(f"{place} has the role {mapping.role}, which needs the columns {wanted}")
    angle = np.pi / 180 if mapping.angle_unit == "deg" else 1.0
    if "lla" in out:
        out["lla"] = out["lla"] * [angle, angle, 1.0]
    if "ecef" in out:
        out["lla"] = lla_from_ecef(out.pop("ecef"))
    if "vel_neu" in out:
        out["vel_n"] = out.pop("vel_neu") * [1.0, 1.0, -1.0]
    if "euler" in out:
        out["q_nb"] = quat_from_euler(*(out.pop("euler") * angle).T)
    if "std_att" in out:
        out["std_att"] = out["std_att"] * angle
    for key, cov in (("std_pos", "cov_pos"), ("std_vel", "cov_vel"), ("std_att", "cov_att")):
        if key in out:
            out[cov] = diagonal_covariance(out.pop(key))
    if "status" in columns:
        out["status"] = status_codes(columns["status"], {text: _STATUS[kind] for text, kind in mapping.status.items()})
    out.pop("yaw", None)
    return out
