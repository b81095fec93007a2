"""Messages of any type as rows, by a mapping of their fields (``[[input.message]]``, or what is known of a driver)."""

import re
from collections.abc import Mapping

import numpy as np

from importers.message_settings import MessageMapping, MessageTime
from importers.quantities import unit_factor
from importers.rows.axes import axes_matrix
from importers.rows.clock import count_ns, gps_from_gps_unix, gps_from_stamps, is_time
from importers.rows.log import Table
from importers.rows.message_fields import find_field, numbers_of
from importers.rows.tables import NO_FIX, diagonal_covariance, drop_absurd, status_codes
from importers.rows.vehicle_columns import baro_columns, wheel_columns
from navreplay.geodesy.earth import ecef_from_lla, lla_from_ecef, matrix_en
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc, gps_from_week_tow
from navreplay.timeline import FixStatus, Floats, LogError, Times

__all__ = ["fits_fields", "map_table"]

_STATUS = {"none": NO_FIX} | {status.name.lower(): int(status) for status in FixStatus}
_BITS = re.compile(r"\s*(\S+)\s*&\s*(\d+)\s*")
_ANGLES = {"lat", "lon", "lat_plus", "lon_plus", "course", "roll", "pitch", "yaw", "std_att_x", "std_att_y", "std_att_z"}
_FAMILIES = {"gyro": ("gyro_",), "accel": ("accel_",), "vel": ("vel_", "speed", "std_v")}
_XYZ = ("x", "y", "z")
_NEEDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "imu": (("gyro", "accel"),),
    "fix": (("lla",),),
    "velocity": (("vel_n",), ("vel_ecef",)),
    "attitude": (("q_nb",),),
    "reference": (("lla",),),
    "speed": (("wheels",), ("ticks",)),
    "baro": (("baro",),),
}
_WEEK_S = 604_800


def fits_fields(table: Table, mapping: MessageMapping) -> bool:
    """Whether the messages have all the fields that the mapping names."""
    return all(_field(table.columns, path) is not None for path in mapping.columns.values())


def map_table(table: Table, mapping: MessageMapping, leap: LeapSeconds, place: str) -> Table:
    """The table with columns as rows are made of: ``gyro``, ``accel``, ``lla``, ``vel_n``, ``cov_pos`` ..., and its time.

    Raises LogError, naming place, where a named field is missing or a group of fields is incomplete.
    """
    n = len(table.log_time_ns)
    fields: dict[str, np.ndarray] = {}
    for quantity, path in mapping.columns.items():
        column = _field(table.columns, path)
        if column is None:
            there = ", ".join(table.columns) or "no fields"
            raise LogError(f"{place} names the field '{path}' ({quantity}), but its messages have {there}")
        fields[str(quantity)] = column
    status = fields.pop("status", None)
    values = {name: drop_absurd(numbers_of(column) * _factor(mapping, name)) for name, column in fields.items()}
    columns = _rows(values, mapping, n)
    if not any(columns.keys() >= set(keys) for keys in _NEEDED[mapping.role]):
        wanted = " or ".join(" and ".join(keys) for keys in _NEEDED[mapping.role])
        raise LogError(f"{place} has the role {mapping.role}, which needs all parts of {wanted}; it has {', '.join(values)}")
    if status is not None:
        meant = {text: _STATUS[kind] for text, kind in mapping.status.items()}
        columns["status"] = status_codes(status, meant)
    no_fix = _without_fix(table.columns, mapping, n)
    if no_fix.any():
        columns["status"] = np.where(no_fix, NO_FIX, columns.get("status", np.zeros(n, dtype=np.int8))).astype(np.int8)
    return _timed(table, columns, mapping, leap, place)


def _field(columns: Mapping[str, np.ndarray], path: str) -> np.ndarray | None:
    """The column of a field, some bits of it (``flags & 192``), or of one spelt with or without underscores and capitals."""
    bits = _BITS.fullmatch(path)
    if bits is not None:
        whole = _field(columns, bits.group(1))
        return None if whole is None else whole.astype(np.int64) & int(bits.group(2))
    found = find_field(columns, path)
    return found if found is not None else find_field({_plain(name): column for name, column in columns.items()}, _plain(path))


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _factor(mapping: MessageMapping, quantity: str) -> float:
    """From the unit of a field to SI and radians."""
    family = next((key for key, starts in _FAMILIES.items() if quantity.startswith(starts)), quantity)
    text = mapping.units.get(quantity) or mapping.units.get(family)
    if text is not None:
        return unit_factor(text)
    return unit_factor("deg") if quantity in _ANGLES and mapping.angle_unit == "deg" else 1.0


