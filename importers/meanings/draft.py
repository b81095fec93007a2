"""Drafts of mappings for messages of unknown types, by the names and values of their fields."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from importers.meanings.mapped_messages import map_table
from importers.message_settings import MessageMapping
from importers.rows.field_names import Guess, guess_quantities, guess_time
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


_ROLES = (
    ("imu", {f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"}),
    ("fix", {"lat", "lon"}),
    ("velocity", {"vel_n", "vel_e"}),
)
_OPTIONAL = {"height", "vel_n", "vel_e", "vel_d", "vel_u", "speed", "course", "std_h", "std_d"}
_EARLIEST_NS = 6.3e17
_ABSURD = 1e19
_STAMPS = ("header.stamp", "timestamp", "stamp")


def draft_mapping(channel: Channel, table: Table) -> Draft | None:
    """A mapping for the messages of a channel; None where their fields suggest none."""
    fields = _numeric_fields(table.columns)
    guesses = guess_quantities(fields)
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
    time = None if any(_is_stamp(table.columns.get(name)) for name in _STAMPS) else guess_time(fields)
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


def _is_stamp(column: np.ndarray | None) -> bool:
    """Whether a column holds nanoseconds since 1970, as a header's stamp does."""
    return column is not None and column.dtype.kind in "iu" and float(np.median(column)) > _EARLIEST_NS


def _reads(
    channel: Channel, table: Table, role: str, guesses: Mapping[str, Guess], time: tuple[str, str, str, str] | None
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
