"""The walk over all records of a container file, around damage where the file's index shows a way on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["Walk", "walk_records"]

Scan = Callable[[Buffer, int], tuple[NDArray[np.integer], Offsets, Offsets, Offsets, int]]


@dataclass(frozen=True, eq=False, slots=True)
class Walk:
    """Records of a file in order. op: (n,) their kinds. at: (n,) where they begin. start, stop: (n,) extent of their
    contents. fragments: (offset, limit) of what is no whole record, up to where the walk could go on."""

    op: NDArray[np.integer]
    at: Offsets
    start: Offsets
    stop: Offsets
    fragments: tuple[tuple[int, int], ...]


def walk_records(scan: Scan, buffer: Buffer, begin: int, landmarks: Offsets) -> Walk:
    """Walk from `begin`; behind damage, go on at the next landmark.

    scan: from a buffer and an offset to op, at, start, stop of the records and where it ended. landmarks: offsets known (from
    an index) to be beginnings of records, ascending.
    """
    parts: list[tuple[np.ndarray, ...]] = []
    fragments: list[tuple[int, int]] = []
    place = begin
    while True:
        op, at, start, stop, end = scan(buffer, place)
        # A record that reaches over a landmark has a damaged length.
        over = np.flatnonzero(np.searchsorted(landmarks, at, "right") < np.searchsorted(landmarks, stop, "left"))
        broken = int(at[over[0]]) if len(over) else int(end)
        whole = at < broken
        parts.append((op[whole], at[whole], start[whole], stop[whole]))
        if broken == len(buffer):
            break
        later = landmarks[landmarks > broken]
        place = int(later[0]) if len(later) else len(buffer)
        fragments.append((broken, place))
        if place == len(buffer):
            break
    op, at, start, stop = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return Walk(op, at, start, stop, tuple(fragments))
