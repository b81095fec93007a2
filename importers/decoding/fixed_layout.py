"""Decoding by the column: messages whose fields all stand at the same place are one structured array.

With every string of a given length, a message without variable arrays has a fixed layout. It is derived once from a message,
checked against all others (size, encapsulation, string lengths, terminators), and then numpy reads whole columns. Sources of
the two serialisations: OMG CDR (DDS-XTypes 1.3, 7.4: alignment counted from behind the 4-byte encapsulation header) and the
ROS 1 wire format (little endian, no alignment).
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.leaves import Kind, Leaf

__all__ = ["Layout", "columns_of_rows", "derive_layout", "matching_rows"]

_ENCAPSULATION = 4
_CDR_PADDING = 3


@dataclass(frozen=True, eq=False, slots=True)
class Layout:
    """dtype: structured, a field per leaf (named by its path) and per constant. constants: fields that must hold a value for
    a message to have this layout. padding: bytes that may follow a message."""

    dtype: np.dtype
    constants: tuple[tuple[str, int], ...]
    padding: int


class _Fields:
    """Collects the fields of a structured dtype, from the first byte on; alignment counts from the origin."""

    def __init__(self, origin: int) -> None:
        self.origin = origin
        self.at = 0
        self.offsets: dict[str, int] = {}
        self.formats: list[np.dtype] = []

    def place(self, name: str, dtype: np.dtype, alignment: int = 1) -> int:
        """Puts a field behind the last one and gives its offset."""
        self.at += -(self.at - self.origin) % alignment
        self.offsets[name] = self.at
        self.formats.append(dtype)
        self.at += dtype.itemsize
        return self.offsets[name]

    def dtype(self) -> np.dtype:
        """The fields collected so far."""
        offsets = list(self.offsets.values())
        return np.dtype({"names": list(self.offsets), "formats": self.formats, "offsets": offsets, "itemsize": self.at})


def derive_layout(leaves: Sequence[Leaf], message: bytes, encoding: str) -> Layout | None:
    """The layout that this message has; None where it is too short, or not in a serialisation known here.

    encoding: ``cdr`` or ``ros1``.
    """
    cdr = encoding == "cdr"
    if cdr and message[:2] not in (b"\0\0", b"\0\1"):
        return None
    order: Literal["<", ">"] = "<" if not cdr or message[1] else ">"
    fields = _Fields(_ENCAPSULATION)
    constants: list[tuple[str, int]] = []
    if cdr:
        fields.place("#encapsulation", np.dtype("<u2"))
        constants.append(("#encapsulation", message[1] << 8))
        fields.at = _ENCAPSULATION
    for leaf in leaves:
        if leaf.kind is not Kind.TEXT:
            fields.place(leaf.path, _wire_dtype(leaf, order), _alignment(leaf) if cdr else 1)
            continue
        at = fields.place(f"{leaf.path}#length", np.dtype(f"{order}u4"), 4 if cdr else 1)
        if at + 4 > len(message):
            return None
        (length,) = struct.unpack_from(f"{order}I", message, at)
        if length < cdr or at + 4 + length > len(message):
            return None
        constants.append((f"{leaf.path}#length", length))
        fields.place(leaf.path, np.dtype(("u1", (length - cdr,))))
        if cdr:
            fields.place(f"{leaf.path}#end", np.dtype("u1"))
            constants.append((f"{leaf.path}#end", 0))
    return Layout(fields.dtype(), tuple(constants), _CDR_PADDING if cdr else 0)


def _wire_dtype(leaf: Leaf, order: Literal["<", ">"]) -> np.dtype:
    # A bool is read as the byte it is: any value but 0 means true.
    element = np.dtype("u1") if leaf.dtype == np.bool_ else leaf.dtype.newbyteorder(order)
    return np.dtype((element, (leaf.count,))) if leaf.kind in (Kind.VECTOR, Kind.ARRAY) else element


def _alignment(leaf: Leaf) -> int:
    return leaf.dtype[0].itemsize if leaf.kind is Kind.TIME else leaf.dtype.itemsize


def matching_rows(layout: Layout, buffer: Buffer, start: Offsets, stop: Offsets) -> tuple[NDArray[np.intp], np.ndarray]:
    """Which of the messages have this layout, and these as a structured array (k,)."""
    width = layout.dtype.itemsize
    surplus = stop - start - width
    places = np.flatnonzero((surplus >= 0) & (surplus <= layout.padding))
    if not len(places):
        return places, np.empty(0, layout.dtype)
    # Overlapping windows, one per byte of the buffer, cost nothing; indexing them copies just the messages.
    windows = np.ndarray((len(buffer) - width + 1,), f"V{width}", buffer, strides=(1,))
    rows = windows[start[places]].view(layout.dtype)
    same = np.ones(len(rows), dtype=bool)
    for name, value in layout.constants:
        same &= rows[name] == value
    return (places, rows) if same.all() else (places[same], rows[same])


def columns_of_rows(leaves: Sequence[Leaf], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of messages of one layout. Raises UnicodeDecodeError where a string is not UTF-8."""
    return {leaf.path: _column(leaf, rows[leaf.path]) for leaf in leaves}


def _column(leaf: Leaf, values: np.ndarray) -> np.ndarray:
    if leaf.kind is Kind.TEXT:
        return _texts(np.ascontiguousarray(values))
    if leaf.kind is Kind.TIME:
        return values["sec"].astype(np.int64) * 1_000_000_000 + values["nanosec"]
    if leaf.dtype == np.bool_:
        return values != 0
    return np.ascontiguousarray(values, dtype=leaf.dtype)


def _texts(characters: np.ndarray) -> np.ndarray:
    """Strings of (n, length) bytes; one object where all are the same, as frame names are."""
    column = np.empty(len(characters), dtype=object)
    if (characters == characters[0]).all():
        column[:] = characters[0].tobytes().decode()
    else:
        column[:] = [row.tobytes().decode() for row in characters]
    return column
