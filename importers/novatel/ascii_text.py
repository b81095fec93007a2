"""ASCII messages of NovAtel receivers (``#BESTPOSA,...;...*crc`` and ``%INSPVASA,...``) as the records of the binary ones."""

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.novatel.words import WORDS
from navreplay.geodesy.time_scales import WEEK_S
from navreplay.timeline import Times

__all__ = ["AsciiMessages", "ascii_messages"]

_MESSAGE = re.compile(rb"[#%]([A-Z0-9]+)A,([^;*\r\n]*);([^*\r\n]*)\*([0-9a-fA-F]{8})")
_LONG_WEEK, _SHORT_WEEK = 4, 0


@dataclass(frozen=True, eq=False, slots=True)
class AsciiMessages:
    """rows: by message number, records (n,) and their times (n,). wrong: checksums."""

    rows: Mapping[int, tuple[NDArray[np.void], Times]]
    wrong: int


def ascii_messages(stream: bytes | memoryview, layouts: Mapping[str, tuple[int, np.dtype[np.void], bool]]) -> AsciiMessages:
    """The messages of a stream. layouts: by name, the number, layout and whether records repeat behind a count."""
    found: dict[int, tuple[list[tuple[object, ...]], list[int]]] = {}
    wrong = 0
    for match in _MESSAGE.finditer(stream):
        name = match[1].decode()
        if name not in layouts:
            continue
        content = match[0][1:-9]
        parsed = None
        if zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF == int(match[4], 16):
            parsed = _parse(match[2].split(b","), match[3].split(b","), layouts[name][1], layouts[name][2])
        if parsed is None:
            wrong += 1
            continue
        records, times = found.setdefault(layouts[name][0], ([], []))
        records += parsed[1]
        times += [parsed[0]] * len(parsed[1])
    kinds = {number: layout for number, layout, _ in layouts.values()}
    rows = {number: (np.array(records, kinds[number]), np.array(times, np.int64)) for number, (records, times) in found.items()}
    return AsciiMessages(rows, wrong)


def _parse(
    header: list[bytes], fields: list[bytes], layout: np.dtype[np.void], repeated: bool
) -> tuple[int, list[tuple[object, ...]]] | None:
    """Time and records of a message; None where a field is no value of its kind, or one is missing."""
    place = _LONG_WEEK if len(header) > 2 else _SHORT_WEEK
    try:
        week, seconds = int(header[place]), float(header[place + 1])
        width = sum(max(int(np.prod(kind.shape)), 1) for kind, _ in _parts(layout))
        rows = [fields[i : i + width] for i in range(1, len(fields), width)] if repeated else [fields]
        t_ns = week * WEEK_S * 10**9 + round(seconds * 1e6) * 1000
        return t_ns, [_record(row, layout) for row in rows]
    except (ValueError, IndexError, OverflowError):
        return None


def _parts(layout: np.dtype[np.void]) -> list[tuple[np.dtype, str]]:
    return [(layout.fields[name][0], name) for name in layout.names or () if layout.fields is not None]


def _record(fields: list[bytes], layout: np.dtype[np.void]) -> tuple[object, ...]:
    """Raises ValueError and IndexError for what does not fit."""
    values: list[object] = []
    at = 0
    for kind, name in _parts(layout):
        count = max(int(np.prod(kind.shape)), 1)
        parts = [_value(fields[at + i], kind.base, name) for i in range(count)]
        values.append(tuple(parts) if kind.shape else parts[0])
        at += count
    return tuple(values)


def _value(text: bytes, kind: np.dtype, name: str) -> object:
    if kind.kind == "S":
        return text.strip(b'"')
    if kind.kind == "f":
        return float(text)
    if text in WORDS:
        return WORDS[text]
    value = int(text, 16) if name in _HEXADECIMAL else int(text)
    info = np.iinfo(kind)
    if not info.min <= value <= info.max:
        raise ValueError(text)
    return value


_HEXADECIMAL = ("tracking", "extended", "gal_bds", "gps_glo", "info", "reserved", "status")
