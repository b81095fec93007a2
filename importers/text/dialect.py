"""How a text writes its fields: quotes, the mark between them, the decimal comma, and the line that names them."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["decimal_comma", "find_header", "guess_delimiter", "mask_quoted", "split_fields", "unmask"]

_QUOTE, _NEWLINE = 34, 10
_MASKS = {",": 0x1C, ";": 0x1D, "\t": 0x1E, " ": 0x1F}
_UNMASKED = {code: mark for mark, code in _MASKS.items()}
_WITH_COMMA = re.compile(r"[+-]?\d+[,\x1c]\d+([eE][+-]?\d+)?")
_WITH_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_UNITS = frozenset(
    [
        "s",
        "ms",
        "us",
        "ns",
        "deg",
        "rad",
        "m",
        "mm",
        "m/s",
        "m/s2",
        "m/s^2",
        "rad/s",
        "deg/s",
        "g",
        "km/h",
        "kn",
        "hz",
        "%",
        "-",
    ]
)


def mask_quoted(data: bytes, marks: str = ",;\t") -> bytes:
    """The text without its quotes, and with those of the marks that stood in quotes replaced, so that they divide nothing.
    A line with an odd number of quotes, or that is one quoted cell as a whole, merely loses them."""
    if b'"' not in data:
        return data
    buffer = np.frombuffer(data, dtype=np.uint8).copy()
    quote = buffer == _QUOTE
    inside = _inside(buffer, quote)
    for mark in marks:
        buffer[inside & (buffer == ord(mark))] = _MASKS[mark]
    return bytes(buffer[~quote])


def _inside(buffer: NDArray[np.uint8], quote: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which bytes stand in quotes."""
    count = np.cumsum(quote, dtype=np.int64)
    ends = np.append(np.flatnonzero(buffer == _NEWLINE), len(buffer))
    starts = np.concatenate([[0], ends[:-1] + 1])
    before = np.concatenate([[0], count])[starts]
    within = np.concatenate([[0], count])[ends] - before
    last = np.clip(ends - 1, 0, len(buffer) - 1)
    first = np.clip(starts, 0, len(buffer) - 1)
    whole = (within == 2) & quote[first] & quote[last]
    sound = (within % 2 == 0) & ~whole
    lengths = np.diff(np.append(starts, len(buffer)))
    return np.asarray(((count - np.repeat(before, lengths)) % 2 == 1) & np.repeat(sound, lengths))


def unmask(text: str) -> str:
    """A cell as it stands in the file."""
    return text.translate(_UNMASKED)


def guess_delimiter(head: Sequence[str]) -> str:
    """Mark between the fields of some lines, the first of which may name them; a blank for any white space."""
    lines = head[1:] or head
    if not lines:
        return " "
    counts = {mark: float(np.median([line.count(mark) for line in lines])) for mark in "\t;,"}
    for mark in "\t;":  # commas beside these may be decimal ones
        if counts[mark] >= 1 and head[0].count(mark) == counts[mark]:
            return mark
    if counts[","] and all(_is_spaced(line) for line in lines):
        return " "
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] >= 1 else " "


def _is_spaced(line: str) -> bool:
    """Whether white space divides numbers with decimal commas."""
    fields = split_fields(line, " ")
    numbers = [field for field in fields if _WITH_COMMA.fullmatch(field)]
    return len(fields) > 1 and 2 * len(numbers) > len(fields)


def split_fields(line: str, delimiter: str) -> list[str]:
    """Fields of one line."""
    return re.findall(r"[^ \t\r]+", line) if delimiter == " " else line.rstrip("\r").split(delimiter)


def decimal_comma(head: Sequence[str], delimiter: str) -> bytes:
    """The byte that stands for the decimal point in the numbers of these lines; empty where it is the point."""
    fields = [field.strip() for line in head for field in split_fields(line, delimiter)]
    if not any(_WITH_COMMA.fullmatch(field) for field in fields) or any(_WITH_POINT.fullmatch(field) for field in fields):
        return b""
    return b"\x1c" if delimiter == "," or any("\x1c" in field for field in fields) else b","


def find_header(head: Sequence[str], delimiter: str, header: bool | str) -> tuple[tuple[str, ...], int]:
    """Names of the columns, and how many lines stand before the first row: notes, the names, and a line of units."""
    if not head or header is False:
        return (), 0
    if header is True or not _looks_like_header(head[0], delimiter):
        named = header is True
        return (_names(head[0], delimiter), 1) if named else _behind_notes(head, delimiter)
    names = _names(head[0], delimiter)
    if len(head) > 2 and len(names) != len(split_fields(head[-1], delimiter)):
        later = _behind_notes(head, delimiter)
        if later[1]:
            return later
    return names, 1 + _is_units(head[1:2], delimiter)


def _behind_notes(head: Sequence[str], delimiter: str) -> tuple[tuple[str, ...], int]:
    """A line of names behind lines of other notes: as wide as the rows that follow, which the lines above are not."""
    width = len(split_fields(head[-1], delimiter))
    for i, line in enumerate(head[:-1]):
        if len(split_fields(line, delimiter)) == width:
            named = i > 0 and width > 1 and _looks_like_header(line, delimiter)
            return (_names(line, delimiter), i + 1 + _is_units(head[i + 1 : i + 2], delimiter)) if named else ((), 0)
    return (), 0


def _names(line: str, delimiter: str) -> tuple[str, ...]:
    fields = split_fields(line.lstrip("#% "), " ") if delimiter == " " and line[:1] in "#%" else split_fields(line, delimiter)
    return tuple(unmask(field).strip() for field in fields)


def _looks_like_header(line: str, delimiter: str) -> bool:
    fields = [field.strip() for field in split_fields(line.lstrip("#% "), delimiter) if field.strip()]
    words = sum((field[0].isalpha() or field[0] == "_") and field.lower() not in ("nan", "inf") for field in fields)
    return 2 * words > len(fields)


def _is_units(lines: Sequence[str], delimiter: str) -> bool:
    """Whether the line below the names holds units."""
    fields = [field.strip(" []()").lower() for line in lines for field in split_fields(line, delimiter)]
    return bool(fields) and all(field in _UNITS or not field for field in fields) and any(field != "-" for field in fields)
