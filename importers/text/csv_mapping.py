"""Text files and MATLAB matrices whose columns the configuration names (``[[input.csv]]``)."""

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from importers.rows.clock import gps_from_gps_unix
from importers.rows.log import Table
from importers.rows.tables import NO_FIX, diagonal_covariance, drop_absurd, status_codes
from importers.rows.vehicle_columns import baro_columns, wheel_columns
from importers.settings import Column, CsvMapping, CsvTime
from importers.text.csv_ranges import range_columns
from importers.text.csv_units import in_si
from importers.text.matrices import read_matrices
from importers.text.table import Selection, TextTable, head_cells, parse_text, read_bytes, select_columns
from importers.text.times import check_rounding, read_counts, read_dates, unroll_32_bits
from navreplay.geodesy.earth import lla_from_ecef
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, LogError, Times

__all__ = ["find_mappings", "read_mapped", "unused_tables"]

_LEAST_NS = 1e17
_FASTEST_S = 0.11
"""Rows further apart are those of a receiver, whose repeats mean something else."""
_LEAST_REPEATS = 30
_STATUS = {"none": NO_FIX} | {status.name.lower(): int(status) for status in FixStatus}
_TEXTS = ("status", "sat", "signal", "ns", "ew")
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
    "speed": (("wheels",), ("ticks",)),
    "baro": (("baro",),),
}


def find_mappings(path: str, mappings: tuple[CsvMapping, ...]) -> tuple[CsvMapping, ...]:
    """The first mapping whose pattern the file's name fits, and those for other roles that name the same file or pattern."""
    name = Path(path).name
    fitting = [mapping for mapping in mappings if fnmatch(name, mapping.match)]
    found: dict[str, CsvMapping] = {}
    for mapping in fitting:
        if mapping.match in (fitting[0].match, name):
            found.setdefault(mapping.role, mapping)
    return tuple(found.values())


def unused_tables(paths: Sequence[str], mappings: tuple[CsvMapping, ...]) -> list[str]:
    """Sentences on mappings of the configuration that no file takes."""
    names = [spelt for path in paths for spelt in (Path(path).name, Path(path).stem)]
    used = [mapping for name in names for mapping in find_mappings(name, mappings)]
    told = []
    for mapping in mappings:
        if any(mapping is other for other in used):
            continue
        fits = next((name for name in names if fnmatch(name, mapping.match)), None)
        why = f"fits no file; there is {', '.join(names[::2])}" if fits is None else f"comes behind another that {fits} takes"
        told.append(f"the mapping [[input.csv]] for '{mapping.match}' with the role {mapping.role} is not used: it {why}")
    return told


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
    if not dated and mapping.variable is None:
        check_rounding(head_cells(text, next(iter(times.values()))), mapping.time.unit, place)
    counted = list(times) if not dated and mapping.variable is None and _counts_ns(text, times, mapping.time) else []
    selection = select_columns(text, numbers, texts, counted)
    if selection.read == 0:
        raise LogError(f"{path}: the file holds no rows")
    selection, rolled = _unrolled(selection, mapping.time)
    t_ns, timed = _read_times(selection, mapping.time, gps_week, leap, place)
    out, notes = _build_columns(selection, mapping, timed, place)
    rejected = dict(selection.rejected)
    if not timed.all():
        rejected["no time"] = int((~timed).sum())
    table = Table(t_ns, out | {"t_gps_ns": t_ns}, selection.read, rejected, (*rolled, *notes))
    return _changes(table) if mapping.role == "fix" else table


def _unrolled(selection: Selection, time: CsvTime) -> tuple[Selection, tuple[str, ...]]:
    """The rows with counts that go on where their 32 bits turned over, and a sentence on that."""
    if time.base.startswith("datetime") or time.base == "gps_tow" or "time 0" not in selection.columns:
        return selection, ()
    count, turns = unroll_32_bits(selection.columns["time 0"])
    if not turns:
        return selection, ()
    note = f"its counter of 32 bits turned over {'once' if turns == 1 else f'{turns} times'}; the count goes on there"
    return Selection({**selection.columns, "time 0": count}, selection.read, selection.rejected), (note,)


def _counts_ns(text: TextTable, times: dict[str, int], time: CsvTime) -> bool:
    """Whether times count nanoseconds, which doubles would round."""
    if time.unit != "auto" or text.frame.empty:
        return time.unit == "ns"
    import pandas as pd

    return all(bool(pd.to_numeric(text.frame[i], errors="coerce").abs().median() > _LEAST_NS) for i in times.values())


