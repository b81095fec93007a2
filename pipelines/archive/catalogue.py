"""The catalogue: a row per drive and method, as Parquet; chosen, sorted and shown."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navreplay.timeline import Floats, LogError
from pipelines.archive.manifest import Entry
from pipelines.drive.headline import FIGURES
from pipelines.files.remote import local
from pipelines.files.whole_file import write_whole

if TYPE_CHECKING:
    import pandas

__all__ = ["COLUMNS", "points_of", "read_catalogue", "select_rows", "track_of", "write_catalogue"]

NAME = "catalog.parquet"
_TRACK_POINTS = 48

COLUMNS: dict[str, str] = {
    "drive": "str",
    "method": "str",
    "status": "str",
    "reason": "str",
    "vehicle": "str",
    **FIGURES,
    "inputs": "str",
    "config": "str",
    "code": "str",
    "files": "str",
    "bytes": "int",
}
"""Columns with their types. inputs, config and code are the hashes of the manifest."""


def track_of(degrees: Floats) -> str:
    """Some points of a track (k, 2) [deg], to a metre, for a small picture: one text, since an archive has many."""
    some = degrees[np.unique(np.linspace(0, len(degrees) - 1, _TRACK_POINTS).astype(np.intp))]
    return " ".join(f"{lat:.5f},{lon:.5f}" for lat, lon in some)


def points_of(track: str) -> Floats:
    """(k, 2) [deg] of such a text."""
    return np.array([point.split(",") for point in track.split()], dtype=np.float64).reshape(-1, 2)


def write_catalogue(folder: Path, entries: Iterable[Entry]) -> None:
    """catalog.parquet of the manifest's entries, in the order of drives and methods."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = [_row(entry) for entry in sorted(entries, key=lambda one: one.key)]
    types = {"str": pa.string(), "float": pa.float64(), "int": pa.int64()}
    schema = pa.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    table = pa.Table.from_pylist([{name: row.get(name) for name in COLUMNS} for row in rows], schema=schema)
    write_whole(folder / NAME, lambda path: parquet.write_table(table, path))


def _row(entry: Entry) -> dict[str, Any]:
    own = {"drive": entry.drive, "method": entry.method, "status": entry.status, "reason": entry.reason}
    hashes = {"inputs": entry.inputs, "config": entry.config, "code": entry.code}
    files = {"files": "; ".join(path for path, *_ in entry.files), "bytes": sum(size for _, size, _, _ in entry.files)}
    return {**entry.row, **own, **hashes, **files}


def read_catalogue(folder: Path) -> "pandas.DataFrame":
    """The catalogue of a destination. Raises LogError where there is none."""
    from pyarrow import parquet

    path = local(folder, NAME)
    try:
        return parquet.read_table(path).to_pandas()
    except (OSError, ValueError) as error:
        raise LogError(
            f"{folder / NAME}: no catalogue can be read; is {folder} what `navreplay batch -o` wrote? ({error})"
        ) from error


_TOKEN = re.compile(r"\s*(?:(?P<number>-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)|(?P<word>[A-Za-z_]\w*)|(?P<text>'[^']*'|\"[^\"]*\")"
                    r"|(?P<sign><=|>=|!=|==|=|<|>|\(|\)|~))")  # fmt: skip
_SIGNS: dict[str, Callable[[Any, Any], Any]] = {
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "~": lambda a, b: a.astype(str).str.contains(str(b), case=False, regex=False),
}


def select_rows(table: "pandas.DataFrame", where: str | None, sort: str | None, columns: str | None) -> "pandas.DataFrame":
    """Rows for which where holds (such as `horizontal_rms_m > 0.1 and (status = 'done' or not drive ~ test)`), sorted (by a
    column, behind - from the largest), with the columns named. Raises LogError for what is no condition or no column, with the
    nearest that is one."""
    if where:
        table = table[_Condition(where, table).holds()]
    if sort:
        name = _column(table, sort.lstrip("-"))
        table = table.sort_values(name, ascending=not sort.startswith("-"), kind="stable", na_position="last")
    if columns:
        table = table[[_column(table, name.strip()) for name in columns.split(",")]]
    return table


def _column(table: "pandas.DataFrame", name: str) -> str:
    if name in table.columns:
        return name
    near = get_close_matches(name, list(table.columns), n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(table.columns)}"
    raise LogError(f"the catalogue has no column {name}; {hint}")


class _Condition:
    """A condition on rows: comparisons joined by and, or, not and parentheses; nothing of it is ever executed."""

    def __init__(self, text: str, table: "pandas.DataFrame") -> None:
        self._text, self._table = text, table
        self._tokens: list[tuple[str, str]] = []
        at = 0
        while text[at:].strip():
            found = _TOKEN.match(text, at)
            if found is None:
                raise self._wrong(f"'{text[at:].strip()[:20]}' is no part of a condition")
            kind = str(found.lastgroup)
            self._tokens.append((kind, found.group(kind)))
            at = found.end()

    def holds(self) -> "pandas.Series[bool]":
        """(n,) of the rows."""
        rows = self._either()
        if self._tokens:
            raise self._wrong(f"'{self._tokens[0][1]}' is left over")
        return rows

    def _wrong(self, text: str) -> LogError:
        return LogError(f'--where {self._text}: {text}; write for example "horizontal_rms_m > 0.1 and distance_m > 1000"')

    def _take(self, *wanted: str) -> bool:
        if self._tokens and self._tokens[0][1].lower() in wanted and self._tokens[0][0] != "text":
            self._tokens.pop(0)
            return True
        return False

    def _either(self) -> Any:
        rows = self._both()
        while self._take("or"):
            rows = rows | self._both()
        return rows

    def _both(self) -> Any:
        rows = self._single()
        while self._take("and"):
            rows = rows & self._single()
        return rows

    def _single(self) -> Any:
        if self._take("not"):
            return ~self._single()
        if self._take("("):
            rows = self._either()
            if not self._take(")"):
                raise self._wrong("a parenthesis is not closed")
            return rows
        return self._comparison()

    def _comparison(self) -> Any:
        if len(self._tokens) < 3 or self._tokens[0][0] != "word" or self._tokens[1][1] not in _SIGNS:
            raise self._wrong("a comparison is a column, a sign and a value")
        (_, name), (_, sign), (kind, value) = (self._tokens.pop(0) for _ in range(3))
        column = self._table[_column(self._table, name)]
        text = COLUMNS.get(name) == "str"
        if not text and kind != "number":
            raise self._wrong(f"{name} is a number, and {value} is none")
        given: object = value.strip("'\"") if text or sign == "~" else float(value)
        return _SIGNS[sign](column, given).fillna(False).astype(bool)


def as_rows(table: "pandas.DataFrame") -> Sequence[Mapping[str, Any]]:
    """The rows as plain values, unknown ones None."""
    return [{str(name): None if value != value else value for name, value in row.items()} for row in table.to_dict("records")]
