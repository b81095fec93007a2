"""Text files as columns of numbers: fast, and with every line accounted for.

Lines are counted and split with numpy before pandas sees them, so that a damaged line costs itself only and is told.
Functions of the readers of texts import pandas themselves: it takes half a second, which a log of another kind need not wait.
"""

import csv
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from importers.text.dialect import decimal_comma, find_header, guess_delimiter, mask_quoted, split_fields, unmask
from importers.text.unix_compress import is_compressed, unpack
from navreplay.timeline import LogError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Selection", "TextTable", "head_cells", "number_of_lettered", "parse_text", "read_bytes", "select_columns"]

_NEWLINE = 10
_LAST_BLANK = 32
_HEAD_LINES = 50
_INT64 = r"[+-]?(\d{1,18}|[1-8]\d{18})"


_LARGEST = 9 * 10**18
_LETTERED = re.compile(r"\s*([NSEWnsew])?\s*(\d+(?:\.\d*)?)\s*°?\s*([NSEWnsew])?\s*")
_WRITTEN_AS_REAL = re.compile(r"[+-]?\d{1,19}\.0*|[+-]?\d(\.\d*)?[eE]\+?1\d")


@dataclass(frozen=True, eq=False, slots=True)
class TextTable:
    """A parsed text. names: of the columns from the header line, empty without one. frame: columns 0 to k - 1. read: lines
    that are neither blank nor comments nor header. rejected: count per reason of the lines that are not in the frame. lines,
    delimiter: the text of the frame, for cells that a double cannot hold."""

    names: tuple[str, ...]
    frame: "pd.DataFrame"
    read: int
    rejected: Mapping[str, int]
    lines: bytes = b""
    delimiter: str = ","


@dataclass(frozen=True, eq=False, slots=True)
class Selection:
    """Chosen columns by name, (n,) each: numbers, or strings where text was asked for. read = n + sum of rejected."""

    columns: Mapping[str, np.ndarray]
    read: int
    rejected: Mapping[str, int]


def read_bytes(path: str | Path) -> bytes:
    """The content of a text file, also of one under Unix compress, as UTF-8 without byte-order mark. Raises
    LogError when it cannot be read."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    if is_compressed(data):
        data = unpack(str(path), data)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace").encode()
    return data.removeprefix(b"\xef\xbb\xbf")


def parse_text(
    data: bytes,
    delimiter: str = "auto",
    header: bool | str = "auto",
    skip_rows: int = 0,
    comment: str | None = None,
) -> TextTable:
    """Parses lines of delimited fields; delimiter ``auto`` or `` `` (any white space) or one character.

    A line with another number of fields than most, or with zero bytes in it, is rejected.
    """
    data = mask_quoted(data.replace(b"\r\n", b"\n").replace(b"\r", b"\n"), " ,;\t" if delimiter == " " else ",;\t")
    buffer = np.frombuffer(data, dtype=np.uint8)
    starts, ends = _split_lines(buffer, skip_rows, comment)
    head = [bytes(buffer[s:e]).decode(errors="replace") for s, e in zip(starts[:_HEAD_LINES], ends[:_HEAD_LINES], strict=True)]
    if delimiter == "auto":
        delimiter = guess_delimiter(head)
    names, before = find_header(head, delimiter, header)
    starts, ends = starts[before:], ends[before:]
    comma = decimal_comma(head[before:], delimiter)
    if len(starts) == 0:
        return TextTable(names, _parse_lines(b"", delimiter, 0), 0, {})
    fields = _count_fields(buffer, starts, ends, delimiter)
    expected = int(np.argmax(np.bincount(fields)))
    damaged = _count_marks(np.flatnonzero(buffer == 0), starts, ends) > 0
    odd = ~damaged & (fields != expected)
    good = ~damaged & ~odd
    lines = _join_lines(buffer, starts[good], ends[good])
    lines = lines.replace(comma, b".") if comma else lines
    frame = _parse_lines(lines, delimiter, expected)
    counts = {"zero bytes in the line": int(damaged.sum()), "wrong number of fields": int(odd.sum())}
    rejected = {reason: count for reason, count in counts.items() if count}
    return TextTable(names, frame, len(starts), rejected, lines, delimiter)


def number_of_lettered(cells: "pd.Series") -> "pd.Series":
    """Degrees of cells such as 8.54E or S 33.9, south and west negative; cells without a letter stay as they are."""
    return cells.map(_signed)


def _signed(cell: object) -> object:
    match = _LETTERED.fullmatch(cell) if isinstance(cell, str) else None
    if match is None or (match.group(1) is None) == (match.group(3) is None):
        return cell
    letter = (match.group(1) or match.group(3)).upper()
    return float(match.group(2)) * (-1 if letter in "SW" else 1)


def select_columns(
    table: TextTable,
    numbers: Mapping[str, int],
    texts: Mapping[str, int] | None = None,
    integers: Collection[str] = (),
) -> Selection:
    """Picks columns by index; a line whose chosen number is neither empty nor a number is rejected.

    integers: numbers that count nanoseconds; they come out as exact int64, and a line where one is empty is rejected.
    """
    import pandas as pd

    frame = _with_integers(table, [numbers[name] for name in integers if name in numbers])
    lettered = [numbers[name] for name in ("lat", "lon") if name in numbers and not frame.empty]
    for index in lettered:
        if not pd.api.types.is_numeric_dtype(frame[index]):
            frame = (
                frame.assign(**{str(index): number_of_lettered(frame[index])})
                .drop(columns=index)
                .rename(columns={str(index): index})
            )
    if frame.empty:
        empty = {name: np.empty(0) for name in [*numbers, *(texts or {})]}
        return Selection(empty, table.read, dict(table.rejected))
    bad = np.zeros(len(frame), dtype=bool)
    for index in numbers.values():
        column = frame[index]
        if not pd.api.types.is_numeric_dtype(column):
            bad |= (pd.to_numeric(column, errors="coerce").isna() & column.notna()).to_numpy()
    kept = frame[~bad] if bad.any() else frame
    columns = {name: _to_numbers(kept[index], name in integers) for name, index in numbers.items()}
    for name, index in (texts or {}).items():
        cells = kept[index].astype(object).where(kept[index].notna(), "").astype(str)
        columns[name] = np.array([unmask(cell) for cell in cells], dtype=object)
    rejected = dict(table.rejected)
    if bad.any():
        rejected["not a number"] = int(bad.sum())
    return Selection(columns, table.read, rejected)


def head_cells(table: TextTable, index: int) -> list[str]:
    """The first cells of a column as they stand in the file."""
    lines = table.lines.split(b"\n", _HEAD_LINES)[:_HEAD_LINES]
    cells = [split_fields(line.decode(errors="replace"), table.delimiter) for line in lines]
    return [unmask(row[index].strip()) for row in cells if len(row) > index]


def _to_numbers(column: "pd.Series", whole: bool) -> np.ndarray:
    import pandas as pd

    values = pd.to_numeric(column).to_numpy()
    return np.asarray(values, dtype=np.int64 if whole else None if values.dtype.kind in "if" else np.float64)


def _with_integers(table: TextTable, indices: Sequence[int]) -> "pd.DataFrame":
    """The frame with columns of integers as int64, or as text where they hold anything else: one empty or damaged cell makes
    pandas round the whole column to doubles."""
    rounded = [index for index in indices if index in table.frame and table.frame[index].dtype != np.int64]
    if not rounded:
        return table.frame
    texts = _parse_lines(table.lines, table.delimiter, table.frame.shape[1], as_text=True)
    cells = {index: texts[index].str.strip() for index in rounded}
    whole = {index: cell.where(cell.str.fullmatch(_INT64), cell.map(_whole)) for index, cell in cells.items()}
    return table.frame.drop(columns=rounded).join(type(table.frame)(whole))


def _whole(cell: str) -> str:
    """A count that is written with a point or an exponent, as one without; ``x`` for another text."""
    match = _WRITTEN_AS_REAL.fullmatch(cell)
    return str(int(Decimal(cell))) if match and abs(Decimal(cell)) < _LARGEST else "x"


def _split_lines(buffer: NDArray[np.uint8], skip_rows: int, comment: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of the lines that are neither blank nor comments."""
    newlines = np.flatnonzero(buffer == _NEWLINE)
    starts = np.concatenate([[0], newlines + 1])[skip_rows:]
    ends = np.concatenate([newlines, [len(buffer)]])[skip_rows:]
    starts, ends = starts[starts < len(buffer)], ends[starts < len(buffer)]
    if len(starts) == 0:
        return starts, ends
    keep = np.maximum.reduceat(buffer, starts) > _LAST_BLANK
    if comment is not None:
        keep &= buffer[starts] != ord(comment)
    return starts[keep], ends[keep]