def _rows(values: dict[str, Floats], mapping: MessageMapping, n: int) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {}
    for key in ("gyro", "accel"):
        if (vector := _vector(values, [f"{key}_{axis}" for axis in _XYZ])) is not None:
            out[key] = vector @ axes_matrix(mapping.axes).T
    if mapping.role == "speed":
        return out | wheel_columns(values)
    if mapping.role == "baro":
        return out | baro_columns(values)
    lla = _positions(values, mapping, n)
    if lla is not None:
        out["lla"] = lla
    out |= _velocities(values)
    if "yaw" in values:
        out["q_nb"] = quat_from_euler(*(values.get(name, np.zeros(n)) for name in ("roll", "pitch", "yaw")))
    elif (q := _vector(values, ["q_w", "q_x", "q_y", "q_z"])) is not None:
        out["q_nb"] = q
    return out | _accuracies(values)


def _vector(values: Mapping[str, Floats], names: list[str]) -> Floats | None:
    """Columns (n, k) of names, None where one is missing."""
    return np.column_stack([values[name] for name in names]) if values.keys() >= set(names) else None


def _positions(values: Mapping[str, Floats], mapping: MessageMapping, n: int) -> Floats | None:
    """Geodetic positions (n, 3) of geodetic, Earth-fixed or local ones; an unknown height is NaN."""
    if (ecef := _vector(values, ["ecef_x", "ecef_y", "ecef_z"])) is not None:
        return np.where(np.linalg.norm(ecef, axis=1, keepdims=True) > 1e6, lla_from_ecef(ecef), np.nan)
    if (local := _vector(values, ["east", "north"])) is not None and mapping.origin_deg_m is not None:
        return _from_local(np.column_stack([local, values.get("up", np.full(n, np.nan))]), np.array(mapping.origin_deg_m))
    if not values.keys() >= {"lat", "lon"}:
        return None
    parts = [values[name] + np.nan_to_num(values.get(f"{name}_plus", np.zeros(n))) for name in ("lat", "lon")]
    height = values.get("height", np.full(n, np.nan)) + values.get("height_plus", np.zeros(n))
    return np.column_stack([*parts, height])


def _from_local(enu: Floats, origin_deg_m: Floats) -> Floats:
    """Geodetic positions (n, 3) of local east, north, up (n, 3) [m]; the height is NaN where up is."""
    origin = origin_deg_m * [np.pi / 180, np.pi / 180, 1.0]
    ned = np.column_stack([enu[:, 1], enu[:, 0], -np.nan_to_num(enu[:, 2])])
    lla = lla_from_ecef(ecef_from_lla(origin) + ned @ matrix_en(origin[0], origin[1]).T)
    lla[np.isnan(enu[:, 2]), 2] = np.nan
    return lla


def _velocities(values: dict[str, Floats]) -> dict[str, np.ndarray]:
    if (ecef := _vector(values, [f"vel_ecef_{axis}" for axis in _XYZ])) is not None:
        return {"vel_ecef": ecef}
    if values.keys() >= {"speed", "course"}:
        values = values | {
            "vel_n": values["speed"] * np.cos(values["course"]),
            "vel_e": values["speed"] * np.sin(values["course"]),
        }
    if "vel_u" in values:
        values = values | {"vel_d": -values["vel_u"]}
    if values.keys() >= {"vel_n", "vel_e"} and "vel_d" not in values:
        values = values | {"vel_d": np.zeros(len(values["vel_n"]))}  # vetting tells a vertical part that is never filled
    vel = _vector(values, ["vel_n", "vel_e", "vel_d"])
    return {} if vel is None else {"vel_n": vel}


