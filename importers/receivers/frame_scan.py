"""Finding messages with right checksums in streams of receivers: loops over bytes, compiled. Arrays in, arrays out."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["CRC16_CCITT", "CRC24Q", "CRC32", "scan_novatel", "scan_rtcm", "scan_sbf"]


def _table(polynomial: int, width: int, reflected: bool) -> NDArray[np.uint32]:
    """Remainders (256,) of single bytes."""
    table = np.zeros(256, dtype=np.uint32)
    for byte in range(256):
        value = byte if reflected else byte << (width - 8)
        for _ in range(8):
            if reflected:
                value = (value >> 1) ^ (polynomial if value & 1 else 0)
            else:
                value = ((value << 1) ^ (polynomial if value >> (width - 1) & 1 else 0)) & ((1 << width) - 1)
        table[byte] = value
    return table


CRC32 = _table(0xEDB88320, 32, True)
"""Of NovAtel's messages, which begin with 0 and end without inversion."""
CRC16_CCITT = _table(0x1021, 16, False)
CRC24Q = _table(0x864CFB, 24, False)


@njit(cache=True)
def _crc32(buffer: Buffer, begin: int, stop: int, table: NDArray[np.uint32]) -> int:
    value = np.uint32(0)
    for at in range(begin, stop):
        value = np.uint32((value >> np.uint32(8)) ^ table[(value ^ np.uint32(buffer[at])) & np.uint32(255)])
    return np.int64(value)


@njit(cache=True)
def _crc16(buffer: Buffer, begin: int, stop: int, table: NDArray[np.uint32]) -> int:
    value = np.uint32(0)
    for at in range(begin, stop):
        index = ((value >> np.uint32(8)) ^ np.uint32(buffer[at])) & np.uint32(255)
        value = np.uint32(((value << np.uint32(8)) & np.uint32(0xFFFF)) ^ table[index])
    return np.int64(value)


@njit(cache=True)
def scan_novatel(
    buffer: Buffer, candidates: Offsets, table: NDArray[np.uint32]
) -> tuple[Offsets, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], int]:
    """Binary messages (AA 44 12 long, AA 44 13 short header) among candidates (k,), ascending.

    Returns offset (n,), length of the header (n,), length of the content (n,), message number (n,), and how many candidates
    had a wrong checksum.
    """
    room = len(candidates)
    at, head, size, number = (
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
    )
    count, wrong, free = 0, 0, 0
    for place in candidates:
        if place < free or place + 12 > len(buffer):
            continue
        short = buffer[place + 2] == 0x13
        header = np.int64(12) if short else np.int64(buffer[place + 3])
        if header < 12 or place + header > len(buffer):
            continue
        content = np.int64(buffer[place + 3]) if short else np.int64(buffer[place + 8]) + 256 * np.int64(buffer[place + 9])
        stop = place + header + content
        if stop + 4 > len(buffer):
            continue
        stated = np.int64(0)
        for k in range(4):
            stated |= np.int64(buffer[stop + k]) << (8 * k)
        if _crc32(buffer, place, stop, table) != stated:
            wrong += 1
            continue
        at[count], head[count], size[count] = place, header, content
        number[count] = np.int64(buffer[place + 4]) + 256 * np.int64(buffer[place + 5])
        count += 1
        free = stop + 4
    return at[:count].copy(), head[:count].copy(), size[:count].copy(), number[:count].copy(), wrong


@njit(cache=True)
def scan_sbf(
    buffer: Buffer, candidates: Offsets, table: NDArray[np.uint32]
) -> tuple[Offsets, NDArray[np.int64], NDArray[np.int64], int]:
    """Blocks ($@, checksum, identifier, length) among candidates (k,), ascending. Returns offset (n,), length of the whole
    block (n,), number of the block (n,), and how many candidates had a wrong checksum."""
    room = len(candidates)
    at, size, number = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    count, wrong, free = 0, 0, 0
    for place in candidates:
        if place < free or place + 8 > len(buffer):
            continue
        length = np.int64(buffer[place + 6]) + 256 * np.int64(buffer[place + 7])
        if length < 8 or length % 4 != 0 or place + length > len(buffer):
            continue
        stated = np.int64(buffer[place + 2]) + 256 * np.int64(buffer[place + 3])
        if _crc16(buffer, place + 4, place + length, table) != stated:
            wrong += 1
            continue
        at[count], size[count] = place, length
        number[count] = (np.int64(buffer[place + 4]) + 256 * np.int64(buffer[place + 5])) & 0x1FFF
        count += 1
        free = place + length
    return at[:count].copy(), size[:count].copy(), number[:count].copy(), wrong


@njit(cache=True)
def _crc24(buffer: Buffer, begin: int, stop: int, table: NDArray[np.uint32]) -> int:
    value = np.uint32(0)
    for at in range(begin, stop):
        index = ((value >> np.uint32(16)) ^ np.uint32(buffer[at])) & np.uint32(255)
        value = np.uint32(((value << np.uint32(8)) & np.uint32(0xFFFFFF)) ^ table[index])
    return np.int64(value)


@njit(cache=True)
def scan_rtcm(buffer: Buffer, candidates: Offsets, table: NDArray[np.uint32]) -> tuple[Offsets, NDArray[np.int64], int]:
    """Frames (D3, 6 bits of zero, 10 bits of length, content, 24 bits of checksum) among candidates (k,), ascending. Returns
    offset (n,) and length (n,) of whole frames, and how many candidates had a wrong checksum."""
    room = len(candidates)
    at, size = np.empty(room, np.int64), np.empty(room, np.int64)
    count, wrong, free = 0, 0, 0
    for place in candidates:
        if place < free or place + 6 > len(buffer):
            continue
        stop = place + 3 + ((np.int64(buffer[place + 1]) & 3) << 8) + np.int64(buffer[place + 2])
        if stop < place + 5 or stop + 3 > len(buffer):
            continue
        stated = np.int64(buffer[stop]) << 16 | np.int64(buffer[stop + 1]) << 8 | np.int64(buffer[stop + 2])
        if _crc24(buffer, place, stop, table) != stated:
            wrong += 1
            continue
        at[count], size[count] = place, stop + 3 - place
        count += 1
        free = stop + 3
    return at[:count].copy(), size[:count].copy(), wrong
