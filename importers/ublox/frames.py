"""Messages of a UBX stream, found by their sync characters, kinds, lengths and checksums, whatever stands between them.

Source: u-blox F9 HPG 1.32 interface description (UBX-22008968), 3.2 and 3.4.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather

__all__ = ["Frames", "find_frames"]

_SYNC = b"\xb5\x62"
_OVERHEAD = 8
_LARGEST = 4096


@dataclass(frozen=True, eq=False, slots=True)
class Frames:
    """Of one kind of message: start (n,) and length (n,) of the payloads, in the order of the stream, and how many there were
    with a wrong checksum."""

    start: Offsets
    length: NDArray[np.int64]
    wrong: int


def find_frames(buffer: Buffer, lengths: Mapping[int, tuple[int, int]]) -> tuple[dict[int, Frames], bool]:
    """Messages by kind (256 x class + identifier), and whether the last of them is cut. lengths: of each kind, the least
    payload and what a longer one is longer by a multiple of (0: none is longer)."""
    nothing = np.empty(0, np.int64)
    if len(buffer) < _OVERHEAD:
        return {kind: Frames(nothing, nothing, 0) for kind in lengths}, False
    body = buffer[: len(buffer) - _OVERHEAD + 1]
    sync = np.flatnonzero((body == _SYNC[0]) & (buffer[1 : len(body) + 1] == _SYNC[1])).astype(np.int64)
    kind = 256 * buffer[sync + 2].astype(np.int64) + buffer[sync + 3]
    length = buffer[sync + 4].astype(np.int64) + 256 * buffer[sync + 5].astype(np.int64)
    fits = np.zeros(len(sync), dtype=bool)
    for name, (least, step) in lengths.items():
        surplus = length - least
        fits |= (kind == name) & ((surplus == 0) | ((step > 0) & (surplus > 0) & (surplus % max(step, 1) == 0)))
    fits &= length <= _LARGEST
    sync, kind, length = sync[fits], kind[fits], length[fits]
    whole = sync + _OVERHEAD + length <= len(buffer)
    good = np.zeros(len(sync), dtype=bool)
    for size in np.unique(length[whole]):
        own = np.flatnonzero(whole & (length == size))
        good[own] = _checksum_right(buffer, sync[own], int(size))
    frames = {}
    for name in lengths:
        own = good & (kind == name)
        frames[name] = Frames(sync[own] + 6, length[own], int((whole & ~good & (kind == name)).sum()))
    return frames, bool((~whole).any())


def _checksum_right(buffer: Buffer, sync: Offsets, size: int) -> NDArray[np.bool_]:
    """The 8-bit Fletcher checksum over class, kind, length and payload."""
    content = gather(buffer, sync + 2, size + 4).astype(np.int64)
    first = content.sum(axis=1) % 256
    second = (content @ np.arange(size + 4, 0, -1)) % 256
    stated = gather(buffer, sync + 6 + size, 2)
    return np.asarray((stated[:, 0] == first) & (stated[:, 1] == second))
