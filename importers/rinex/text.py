"""What RINEX files have in common: the header, lines as bytes, and numbers in fixed columns, without a loop over lines.

Source: RINEX 3.05 and 4.01 (IGS/RTCM). Compact RINEX (Y. Hatanaka, Bulletin of the GSI 55 (2008) 21) is unpacked by the package
``hatanaka``.
"""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.rinex.version_2 import modern_navigation, modern_observation
from importers.rows.ranges import satellite_names
from importers.text.table import read_bytes
from navreplay.timeline import Floats, LogError, Times

_TYPE_COUNTS = re.compile(
    rb"^(?:[A-Z] {0,4}| {2,5})(\d{1,4})[^\n]{20,60}(?:SYS / # / OBS TYPES|# / TYPES OF OBSERV)", re.MULTILINE
)
_HEADER_BYTES = 100_000
_OBSERVATION_WIDTH = 16
_NEVER_ABSURD, _LARGEST_RATIO = 1 << 30, 200

__all__ = [
    "Lines",
    "RinexText",
    "calendar_ns",
    "exponent_numbers",
    "header_line",
    "is_compact",
    "other_kind",
    "plain_numbers",
    "read_rinex",
]

_NEWLINE, _SPACE, _ZERO, _NOT_ASCII = 10, 32, 48, 128
_HEADER_END = b"END OF HEADER"
_LABEL, _FIRST_LINE = 60, 100


@dataclass(frozen=True, eq=False, slots=True)
class Lines:
    """Lines of a text: line i is buffer[start[i]:stop[i]]."""

    buffer: NDArray[np.uint8]
    start: NDArray[np.int64]
    stop: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.start)

    def field(self, rows: NDArray[np.intp], first: int, width: int) -> NDArray[np.uint8]:
        """Bytes (k, width) of the columns from first on, of the lines rows (k,); spaces beyond their ends."""
        place = self.start[rows][:, None] + np.arange(first, first + width)
        chars = self.buffer[np.minimum(place, len(self.buffer) - 1)]
        chars[place >= self.stop[rows][:, None]] = _SPACE
        return chars

    def beginning_with(self, character: bytes) -> NDArray[np.intp]:
        """Lines whose first column holds a character."""
        rows = np.arange(len(self))
        return np.flatnonzero(self.field(rows, 0, 1)[:, 0] == character[0]) if len(self) else np.empty(0, dtype=np.intp)

    def satellites(self, rows: NDArray[np.intp]) -> NDArray[np.str_]:
        """Names (k,) that the lines rows (k,) begin with, empty where they name no satellite."""
        chars = self.field(rows, 0, 3)
        chars[chars >= _NOT_ASCII] = _SPACE
        return satellite_names(np.ascontiguousarray(chars).view("S3")[:, 0].astype("U3"))

    def text(self, row: int) -> str:
        """One line."""
        return bytes(self.buffer[self.start[row] : self.stop[row]]).decode(errors="replace")


@dataclass(frozen=True, eq=False, slots=True)
class RinexText:
    """version: of the file. system: the letter of its satellites, ``M`` for several, empty where it tells none. header:
    (content, label) of each header line. lines: the body, in the layout of version 3. lost: what Compact RINEX could not give
    back, a count of its complaints."""

    version: float
    system: str
    header: tuple[tuple[str, str], ...]
    lines: Lines
    lost: int = 0


def is_compact(head: str) -> bool:
    """Whether the beginning of a file is a Compact RINEX (Hatanaka) header."""
    return head.lstrip("\r\n").split("\n", 1)[0][_LABEL:].startswith("CRINEX VERS")


def other_kind(head: str) -> str:
    """What a RINEX file that holds neither observations nor ephemerides holds, by its beginning; empty for any other file."""
    first = head.lstrip("\r\n").split("\n", 1)[0]
    if not first[_LABEL:].startswith("RINEX VERSION"):
        return ""
    return {"C": "satellite clocks", "M": "meteorological data"}.get(first[20:21], f"type {first[20:21]!r}")


def read_rinex(path: str, kind: str) -> RinexText:
    """A file of kind ``O`` (observations) or ``N`` (navigation). Raises LogError where its header is cut, or of a version
    before 2 or beyond 4."""
    data, lost = read_bytes(path).replace(b"\r\n", b"\n").lstrip(b"\n"), 0
    if is_compact(data[:_FIRST_LINE].decode(errors="replace")):
        data, lost = _unpack(path, data)
    version = _version(path, data)
    if data.find(_HEADER_END) < 0:
        raise LogError(f"{path}: its RINEX header has no end; the file is cut, or damaged in its header")
    if version < 3:
        modern = modern_observation if kind == "O" else modern_navigation
        data = modern(data.decode(errors="replace")).encode()
    end = data.find(_HEADER_END)
    header = tuple(header_line(line) for line in data[:end].decode(errors="replace").split("\n"))
    if header[0][0][20:21] != kind:
        raise LogError(f"{path}: its header says type {header[0][0][20:21]!r} where {kind!r} was expected; it is damaged")
    body = data.find(b"\n", end)
    return RinexText(version, header[0][0][40:41].strip(), header, _split(data[body + 1 :] if body >= 0 else b""), lost)


def header_line(line: str) -> tuple[str, str]:
    """Content and label of a line of a header."""
    return line[:_LABEL], line[_LABEL:].strip()


