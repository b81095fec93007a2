"""Drafts of mappings for messages of unknown types, by the names and values of their fields."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from importers.meanings.mapped_messages import map_table
from importers.message_settings import MessageMapping
from importers.rows.log import Channel, Table
from navreplay.geodesy.time_scales import LEAP_SECONDS
from navreplay.timeline import Floats, LogError

__all__ = ["Draft", "draft_local", "draft_mapping"]


@dataclass(frozen=True, slots=True)
class Draft:
    """role: what the messages could serve as. lines: the mapping in TOML, with the reason of each key. usable: it reads the
    messages as it stands."""

    role: str
    lines: tuple[str, ...]
    usable: bool


@dataclass(frozen=True, slots=True)
class _Guess:
    """A field for a quantity, the unit its values are in, and why."""

    path: str
    unit: str
    reason: str


_UNIT_ENDS = {
    "deg": "deg", "rad": "rad", "e7": "1e-7 deg", "degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "rads": "rad/s",
    "mps": "m/s", "ms": "m/s", "cmps": "cm/s", "mmps": "mm/s", "kmh": "km/h", "kmph": "km/h", "kn": "kn", "knots": "kn",
    "mps2": "m/s2", "ms2": "m/s2", "mg": "mg", "m": "m", "cm": "cm", "mm": "mm", "ft": "ft",
}  # fmt: skip
_SCALARS = {
    "lat": r"(gps|gnss|pos)?lat(itude)?",
    "lon": r"(gps|gnss|pos)?(lon|long|longitude|lng)",
    "height": r"(gps|gnss|pos)?(height|hgt|hae|alt|altitude|elevation)(ell|ellipsoid|ellipsoidal|wgs84)?",
    "vel_n": r"(vel|velocity|v|speed)(n|north)|north(vel|velocity|speed)",
    "vel_e": r"(vel|velocity|v|speed)(e|east)|east(vel|velocity|speed)",
    "vel_d": r"(vel|velocity|v|speed)(d|down)|down(vel|velocity|speed)",
    "vel_u": r"(vel|velocity|v|speed)(u|up)|up(vel|velocity|speed)|climb|climbrate",
    "speed": r"(ground|g)?speed|sog|speedoverground",
    "course": r"course|cog|track|headingofmotion|headmot|courseoverground",
    "std_h": r"(h|horizontal)(acc|accuracy)|eph",
    "std_d": r"(v|vertical)(acc|accuracy)|epv",
} | {
    f"{kind}_{axis}": rf"({names})({axis}|axis{axis})"
    for axis in "xyz"
    for kind, names in (
        ("gyro", r"gyro|gyroscope|gyr|g|w|omega|rate|angvel|angularrate|angularvelocity|angularvel|angrate"),
        ("accel", r"acc|accel|acceleration|accelerometer|a|f|linearacceleration|linacc|specificforce"),
    )
}  # fmt: skip
_VECTORS = {
    "gyro": r"gyro|gyroscope|gyr|omega|rates?|angvel|angularrates?|angularvelocity|angularvel|angrate",
    "accel": r"acc|accel|acceleration|accelerometer|linearacceleration|linacc|specificforce",
}
_ROLES = (
    ("imu", {f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"}),
    ("fix", {"lat", "lon"}),
    ("velocity", {"vel_n", "vel_e"}),
)
_OPTIONAL = {"height", "vel_n", "vel_e", "vel_d", "vel_u", "speed", "course", "std_h", "std_d"}
_FAMILY = {
    "lat": "angle",
    "lon": "angle",
    "course": "angle",
    "speed": "speed",
    "gyro": "rate",
    "accel": "force",
    "vel": "speed",
}
_DEFAULT = {"angle": "deg", "rate": "rad/s", "force": "m/s2", "speed": "m/s"}
_EARLIEST_NS = 6.3e17
_ABSURD = 1e19
_STAMPS = ("header.stamp", "timestamp", "stamp")
_TIME = re.compile(r".*(time|stamp|tow|utc).*|t(ns|us|ms|s)?")


def draft_mapping(channel: Channel, table: Table) -> Draft | None:
    """A mapping for the messages of a channel; None where their fields suggest none."""
    fields = _numeric_fields(table.columns)
    guesses = _guess(fields)
    role = next((role for role, needed in _ROLES if guesses.keys() >= needed), None)
    if role is None:
        return None
    needed = next(needed for name, needed in _ROLES if name == role)
    guesses = {
        quantity: guess for quantity, guess in guesses.items() if quantity in needed | (_OPTIONAL if role != "imu" else set())
    }
    lines = [f"[[input.message]] # drafted for {channel.type}, by names and values: check units and axes"]
    lines += [f'topic = "{channel.name}"', f'role = "{role}"', "[input.message.columns]"]
    lines += [f'{quantity} = "{guess.path}" # {guess.reason}' for quantity, guess in guesses.items()]
    lines += ["[input.message.units]", *(f'{quantity} = "{guess.unit}"' for quantity, guess in guesses.items())]
    time = None if any(_is_stamp(table.columns.get(name)) for name in _STAMPS) else _guess_time(fields)
    if time is not None:
        column, unit, base, reason = time
        lines += ["[input.message.time]", f'column = "{column}" # {reason}', f'unit = "{unit}"', f'base = "{base}"']
    return Draft(role, tuple(lines), _reads(channel, table, role, guesses, time))


def draft_local(channel: Channel) -> Draft | None:
    """A mapping for positions in a map (nav_msgs/Odometry), whose origin only the user knows; None for other types."""
    if not channel.type.endswith("/Odometry"):
        return None
    columns = {name: f"pose.pose.position.{axis}" for name, axis in zip(("east", "north", "up"), "xyz", strict=True)}
    lines = [
        "[[input.message]] # where these positions come from the GNSS (navsat_transform), they serve as fixes",
        f'topic = "{channel.name}"',
        'role = "fix"',
        "origin_deg_m = [48.0, 11.0, 500.0] # of the map, which is not known here: latitude, longitude [deg], height [m]",
        "[input.message.columns]",
        *(f'{name} = "{path}"' for name, path in columns.items()),
    ]
    return Draft("fix", tuple(lines), False)


def _numeric_fields(columns: Mapping[str, np.ndarray]) -> dict[str, Floats]:
    """Scalar fields (n,) and vectors (n, 3) of numbers, some of which are known."""
    fields = {}
    for name, column in columns.items():
        if column.dtype.kind in "fiu" and (column.ndim == 1 or column.shape[1:] == (3,)):
            values = column.astype(np.float64)
            values = np.where(np.abs(values) < _ABSURD, values, np.nan)
            if np.isfinite(values.reshape(len(values), -1)).all(axis=1).any():
                fields[name] = values
    return fields


def _guess(fields: Mapping[str, Floats]) -> dict[str, _Guess]:
    found: dict[str, _Guess] = {}
    for path, values in fields.items():
        names, unit = _names_and_unit(path)
        if values.ndim == 2:
            kind = _match(_VECTORS, names)
            told = unit or (_unit_of(f"{kind}_x", values) if kind else "")
            for place, axis in enumerate("xyz" if kind else ""):
                found.setdefault(f"{kind}_{axis}", _Guess(f"{path}[{place}]", told, _reason(path, values, told)))
            continue
        quantity = _match(_SCALARS, names)
        if quantity is not None:
            told = unit or _unit_of(quantity, values)
            found.setdefault(quantity, _Guess(path, told, _reason(path, values, told)))
    return _with_family_units(found, fields)


def _match(patterns: Mapping[str, str], names: list[str]) -> str | None:
    """What the longest of the names means, None where none of them means anything."""
    return next((key for name in names for key, pattern in patterns.items() if re.fullmatch(pattern, name)), None)


def _names_and_unit(path: str) -> tuple[list[str], str]:
    """The last words of a path run together, three of them first, and the unit that it ends with."""
    words = [word for word in re.split(r"[._\[\]]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", path).lower()) if word]
    unit = _UNIT_ENDS.get(words[-1], "") if len(words) > 1 else ""
    words = words[:-1] if unit else words
    return ["".join(words[-count:]) for count in (3, 2, 1)], unit


def _unit_of(quantity: str, values: Floats) -> str:
    """The unit that the size of values suggests."""
    family = _FAMILY.get(quantity) or _FAMILY.get(quantity.partition("_")[0], "length")
    size = float(np.nanmedian(np.abs(values))) if values.ndim == 1 else float(np.nanmedian(np.linalg.norm(values, axis=1)))
    whole = bool(np.all(np.nan_to_num(values) == np.rint(np.nan_to_num(values))))
    if family == "angle":
        return "1e-7 deg" if whole and size > 1000 else "deg"
    if family == "rate":
        return "deg/s" if float(np.nanmax(np.abs(values))) > 20 else "rad/s"
    if family == "force":
        return "g" if 0.5 < size < 1.5 else "mg" if 500 < size < 1500 else "m/s2"
    if family == "speed":
        return "mm/s" if whole and size > 200 else "m/s"
    return "mm" if whole and (size > 20_000 or quantity.startswith("std")) else "m"


def _with_family_units(found: dict[str, _Guess], fields: Mapping[str, Floats]) -> dict[str, _Guess]:
    """Scalar accelerations and rates: the unit of all three axes together."""
    for kind in ("gyro", "accel"):
        axes = [f"{kind}_{axis}" for axis in "xyz"]
        if all(axis in found and fields.get(found[axis].path, np.empty((0, 0))).ndim == 1 for axis in axes):
            whole = np.column_stack([fields[found[axis].path] for axis in axes])
            if not any(_names_and_unit(found[axis].path)[1] for axis in axes):
                unit = _unit_of(axes[0], whole)
                found |= {axis: _Guess(found[axis].path, unit, _reason(found[axis].path, whole, unit)) for axis in axes}
    return found


def _reason(path: str, values: Floats, unit: str) -> str:
    size = np.nanmedian(np.abs(values)) if values.ndim == 1 else np.nanmedian(np.linalg.norm(values, axis=1))
    return f"{'median' if values.ndim == 1 else 'median length'} {size:.6g}, so taken as {unit}"


def _is_stamp(column: np.ndarray | None) -> bool:
    """Whether a column holds nanoseconds since 1970, as a header's stamp does."""
    return column is not None and column.dtype.kind in "iu" and float(np.median(column)) > _EARLIEST_NS


