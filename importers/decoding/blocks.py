"""Blocks of raw messages out of a container, and the tables that decoders make of them.

A container reader (MCAP, bag) yields blocks and losses; a decoder per channel turns the bytes into columns. Neither knows
the other.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from importers.rows.log import Table
from navreplay.timeline import Times

__all__ = ["Block", "Decoded", "Decoder", "Loss", "TableBuilder", "collect", "join_columns"]

Offsets = NDArray[np.int64]
Buffer = NDArray[np.uint8]
Columns = Mapping[str, np.ndarray]
_TIMES = "#log_time"
_MAX_ROOM = 1 << 22
_WIDE = 4
"""Numbers of a field from which on it pays to look whether it changes."""


@dataclass(frozen=True, eq=False, slots=True)
class Block:
    """n messages in one piece of memory, in file order.

    buffer: (N,) bytes. channel: (n,) number of each message's channel. log_time_ns: (n,). start, stop: (n,) extent of each
    message in the buffer.
    """

    buffer: Buffer
    channel: Offsets
    log_time_ns: Times
    start: Offsets
    stop: Offsets


@dataclass(frozen=True, slots=True)
class Loss:
    """Messages known to have been in the file that cannot be read: count per channel number, and why."""

    counts: Mapping[int, int]
    reason: str


@dataclass(frozen=True, eq=False, slots=True)
class Decoded:
    """columns: of the messages that could be decoded, in file order. kept: (k,) their places among those given.
    reason: why the others could not."""

    columns: Columns
    kept: NDArray[np.intp]
    reason: str = ""


class Decoder(Protocol):
    """Turns the bytes of one channel's messages into columns."""

    def decode(self, buffer: Buffer, start: Offsets, stop: Offsets) -> Decoded:
        """Decode the messages buffer[start[i]:stop[i]]; never raises for what the bytes hold."""
        ...


class TableBuilder:
    """Gathers what is decoded of one topic, block by block, in arrays with room for the messages expected. Of wide fields that
    never change, as covariances mostly are, one row is kept: the column is then a view of it that cannot be written."""

    def __init__(self, expected: int) -> None:
        # The expectation comes from the file and may be damaged: it is no reason to reserve any amount of memory.
        self._room = min(max(expected, 1), _MAX_ROOM)
        self._arena: dict[str, np.ndarray] = {}
        self._steady: dict[str, np.ndarray] = {}
        self._filled = 0
        self._pieces: list[dict[str, np.ndarray]] = []
        self._lengths: list[int] = []
        self._rejected: Counter[str] = Counter()
        self.read = 0

    def add(self, decoder: Decoder, block: Block, rows: NDArray[np.intp]) -> None:
        """Decode the given rows of a block."""
        decoded = decoder.decode(block.buffer, block.start[rows], block.stop[rows])
        self._append({_TIMES: block.log_time_ns[rows][decoded.kept], **decoded.columns}, len(decoded.kept))
        self.read += len(rows)
        if len(decoded.kept) < len(rows):
            self._rejected[decoded.reason] += len(rows) - len(decoded.kept)

    def _append(self, columns: Columns, count: int) -> None:
        fits = self._filled + count <= len(self._arena.get(_TIMES, ()))
        if not fits or _shape(columns) != _shape(self._arena | self._steady):
            self._close_arena()
            self._room = max(self._room, count)
            self._steady = {path: column[:1].copy() for path, column in columns.items() if _may_be_steady(column)}
            self._arena = {path: self._reserve(column) for path, column in columns.items() if path not in self._steady}
        for path, column in columns.items():
            if path in self._steady and not _is_all(column, self._steady[path]):
                self._arena[path] = self._reserve(column)
                self._arena[path][: self._filled] = self._steady.pop(path)
            if path in self._arena:
                self._arena[path][self._filled : self._filled + count] = column
        self._filled += count

    def _reserve(self, like: np.ndarray) -> np.ndarray:
        return np.empty((self._room, *like.shape[1:]), like.dtype)

    def _close_arena(self) -> None:
        if self._arena:
            piece = {path: column[: self._filled] for path, column in self._arena.items()}
            piece |= {path: np.broadcast_to(row, (self._filled, *row.shape[1:])) for path, row in self._steady.items()}
            self._pieces.append(piece)
            self._lengths.append(self._filled)
        self._arena, self._steady, self._filled = {}, {}, 0

    def lose(self, count: int, reason: str) -> None:
        """Account for messages that cannot be read."""
        if count > 0:
            self.read += count
            self._rejected[reason] += count

    def table(self) -> Table:
        """The table of everything added; the builder is empty afterwards, so that memory is held once only."""
        self._close_arena()
        columns = join_columns(self._pieces, self._lengths)
        times = columns.pop(_TIMES, np.empty(0, dtype=np.int64))
        return Table(times, columns, self.read, dict(self._rejected))