def _count_marks(marks: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.asarray(np.searchsorted(marks, ends) - np.searchsorted(marks, starts))


def _count_fields(buffer: NDArray[np.uint8], starts: np.ndarray, ends: np.ndarray, delimiter: str) -> np.ndarray:
    if delimiter == " ":
        ink = (buffer != ord(" ")) & (buffer != ord("\t")) & (buffer != _NEWLINE)
        firsts = np.flatnonzero(ink & np.concatenate([[True], ~ink[:-1]]))
        return _count_marks(firsts, starts, ends)
    return _count_marks(np.flatnonzero(buffer == ord(delimiter)), starts, ends) + 1


def _join_lines(buffer: NDArray[np.uint8], starts: np.ndarray, ends: np.ndarray) -> bytes:
    """The lines as one text, without a copy per line."""
    if len(starts) == 0 or (ends[:-1] + 1 == starts[1:]).all():
        return bytes(buffer[starts[0] : ends[-1]]) if len(starts) else b""
    edges = np.zeros(len(buffer) + 2, dtype=np.int8)
    edges[starts] += 1
    edges[np.minimum(ends + 1, len(buffer) + 1)] -= 1
    return bytes(buffer[np.cumsum(edges[: len(buffer)], dtype=np.int8).astype(bool)])


def _parse_lines(lines: bytes, delimiter: str, width: int, as_text: bool = False) -> "pd.DataFrame":
    import pandas as pd

    if not lines:
        return pd.DataFrame()
    # from 3.1 on, numbers are always rounded correctly and the option is deprecated
    exact = {} if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1) else {"float_precision": "round_trip"}
    return pd.read_csv(
        BytesIO(lines),
        sep=r"\s+" if delimiter == " " else delimiter,
        header=None,
        names=list(range(width)),
        index_col=False,
        engine="c",
        quoting=csv.QUOTE_NONE,
        skipinitialspace=True,
        low_memory=False,
        dtype=str if as_text else None,
        keep_default_na=not as_text,
        encoding_errors="replace",
        **exact,
    )
