"""Tables whose header tells what they hold: mappings for them, drafted from names, units and the first rows."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import translate
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from importers.drafting.headerless import understand
from importers.rows.field_names import Guess, guess_angle_unit, guess_counter, guess_quantities, guess_time, unit_in
from importers.settings import CsvMapping
from importers.text.matrices import read_matrices
from importers.text.table import TextTable, head_cells, number_of_lettered, parse_text
from navreplay.timeline import Floats, LogError

__all__ = ["TableDraft", "draft_matrices", "draft_table"]

_ROLES: tuple[tuple[str, frozenset[str]], ...] = (
    ("imu", frozenset(f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz")),
    ("fix", frozenset({"lat", "lon"})),
)
_OF_A_FIX = ("height", "vel_n", "vel_e", "vel_d", "vel_u", "speed", "course", "std_h", "std_d", "std_n", "std_e")
_DATED = re.compile(
    r"\s*\"?(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}|\d{8})(?P<clock>[\sT]+\d{1,2}:?\d\d.*)?\"?\s*"
)
_CLOCK = re.compile(r"\s*\d{1,2}:\d\d:\d\d(?:[.,]\d*)?\s*(Z|UTC|[AaPp]\.?[Mm]\.?)?\s*")
_TIMES_OF_DAY = re.compile(r".*(time|utc|clock).*")
_HEAD_ROWS = 20
_ABSURD = 1e19
_PLACES = re.compile(r".*(lat|lon|lng).*", re.IGNORECASE)
_HEMISPHERES = {
    "ns": re.compile(r"n/?s|(lat(itude)?)(dir(ection)?|ref|hemi(sphere)?|ns)|(ns|n/?s)(ind(icator)?|hemi(sphere)?)"),
    "ew": re.compile(r"e/?w|(lon(gitude)?|lng)(dir(ection)?|ref|hemi(sphere)?|ew)|(ew|e/?w)(ind(icator)?|hemi(sphere)?)"),
}
_NOT_SI = {"gyro": "rad/s", "accel": "m/s2", "vel": "m/s", "speed": "m/s", "height": "m", "std": "m", "course": "deg"}


@dataclass(frozen=True, slots=True)
class TableDraft:
    """mappings: one for each role that the table can serve. lines: the same in TOML, a key a line, with reasons."""

    mappings: tuple[CsvMapping, ...]
    lines: tuple[str, ...]


def draft_table(path: str, head: bytes) -> TableDraft | None:
    """Mappings for a table by its header and the rows of its head; None where the header tells no role. Raises LogError where
    it does, but no time is understood."""
    if b"\x00" in head[:1000] and head[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return None
    text = head.decode("utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", errors="replace")
    table = parse_text(text.rpartition("\n")[0].encode())
    if len(table.frame) == 0:
        return None
    if not table.names:
        return _draft_headerless(path, table)
    fields = _numbers(table)
    guesses = guess_quantities(fields)
    roles = [(role, needed) for role, needed in _ROLES if guesses.keys() >= needed]
    if not roles:
        return None
    time = _time(table, fields)
    if time is None:
        held = ", ".join(f"{guesses[name].path}" for name in sorted(roles[0][1]))
        first = ", ".join(f"{name} = {cell}" for name, cell in zip(table.names, _first_row(table), strict=False))
        raise LogError(
            f"{path}: a table that could serve as {roles[0][0]} ({held}), but no column is understood as its time (first row: "
            f"{first[:200]}); name it with time.column and time.base of an [[input.csv]]"
        )
    drafts = [_mapping(path, role, needed, guesses, fields, time) for role, needed in roles]
    for values, _ in drafts:
        values["columns"] |= _hemispheres(table) if values["role"] == "fix" else {}
    mappings = tuple(CsvMapping.model_validate(values) for values, _ in drafts)
    return TableDraft(mappings, tuple(line for values, reasons in drafts for line in _toml(values, reasons)))


def _draft_headerless(path: str, table: TextTable) -> TableDraft | None:
    """A mapping for a table without names, by its values."""
    frame = table.frame
    return _draft_by_value(path, {i + 1: frame[i].to_numpy(dtype=np.float64) for i in frame if frame[i].dtype.kind in "fiu"})


def draft_matrices(path: str) -> TableDraft | None:
    """Mappings for the matrices of a MATLAB file whose columns are plain by value, one for each role. Raises LogError where the
    file cannot be read."""
    drafts = {}
    for name, matrix in read_matrices(path).items():
        draft = _draft_by_value(path, dict(enumerate(matrix.T.astype(np.float64), 1)), name)
        if draft is not None:
            drafts.setdefault(draft.mappings[0].role, draft)
    found = tuple(drafts.values())
    lines = tuple(line for draft in found for line in draft.lines)
    return TableDraft(tuple(draft.mappings[0] for draft in found), lines) if found else None


def _draft_by_value(path: str, columns: Mapping[int, Floats], variable: str | None = None) -> TableDraft | None:
    """A mapping for the columns (n,) of a table without names, by their numbers."""
    meaning = understand({i: np.where(np.abs(values) < _ABSURD, values, np.nan) for i, values in columns.items()})
    if meaning is None:
        return None
    values = {"match": _literal(Path(path).name), "role": meaning.role} | ({"variable": variable} if variable else {})
    values |= {"time": dict(meaning.time)}
    values |= {"columns": dict(meaning.columns), "units": dict(meaning.units)}
    return TableDraft((CsvMapping.model_validate(values),), tuple(_toml(values, meaning.reasons)))


def _hemispheres(table: TextTable) -> dict[str, str]:
    """Columns of letters that tell south and west."""
    found = {}
    for key, pattern in _HEMISPHERES.items():
        for i, name in enumerate(table.names[: table.frame.shape[1]]):
            letters = {cell.strip().upper()[:1] for cell in head_cells(table, i)} - {""}
            if pattern.fullmatch(re.sub(r"[\s_.-]", "", name.lower())) and letters and letters <= set(key.upper()):
                found[key] = name
    return found


def _first_row(table: TextTable) -> list[str]:
    return [next(iter(head_cells(table, i)), "") for i in range(table.frame.shape[1])]


def _numbers(table: TextTable) -> dict[str, Floats]:
    """Columns (n,) of numbers by the name of each, of those that hold any."""
    import pandas as pd

    fields = {}
    for i, name in enumerate(table.names[: table.frame.shape[1]]):
        column = table.frame[i]
        if column.dtype.kind not in "fiu" and _PLACES.fullmatch(name):
            column = pd.to_numeric(number_of_lettered(column), errors="coerce")
        if column.dtype.kind in "fiu" and column.notna().any() and name not in fields:
            values = column.to_numpy(dtype=np.float64)
            fields[name] = np.where(np.abs(values) < _ABSURD, values, np.nan)
    return fields


def _time(table: TextTable, fields: Mapping[str, Floats]) -> tuple[dict[str, Any], str] | None:
    """The time of a mapping, and why."""
    return _week_and_tow(fields) or _count(guess_time(fields)) or _date(table) or _count(guess_counter(fields))


def _week_and_tow(fields: Mapping[str, Floats]) -> tuple[dict[str, Any], str] | None:
    plain = {name: re.sub(r"[^a-z]", "", name.lower()) for name in fields}
    week = next(
        (name for name, word in plain.items() if re.fullmatch(r"(gps|gnss)?(week|wn|weekno|weeknumber|wnc)", word)), None
    )
    named = r".*(tow|sow|timeofweek|secondsofweek|secofweek|gpsseconds?|gpssec|weekseconds?|weeksec|weekms|itow).*"
    second = next((name for name, word in plain.items() if re.fullmatch(named, word)), None)
    if week is None or second is None:
        return None
    return {"column": second, "base": "gps_tow", "week_column": week}, f"{week} is a GPS week, {second} the time in it"


def _count(found: tuple[str, str, str, str] | None) -> tuple[dict[str, Any], str] | None:
    if found is None:
        return None
    column, unit, base, reason = found
    return {"column": column, "unit": unit, "base": base}, reason


def _date(table: TextTable) -> tuple[dict[str, Any], str] | None:
    """A column of dates with times of day, or one of dates and one of times of day."""
    cells = {name: head_cells(table, i)[:_HEAD_ROWS] for i, name in enumerate(table.names[: table.frame.shape[1]])}
    dates = {name: _DATED.fullmatch(own[0]) for name, own in cells.items() if own}
    whole = next((name for name, match in dates.items() if match is not None and match.group("clock")), None)
    base = f"datetime_{'gps' if whole and 'gps' in whole.lower() else 'utc'}"
    if whole is not None:
        return {"column": whole, "base": base}, f"a date and time of day, as {cells[whole][0]}"
    day = next(
        (name for name, match in dates.items() if match is not None and re.search(r"date|day|dmy|ymd", name.lower())), None
    )
    clock = next((name for name, own in cells.items() if own and all(_CLOCK.fullmatch(cell) for cell in own if cell)), None)
    if day is None or clock is None or not _TIMES_OF_DAY.fullmatch(clock.lower()):
        return None
    return {"column": (day, clock), "base": base}, f"a date and a time of day, as {cells[day][0]} {cells[clock][0]}"


def _mapping(
    path: str,
    role: str,
    needed: frozenset[str],
    guesses: Mapping[str, Guess],
    fields: Mapping[str, Floats],
    time: tuple[dict[str, Any], str],
) -> tuple[dict[str, Any], dict[str, str]]:
    """A mapping for one role, and the reasons of its keys."""
    wanted = [name for name in guesses if name in needed or (role == "fix" and name in _OF_A_FIX)]
    if "course" not in wanted or "vel_n" in wanted:
        wanted = [name for name in wanted if name not in ("speed", "course")]
    if "vel_d" in wanted and "vel_u" in wanted:
        wanted.remove("vel_u")
    values: dict[str, Any] = {"match": _literal(Path(path).name), "role": role, "time": time[0]}
    values["columns"] = {name: guesses[name].path for name in wanted}
    units = {
        name: unit for name in wanted if (unit := unit_in(guesses[name].path) or (guesses[name].unit if role == "fix" else ""))
    }
    units |= {name: "" for name in ("lat", "lon") if name in units and not unit_in(guesses[name].path)}
    units = {name: unit for name, unit in units.items() if unit}
    angles = {units.pop(name) for name in ("lat", "lon") if name in units}
    values["units"] = {
        name: unit for name, unit in units.items() if unit != _NOT_SI.get(name.partition("_")[0]) or role == "imu"
    }
    if any(guesses[name].backwards for name in wanted):
        signed = {name: guesses[name].unit for name in wanted if name.startswith(("gyro", "accel"))}
        values["units"] |= {name: f"-1 {unit}" if guesses[name].backwards else unit for name, unit in signed.items()}
    reasons = {"time": time[1], "role": f"its header has {', '.join(guesses[name].path for name in sorted(needed))}"}
    if role == "fix":
        guessed, why = guess_angle_unit(*(fields[guesses[name].path] for name in ("lat", "lon")))
        told = next((unit for unit in angles if unit in ("deg", "rad")), None)
        if told is not None:
            values["angle_unit"], reasons["angle_unit"] = told, f"the header says {told}"
        elif guessed in ("deg", "rad", "ddmm"):
            values["angle_unit"], reasons["angle_unit"] = guessed, why
        else:
            values["units"] |= {"lat": guessed, "lon": guessed}
    return values, reasons


def _literal(name: str) -> str:
    """A pattern that fits just this name."""
    return name if re.fullmatch(translate(name), name) else "".join(f"[{c}]" if c in "[?*" else c for c in name)


def _toml(values: Mapping[str, Any], reasons: Mapping[str, str]) -> list[str]:
    lines = ["", "[[input.csv]] # drafted from the first rows: check it"]
    for key, value in values.items():
        if not isinstance(value, dict):
            lines.append(_line(key, value, reasons.get(key)))
    for key, value in values.items():
        if isinstance(value, dict) and value:
            lines.append(f"[input.csv.{key}]" + (f" # {_plain(reasons[key])}" if key in reasons else ""))
            lines += [_line(name, part, None) for name, part in value.items()]
    return lines


def _line(key: str, value: object, reason: str | None) -> str:
    shown = tomlkit.item(list(value) if isinstance(value, tuple) else value).as_string()
    return f"{key} = {shown}" + (f" # {_plain(reason)}" if reason else "")


def _plain(reason: str) -> str:
    """A reason that fits on a line of comment."""
    return "".join(c if c.isprintable() else " " for c in reason)
