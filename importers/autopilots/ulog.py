"""ULog, the flight log of PX4: messages of topics as records, around damage as far as its sync messages show a way on.

Source: PX4 guide 1.16, "ULog File Format".
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from importers.autopilots.packet_scan import scan_ulog
from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather, records
from navreplay.timeline import LogError

__all__ = ["ULOG_MAGIC", "Topic", "ULog", "open_ulog"]

ULOG_MAGIC = b"ULog\x01\x12\x35"
_HEADER = 16
_SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_TYPES = b"FDIMPQARSOLCB"
_BASIC = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4", "int64_t": "<i8",
    "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "?", "char": "S1",
}  # fmt: skip
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])? +(\w+)")
_LARGEST, _DEEPEST = 65_535, 8
_FLAGS_BYTES, _APPENDED = 40, 1


@dataclass(frozen=True, eq=False, slots=True)
class Topic:
    """Messages of a topic. instance: its number among those of the same name. start: (n,) of the records in the buffer. short:
    how many messages were shorter than their definition."""

    name: str
    instance: int
    layout: np.dtype[np.void]
    start: Offsets
    short: int


@dataclass(frozen=True, eq=False, slots=True)
class ULog:
    """Topics by name and instance. lost: bytes that are no message."""

    buffer: Buffer
    topics: Mapping[tuple[str, int], Topic]
    lost: int

    def records(self, topic: Topic) -> NDArray[np.void]:
        """The messages (n,) of a topic."""
        return records(self.buffer, topic.start, topic.layout)


def open_ulog(path: str) -> ULog:
    """A log with its definitions and where the messages of its topics stand. Raises LogError for a file that says it cannot be
    read so."""
    buffer = map_file(path, ULOG_MAGIC, "a ULog")
    sync = _find(buffer, _SYNC) - 3
    known = np.zeros(256, dtype=bool)
    known[np.frombuffer(_TYPES, np.uint8)] = True
    flags = bytes(buffer[_HEADER : _HEADER + 3 + _FLAGS_BYTES])
    landmarks = np.unique(np.concatenate([sync[sync >= _HEADER], _appended(path, flags)])).astype(np.int64)
    kind, start, size, lost = scan_ulog(buffer, _HEADER, known, landmarks)
    formats = dict(_format(_text(buffer, start[i], size[i])) for i in np.flatnonzero(kind == ord("F")))
    return ULog(buffer, _topics(buffer, kind, start, size, formats), lost)


def _topics(
    buffer: Buffer,
    kind: NDArray[np.uint8],
    start: Offsets,
    size: NDArray[np.int64],
    formats: Mapping[str, tuple[str, ...]],
) -> dict[tuple[str, int], Topic]:
    """The topics that are subscribed and have a definition, with their messages."""
    data = np.flatnonzero((kind == ord("D")) & (size >= 2))
    numbers = gather(buffer, start[data], 2).astype(np.int64) @ [1, 256]
    order = np.argsort(numbers, kind="stable")
    bounds = np.searchsorted(numbers[order], np.arange(65_537))
    parts: dict[tuple[str, int], dict[int, Topic]] = {}
    for i in np.flatnonzero((kind == ord("A")) & (size > 3)):
        instance, low, high = (int(byte) for byte in buffer[start[i] : start[i] + 3])
        name, number = _text(buffer, start[i] + 3, size[i] - 3), low + 256 * high
        layout = _layout(name, formats, 0)
        known = parts.setdefault((name, instance), {})
        if number in known or layout is None or "timestamp" not in (layout.names or ()):
            continue
        own = data[order[bounds[number] : bounds[number + 1]]]
        whole = size[own] - 2 >= _needed(layout)
        known[number] = Topic(name, instance, layout, start[own[whole]] + 2, int((~whole).sum()))
    return {key: _joined(list(known.values())) for key, known in parts.items() if known}


def _joined(parts: Sequence[Topic]) -> Topic:
    """One topic of those subscribed again under another number, as data appended after a crash may be."""
    places = np.sort(np.concatenate([part.start for part in parts]))
    return replace(parts[0], start=places, short=sum(part.short for part in parts))


def _appended(path: str, flags: bytes) -> NDArray[np.int64]:
    """Where data were appended to the file after a crash. Raises LogError where the file needs what is not known here."""
    if len(flags) < 3 + _FLAGS_BYTES or flags[2:3] != b"B":
        return np.empty(0, dtype=np.int64)
    incompatible = flags[11:19]
    if incompatible[0] & ~_APPENDED or any(incompatible[1:]):
        raise LogError(f"{path}: is a ULog of a version that is not known here (incompatible flags {incompatible.hex()})")
    offsets = np.frombuffer(flags[19:43], "<u8")
    return offsets[(offsets > _HEADER) & (offsets < 1 << 62)].astype(np.int64) if incompatible[0] else np.empty(0, np.int64)


def _find(buffer: Buffer, pattern: bytes) -> NDArray[np.int64]:
    """Offsets at which a pattern stands."""
    at = np.flatnonzero(buffer[: max(len(buffer) - len(pattern) + 1, 0)] == pattern[0]).astype(np.int64)
    for k in range(1, len(pattern)):
        at = at[buffer[at + k] == pattern[k]]
    return at


def _text(buffer: Buffer, start: int, size: int) -> str:
    return bytes(buffer[start : start + size]).decode(errors="replace")


def _format(text: str) -> tuple[str, tuple[str, ...]]:
    name, _, fields = text.partition(":")
    return name, tuple(field for field in fields.split(";") if field)


def _layout(name: str, formats: Mapping[str, tuple[str, ...]], depth: int) -> np.dtype[np.void] | None:
    """The layout of a topic; None where its definition is missing, makes no sense or nests without end."""
    if name not in formats or depth > _DEEPEST:
        return None
    fields: dict[str, tuple[np.dtype, int]] = {}
    size = 0
    for field in formats[name]:
        match = _FIELD.fullmatch(field)
        if match is None:
            return None
        kind, count, label = match.groups()
        part = np.dtype(_BASIC[kind]) if kind in _BASIC else _layout(kind, formats, depth + 1)
        if part is None or int(count or 1) * part.itemsize > _LARGEST:
            return None
        fields[label] = (part if count is None else np.dtype((part, int(count))), size)
        size += part.itemsize * int(count or 1)
    if not 0 < size <= _LARGEST:
        return None
    formats_of, offsets = [part for part, _ in fields.values()], [offset for _, offset in fields.values()]
    return np.dtype({"names": list(fields), "formats": formats_of, "offsets": offsets, "itemsize": size})


def _needed(layout: np.dtype[np.void]) -> int:
    """Bytes of a message: padding at its end is not written."""
    size = layout.itemsize
    for name in reversed(layout.names or ()):
        if not name.startswith("_padding"):
            break
        size = int((layout.fields or {})[name][1])
    return size
