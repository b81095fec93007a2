"""DataFlash, the binary flight log of ArduPilot: messages by name as columns, around damage.

Source: ArduPilot developer guide ("Logging: Diagnosing problems using Logs", "Adding a New Log Message") and the comments of
libraries/AP_Logger/LogStructure.h on format characters.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.autopilots.packet_scan import scan_dataflash
from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import records

__all__ = ["DataFlash", "open_dataflash"]

_HEAD = b"\xa3\x95"
_FORMAT_TYPE = 0x80
_FORMAT = np.dtype([("type", "u1"), ("length", "u1"), ("name", "S4"), ("format", "S16"), ("columns", "S64")])
_FORMAT_LENGTH = 3 + _FORMAT.itemsize
_CHARACTERS: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1.0), "b": ("i1", 1.0), "B": ("u1", 1.0), "c": ("<i2", 0.01), "C": ("<u2", 0.01), "d": ("<f8", 1.0),
    "e": ("<i4", 0.01), "E": ("<u4", 0.01), "f": ("<f4", 1.0), "g": ("<f2", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "L": ("<i4", 1e-7), "M": ("u1", 1.0), "n": ("S4", 1.0), "N": ("S16", 1.0),
    "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "Z": ("S64", 1.0),
}  # fmt: skip
"""Layout and scale of each format character."""


@dataclass(frozen=True, eq=False, slots=True)
class DataFlash:
    """layouts: by name of the message, its layout and the scale of each of its fields. start: by name, (n,) where the contents
    stand. lost: bytes that are no message."""

    buffer: Buffer
    layouts: Mapping[str, tuple[np.dtype[np.void], Mapping[str, float]]]
    start: Mapping[str, Offsets]
    lost: int

    def columns(self, name: str) -> dict[str, NDArray[np.generic]]:
        """The messages of a name as columns (n,) in the units that their format characters mean; empty where there are none."""
        if name not in self.start or len(self.start[name]) == 0:
            return {}
        layout, scales = self.layouts[name]
        rows = records(self.buffer, self.start[name], layout)
        return {field: rows[field] if scale == 1.0 else rows[field] * scale for field, scale in scales.items()}


def open_dataflash(path: str) -> DataFlash:
    """A log with its definitions and where its messages stand. Raises LogError."""
    buffer = map_file(path, _HEAD, "a DataFlash log")
    at = np.flatnonzero(buffer[: max(len(buffer) - _FORMAT_LENGTH + 1, 0)] == _HEAD[0]).astype(np.int64)
    at = at[(buffer[at + 1] == _HEAD[1]) & (buffer[at + 2] == _FORMAT_TYPE)]
    lengths, names = np.zeros(256, dtype=np.int64), {}
    lengths[_FORMAT_TYPE] = _FORMAT_LENGTH
    layouts: dict[str, tuple[np.dtype[np.void], Mapping[str, float]]] = {}
    for definition in records(buffer, at + 3, _FORMAT):
        name = definition["name"].decode(errors="replace")
        layout = _layout(definition["format"].decode(errors="replace"), definition["columns"].decode(errors="replace"))
        if layout is None or layout[0].itemsize + 3 != definition["length"] or int(definition["type"]) in names:
            continue
        lengths[definition["type"]], names[int(definition["type"])] = definition["length"], name
        layouts[name] = layout
    kind, start, lost = scan_dataflash(buffer, lengths)
    return DataFlash(buffer, layouts, {name: start[kind == number] for number, name in names.items()}, lost)


def _layout(characters: str, columns: str) -> tuple[np.dtype[np.void], dict[str, float]] | None:
    """Layout and scales of a definition; None where it is no definition."""
    names = columns.split(",")
    if len(names) != len(characters) or len(set(names)) != len(names) or not all(names):
        return None
    if not set(characters) <= set(_CHARACTERS):
        return None
    kinds = [_CHARACTERS[character] for character in characters]
    layout = np.dtype([(name, kind) for name, (kind, _) in zip(names, kinds, strict=True)])
    return layout, {name: scale for name, (_, scale) in zip(names, kinds, strict=True)}