def _guess_time(fields: Mapping[str, Floats]) -> tuple[str, str, str, str] | None:
    """Field, unit, base and reason of a time, by the size of its values."""
    for path, values in fields.items():
        plain = path.replace("_", "").lower().rpartition(".")[2]
        if values.ndim != 1 or not _TIME.fullmatch(plain):
            continue
        middle = float(np.nanmedian(values))
        for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
            if 6.3e8 < middle / scale < 4.1e9:
                base = "utc" if middle / scale > 1.5e9 else "gps"
                return path, unit, base, f"median {middle:.6g}: {unit} since {'1970' if base == 'utc' else '1980'}"
        if "tow" in plain and 0 <= middle < 604_800_000:
            unit = "ms" if middle > 604_800 else "s"
            return path, unit, "gps_tow", f"median {middle:.6g}: {unit} of the GPS week"
    return None


def _reads(
    channel: Channel, table: Table, role: str, guesses: Mapping[str, _Guess], time: tuple[str, str, str, str] | None
) -> bool:
    """Whether the drafted mapping reads the messages."""
    columns = {quantity: guess.path for quantity, guess in guesses.items()}
    units = {quantity: guess.unit for quantity, guess in guesses.items()}
    told = {} if time is None else {"time": dict(zip(("column", "unit", "base"), time, strict=False))}
    mapping = MessageMapping.model_validate({"topic": channel.name, "role": role, "columns": columns, "units": units} | told)
    try:
        map_table(table, mapping, LEAP_SECONDS, "draft")
    except LogError:
        return False
    return True