def _version(path: str, data: bytes) -> float:
    try:
        version = float(data[:9].decode(errors="replace"))
    except ValueError as error:
        raise LogError(f"{path}: the first line of its RINEX header holds no version; the file is damaged") from error
    if not 2 <= version < 5:
        raise LogError(f"{path}: RINEX {version:.2f} is not read, only versions 2 to 4; convert it (gfzrnx does)")
    return version


def _unpack(path: str, data: bytes) -> tuple[bytes, int]:
    """Observations of Compact RINEX, and how many complaints it raised. Raises LogError where the package that unpacks them is
    missing, or refuses."""
    try:
        import hatanaka
    except ImportError as error:
        raise LogError(
            f"{path}: Compact RINEX (Hatanaka) needs the package hatanaka: pip install 'navreplay[formats]', or unpack the "
            "file with crx2rnx"
        ) from error
    _check_compact_size(path, data)
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            unpacked = bytes(hatanaka.crx2rnx(data, skip_strange_epochs=True))
    except (hatanaka.HatanakaException, ValueError, OSError) as error:
        words = " ".join(str(error).split())[:200]
        raise LogError(f"{path}: Compact RINEX that cannot be unpacked: {words}; copy the file again") from error
    return unpacked, len(told)


def _check_compact_size(path: str, data: bytes) -> None:
    """Raises LogError where lines that were satellites with all types of the header would be more than any log."""
    types = [int(count) for count in _TYPE_COUNTS.findall(data[:_HEADER_BYTES])]
    largest = data.count(b"\n") * _OBSERVATION_WIDTH * max(types, default=1)
    if largest > max(_NEVER_ABSURD, _LARGEST_RATIO * len(data)):
        raise LogError(
            f"{path}: Compact RINEX of {len(data)} bytes that may unpack to {largest >> 20} MiB, which no log does; if it is "
            "one, unpack it with crx2rnx"
        )


def _split(body: bytes) -> Lines:
    buffer = np.frombuffer(body or b"\n", dtype=np.uint8)
    newlines = np.flatnonzero(buffer == _NEWLINE)
    start = np.concatenate([[0], newlines + 1])
    stop = np.concatenate([newlines, [len(buffer)]])
    filled = stop > start
    return Lines(buffer, start[filled].astype(np.int64), stop[filled].astype(np.int64))


def calendar_ns(lines: Lines, rows: NDArray[np.intp], columns: Sequence[tuple[int, int]]) -> tuple[Times, NDArray[np.bool_]]:
    """Nanoseconds since 1970 of the calendar dates in the lines rows (k,), exact to 100 ns, and whether each is one.

    columns: first column and width of year, month, day, hour, minute and second.
    """
    parts = [plain_numbers(lines.field(rows, first, width)) for first, width in columns]
    limits = ((1980, 2199), (1, 12), (1, 31), (0, 23), (0, 59), (0, 60.9999999))
    good = np.ones(len(rows), dtype=bool)
    for part, (least, most) in zip(parts, limits, strict=True):
        good &= (part >= least) & (part <= most)
    year, month, day, hour, minute = (np.where(good, part, 1.0).astype(np.int64) for part in parts[:5])
    fraction_ns = np.rint(np.where(good, parts[5], 0.0) * 1e7).astype(np.int64) * 100
    months = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    days = months.astype("datetime64[D]").astype(np.int64) + day - 1
    return (days * 86400 + hour * 3600 + minute * 60) * 10**9 + fraction_ns, good


def plain_numbers(chars: NDArray[np.uint8]) -> Floats:
    """Numbers (k,) of fields (k, width) such as `` -123.456``, rounded as float() does; NaN where a field is empty, or anything
    but a plain number of at most 18 digits."""
    mantissa, decimals = np.zeros(len(chars), dtype=np.int64), np.zeros(len(chars), dtype=np.int64)
    negative, dotted, ended, begun, good = (np.zeros(len(chars), dtype=bool) for _ in range(5))
    good[:] = True
    for column in chars.T[:18]:
        digit = (column >= _ZERO) & (column < _ZERO + 10)
        dot, sign, space = column == ord("."), (column == ord("-")) | (column == ord("+")), column == _SPACE
        good &= (digit | dot | sign | space) & ~(ended & ~space) & ~(dot & dotted) & ~(sign & begun)
        ended |= begun & space
        mantissa = np.where(digit, mantissa * 10 + (column.astype(np.int64) - _ZERO), mantissa)
        decimals += digit & dotted
        dotted |= dot
        negative |= column == ord("-")
        begun |= digit | dot | sign
    value = mantissa / 10.0**decimals
    return np.where(good & begun, np.where(negative, -value, value), np.nan)


def exponent_numbers(chars: NDArray[np.uint8]) -> Floats:
    """Numbers (k,) of fields (k, width) such as `` -1.234D-05``; NaN where a field is empty or no number."""
    if len(chars) == 0:
        return np.empty(0)
    chars = np.where((chars == ord("D")) | (chars == ord("d")), np.uint8(ord("E")), chars)
    texts = np.ascontiguousarray(chars).view(f"S{chars.shape[1]}")[:, 0]
    blank = (chars == _SPACE).all(axis=1)
    texts = np.where(blank, b"nan", texts)
    try:
        return texts.astype(np.float64)
    except ValueError:
        return np.array([_number(bytes(text)) for text in texts])


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
