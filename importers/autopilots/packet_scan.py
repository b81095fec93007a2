"""Finding packets in flight logs: the only loops over bytes, compiled. Arrays in, arrays out; nothing here raises."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["scan_dataflash", "scan_ulog"]

_ULOG_HEAD = 3
_DATAFLASH_HEAD = 3


@njit(cache=True)
def _walk_ulog(
    buffer: Buffer,
    begin: int,
    known: NDArray[np.bool_],
    landmarks: Offsets,
    kind: Buffer,
    start: Offsets,
    size: NDArray[np.int64],
) -> tuple[int, int]:
    """Fills kind, start and size as far as there is room in them; returns how many messages there are and how many bytes were
    left out."""
    count, lost, at, mark = 0, 0, begin, 0
    while at + _ULOG_HEAD <= len(buffer):
        length = np.int64(buffer[at]) + 256 * np.int64(buffer[at + 1])
        stop = at + _ULOG_HEAD + length
        while mark < len(landmarks) and landmarks[mark] <= at:
            mark += 1
        beyond = mark < len(landmarks) and stop > landmarks[mark]
        if known[buffer[at + 2]] and stop <= len(buffer) and not beyond:
            if count < len(kind):
                kind[count], start[count], size[count] = buffer[at + 2], at + _ULOG_HEAD, length
            count += 1
            at = stop
            continue
        to = landmarks[mark] if mark < len(landmarks) else len(buffer)
        lost += to - at
        at = to
    return count, lost + max(len(buffer) - at, 0)


def scan_ulog(
    buffer: Buffer, begin: int, known: NDArray[np.bool_], landmarks: Offsets
) -> tuple[Buffer, Offsets, NDArray[np.int64], int]:
    """Walk messages (u16 size, type, content) from begin on; behind what is none, go on at the next landmark.

    known: (256,) types that exist. landmarks: ascending offsets at which a message begins (sync messages, appended data).
    Returns type (n,), start (n,) and size (n,) of the contents, and how many bytes were left out.
    """
    nothing = np.empty(0, np.int64)
    count, lost = _walk_ulog(buffer, begin, known, landmarks, np.empty(0, np.uint8), nothing, nothing)
    kind, start, size = np.empty(count, np.uint8), np.empty(count, np.int64), np.empty(count, np.int64)
    _walk_ulog(buffer, begin, known, landmarks, kind, start, size)
    return kind, start, size, lost


@njit(cache=True)
def _walk_dataflash(buffer: Buffer, lengths: NDArray[np.int64], kind: Buffer, start: Offsets) -> tuple[int, int]:
    """Fills kind and start as far as there is room in them; returns how many packets there are and how many bytes were left
    out."""
    count, lost, at = 0, 0, 0
    while at + _DATAFLASH_HEAD <= len(buffer):
        length = lengths[buffer[at + 2]]
        if buffer[at] == 0xA3 and buffer[at + 1] == 0x95 and length > 0 and at + length <= len(buffer):
            if count < len(kind):
                kind[count], start[count] = buffer[at + 2], at + _DATAFLASH_HEAD
            count += 1
            at += length
        else:
            lost += 1
            at += 1
    return count, lost + len(buffer) - at


def scan_dataflash(buffer: Buffer, lengths: NDArray[np.int64]) -> tuple[Buffer, Offsets, int]:
    """Walk packets (A3 95, type, content) of lengths (256,), 0 for types that are not defined; what is none is left out byte by
    byte. Returns type (n,), start (n,) of the contents, and how many bytes were left out."""
    count, lost = _walk_dataflash(buffer, lengths, np.empty(0, np.uint8), np.empty(0, np.int64))
    kind, start = np.empty(count, np.uint8), np.empty(count, np.int64)
    _walk_dataflash(buffer, lengths, kind, start)
    return kind, start, lost