def _changes(table: Table) -> Table:
    """The fixes where they change, of a table whose rows repeat each until the next, as those that hold an IMU do."""
    n = len(table.log_time_ns)
    values = {key: table.columns[key] for key in ("lla", "vel_n", "vel_ecef") if key in table.columns}
    if n < _LEAST_REPEATS or "lla" not in values:
        return table
    whole = np.nan_to_num(np.column_stack([value.reshape(n, -1) for value in values.values()]), nan=-1.0)
    fresh = np.concatenate([[True], (whole[1:] != whole[:-1]).any(axis=1)])
    known = np.isfinite(values["lla"][:, :2]).all(axis=1)
    interval = float(np.median(np.diff(table.log_time_ns))) / 1e9
    runs = np.diff(np.flatnonzero(np.append(fresh & known, True)))
    if interval > _FASTEST_S or len(runs) < 3 or np.median(runs) < 3:
        return table
    kept = fresh & known
    rejected = dict(table.rejected)
    rejected |= {"repeats the fix before it": int((~fresh & known).sum())} if (~fresh & known).any() else {}
    rejected |= {"no fix in the row": int((~known).sum())} if (~known).any() else {}
    columns = {name: column[kept] for name, column in table.columns.items()}
    note = f"its rows repeat each fix until the next; of {n} the {int(kept.sum())} count where it changes"
    return Table(table.log_time_ns[kept], columns, table.read, rejected, (*table.notes, note))


def _read_lines(path: str, mapping: CsvMapping) -> TextTable:
    return parse_text(read_bytes(path), mapping.delimiter, mapping.header, mapping.skip_rows, mapping.comment)


def _read_matrix(path: str, mapping: CsvMapping) -> TextTable:
    import pandas as pd

    matrices = read_matrices(path)
    matrix = matrices.get(mapping.variable or "")
    if matrix is None:
        there = ", ".join(matrices) or "none"
        raise LogError(f"{path}: has no numeric matrix {mapping.variable}; its numeric matrices are {there}")
    return TextTable((), pd.DataFrame(matrix), len(matrix), {})


def _find_column(text: TextTable, column: Column, place: str) -> int:
    width = text.frame.shape[1]
    if isinstance(column, str):
        place_in_line = _named(text.names, column)
        if place_in_line is None:
            there = ", ".join(text.names) or f"{width} columns without names"
            raise LogError(f"{place} names the column '{column}', but the file has {there}")
        if place_in_line >= width and not text.frame.empty:
            raise LogError(f"{place} names the column '{column}', but most lines of the file have only {width} fields")
        return place_in_line
    if column > width and not text.frame.empty:
        raise LogError(f"{place} names column {column}, but the file has {width} columns")
    return column - 1


def _named(names: tuple[str, ...], column: str) -> int | None:
    """The column of a name, with or without the mark of a comment before it or quotes about it."""
    for spelt in (list(names), [name.strip("#% \"'") for name in names]):
        for wanted in (column, column.strip("#% \"'")):
            if wanted in spelt:
                return spelt.index(wanted)
    return None


def _read_times(
    selection: Selection, time: CsvTime, gps_week: int | None, leap: LeapSeconds, place: str
) -> tuple[Times, np.ndarray]:
    """GPS time of the rows that have one, and which these are."""
    parts = [selection.columns[name] for name in selection.columns if name.startswith("time ")]
    if not time.base.startswith("datetime"):
        return read_counts(parts[0], selection.columns.get("week"), time, gps_week, leap, place)
    joined = parts[0] if len(parts) == 1 else np.array([" ".join(pieces) for pieces in zip(*parts, strict=True)], dtype=object)
    unix_ns, timed = read_dates(joined, time.day_first, place)
    return (gps_from_utc(unix_ns, leap) if time.base == "datetime_utc" else gps_from_gps_unix(unix_ns)), timed


def _build_columns(
    selection: Selection, mapping: CsvMapping, timed: np.ndarray, place: str
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    columns = {name: values[timed] for name, values in selection.columns.items()}
    if mapping.role == "range":
        return range_columns(columns, mapping, place), ()
    columns, notes = in_si(columns, mapping)
    out: dict[str, np.ndarray] = {
        key: drop_absurd(np.column_stack([columns[name] for name in names]).astype(np.float64))
        for key, names in _GROUPS.items()
        if columns.keys() >= set(names)
    }
    if mapping.role == "attitude" and "yaw" in columns and "euler" not in out:
        out["euler"] = np.column_stack([np.zeros(len(columns["yaw"]))] * 2 + [columns["yaw"]])
        out["yaw"] = columns["yaw"]
    if mapping.role == "speed":
        out |= wheel_columns(columns)
    if mapping.role == "baro":
        out |= baro_columns(columns)
    if not any(out.keys() >= set(keys) for keys in _NEEDED[mapping.role]):
        wanted = " or ".join(", ".join(_GROUPS.get(key, (key,))) for keys in _NEEDED[mapping.role] for key in keys)
        raise LogError(f"{place} has the role {mapping.role}, which needs the columns {wanted}")
    if "ecef" in out:
        out["lla"] = lla_from_ecef(out.pop("ecef"))
    if "vel_neu" in out:
        out["vel_n"] = out.pop("vel_neu") * [1.0, 1.0, -1.0]
    if "euler" in out:
        out["q_nb"] = quat_from_euler(*out.pop("euler").T)
    for key, cov in (("std_pos", "cov_pos"), ("std_vel", "cov_vel"), ("std_att", "cov_att")):
        if key in out:
            out[cov] = diagonal_covariance(out.pop(key))
    if "status" in columns:
        out["status"] = status_codes(columns["status"], {text: _STATUS[kind] for text, kind in mapping.status.items()})
    out.pop("yaw", None)
    return out, notes