def _may_be_steady(column: np.ndarray) -> bool:
    return column.ndim == 2 and column.shape[1] >= _WIDE and column.dtype == np.float64 and len(column) > 0


def _is_all(column: np.ndarray, row: np.ndarray) -> bool:
    """Whether every row has the bits of that one, so that unknown values and signs of zero count as well."""
    return bool((np.ascontiguousarray(column).view(np.int64) == row.view(np.int64)).all())


def _shape(columns: Columns) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
    return {path: (column.shape[1:], column.dtype) for path, column in columns.items()}


def collect(builders: Mapping[int, TableBuilder], decoders: Mapping[int, Decoder], items: Iterable[Block | Loss]) -> None:
    """Feed blocks and losses to the builders of their channels; other channels are passed over."""
    for item in items:
        if isinstance(item, Loss):
            for channel in builders.keys() & item.counts.keys():
                builders[channel].lose(item.counts[channel], item.reason)
            continue
        for channel, builder in builders.items():
            rows = np.flatnonzero(item.channel == channel)
            if len(rows):
                builder.add(decoders[channel], item, rows)


def join_columns(pieces: list[dict[str, np.ndarray]], lengths: list[int]) -> dict[str, np.ndarray]:
    """Columns end to end, emptying the pieces. A column missing in a piece is NaN there (None in an object column); one whose
    shape or kind differs between pieces becomes an object column."""
    paths = dict.fromkeys(path for piece, n in zip(pieces, lengths, strict=True) if n for path in piece)
    if not paths:
        return {path: column for piece in pieces for path, column in piece.items()}
    joined = {}
    for path in paths:
        columns = [piece.pop(path, None) if n else None for piece, n in zip(pieces, lengths, strict=True)]
        joined[path] = _join(columns, lengths)
    return joined


def _join(columns: list[np.ndarray | None], lengths: list[int]) -> np.ndarray:
    known = [column for column in columns if column is not None]
    alike = len({column.shape[1:] for column in known}) == 1 and len({column.dtype == object for column in known}) == 1
    if not alike:
        known_or_none = [None if column is None else _as_objects(column) for column in columns]
        return _join(known_or_none, lengths)
    objects = known[0].dtype == object
    shape = known[0].shape[1:]
    filled = [
        np.full((n, *shape), None if objects else np.nan) if column is None else column
        for column, n in zip(columns, lengths, strict=True)
        if n
    ]
    if len(filled) == 1:
        return filled[0]
    if all(column.strides[0] == 0 and _may_be_steady(column) and _is_all(column[:1], filled[0][:1]) for column in filled):
        return np.broadcast_to(filled[0][:1], (sum(lengths), *shape))
    return np.concatenate(filled)


def _as_objects(column: np.ndarray) -> np.ndarray:
    objects = np.empty(len(column), dtype=object)
    for row, value in enumerate(column):
        objects[row] = value
    return objects