def _accuracies(values: dict[str, Floats]) -> dict[str, np.ndarray]:
    """Covariances by the standard deviations, or variances, of all three axes."""
    std = dict(values)
    for quantity, variance in values.items():
        if quantity.startswith("var_"):
            std[quantity.replace("var_", "std_")] = np.sqrt(np.where(variance > 0, variance, np.nan))
    std |= {name: values["std_h"] for name in ("std_n", "std_e") if "std_h" in values}
    std |= {name: values["std_vel"] for name in ("std_vn", "std_ve", "std_vd") if "std_vel" in values}
    out = {}
    for key, axes in (("cov_pos", ("n", "e", "d")), ("cov_vel", ("vn", "ve", "vd")), ("cov_att", ("att_x", "att_y", "att_z"))):
        if (three := _vector(std, [f"std_{axis}" for axis in axes])) is not None:
            out[key] = diagonal_covariance(three)
    return out


def _without_fix(columns: Mapping[str, np.ndarray], mapping: MessageMapping, n: int) -> np.ndarray:
    none = np.zeros(n, dtype=bool)
    for path, values in mapping.no_fix.items():
        column = _field(columns, path)
        if column is not None:
            none |= np.isin(numbers_of(column), values)
    return none


def _timed(table: Table, columns: dict[str, np.ndarray], mapping: MessageMapping, leap: LeapSeconds, place: str) -> Table:
    """The table with the time that the mapping says (rows without one are rejected), or with its header's stamps."""
    own = {name: table.columns[name] for name in ("header.stamp", "timestamp", "stamp") if name in table.columns}
    if mapping.time is None:
        return _with_means(Table(table.log_time_ns, own | columns, table.read, table.rejected), mapping)
    count = _field(table.columns, mapping.time.column)
    if count is None:
        raise LogError(f"{place} names the field '{mapping.time.column}' (time), but its messages do not have it")
    if count.dtype.kind not in "iuf":
        count = numbers_of(count)
    timed = is_time(count, mapping.time.unit) if count.dtype.kind == "f" else np.ones(len(count), dtype=bool)
    columns = {name: column[timed] for name, column in columns.items()}
    log_time_ns = table.log_time_ns[timed]
    if mapping.time.base == "auto":
        columns["stamp"] = count_ns(count[timed], mapping.time.unit)
    else:
        columns["t_gps_ns"] = _gps_time(table, mapping.time, count, timed, leap)
    rejected = dict(table.rejected) | ({"no time": int((~timed).sum())} if not timed.all() else {})
    return _with_means(Table(log_time_ns, columns, table.read, rejected), mapping)


def _gps_time(table: Table, time: MessageTime, count: np.ndarray, timed: np.ndarray, leap: LeapSeconds) -> Times:
    ns = count_ns(count[timed], time.unit)
    if time.base == "gps_tow":
        week = _field(table.columns, time.week_column) if time.week_column is not None else None
        if week is not None:
            return gps_from_week_tow(week[timed].astype(np.int64), 0.0) + ns
        recorded = gps_from_utc(table.log_time_ns[timed], leap)
        weeks = np.rint((recorded - ns) / (_WEEK_S * 1e9)).astype(np.int64)
        return np.asarray(weeks * (_WEEK_S * 10**9) + ns, dtype=np.int64)
    if time.base == "gps":
        return ns
    return gps_from_gps_unix(ns) if time.base == "gps_unix" else gps_from_stamps(ns, time.base, leap)


def _with_means(table: Table, mapping: MessageMapping) -> Table:
    """Increments as means: divided by the time since the last sample, or by the usual one behind a gap."""
    if not mapping.increments or len(table.log_time_ns) < 2:
        return table
    times = next(
        (table.columns[name] for name in ("t_gps_ns", "stamp", "header.stamp") if name in table.columns), table.log_time_ns
    )
    step = np.diff(times) / 1e9
    usual = float(np.median(step))
    interval = np.concatenate([[usual], step])
    interval = np.where((interval > 0.5 * usual) & (interval < 1.5 * usual), interval, usual)[:, None]
    columns = dict(table.columns) | {key: table.columns[key] / interval for key in ("gyro", "accel")}
    return Table(table.log_time_ns, columns, table.read, table.rejected)
