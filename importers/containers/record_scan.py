"""Finding records in a buffer: the only loops over bytes, compiled. Arrays in, arrays out; nothing here raises."""

import numpy as np
from numba import njit

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["scan_bag", "scan_mcap"]

_MCAP_HEAD = 9
_MCAP_MAGIC = 8
_FOOTER = 2


@njit(cache=True)
def _mcap_length(buffer: Buffer, at: int) -> int:
    """Length field of the record at `at`; -1 when it does not fit in what is left of the buffer."""
    left = len(buffer) - at - _MCAP_HEAD
    if left < 0 or buffer[at] == 0:
        return -1
    length = np.int64(0)
    for k in range(8):
        byte = np.int64(buffer[at + 1 + k])
        if byte != 0 and k > 5:
            return -1
        length |= byte << (8 * k)
    return length if length <= left else -1


@njit(cache=True)
def scan_mcap(buffer: Buffer, begin: int) -> tuple[Buffer, Offsets, Offsets, int]:
    """Walk MCAP records (opcode, u64 length, content) from `begin` to the end or to the first damage.

    buffer: (N,) uint8. Returns opcode (n,) uint8, start (n,) and stop (n,) of each content, int64, and where the walk ended:
    N when all was read, else the offset of what is no record. A footer ends the file, and only its end.
    """
    count = 0
    at = begin
    end = len(buffer)
    while at < len(buffer):
        length = _mcap_length(buffer, at)
        footer = length >= 0 and buffer[at] == _FOOTER
        if length < 0 or (footer and at + _MCAP_HEAD + length + _MCAP_MAGIC != len(buffer)):
            end = at
            break
        count += 1
        at += _MCAP_HEAD + length
        if footer:
            break
    opcode = np.empty(count, np.uint8)
    start = np.empty(count, np.int64)
    stop = np.empty(count, np.int64)
    at = begin
    for i in range(count):
        opcode[i] = buffer[at]
        start[i] = at + _MCAP_HEAD
        stop[i] = start[i] + _mcap_length(buffer, at)
        at = stop[i]
    return opcode, start, stop, end


@njit(cache=True)
def _u32(buffer: Buffer, at: int) -> int:
    """Little-endian u32 at `at`; -1 beyond the end."""
    if at + 4 > len(buffer):
        return np.int64(-1)
    value = np.int64(0)
    for k in range(4):
        value |= np.int64(buffer[at + k]) << (8 * k)
    return value


@njit(cache=True)
def _bag_record(buffer: Buffer, at: int) -> tuple[int, int, int, int, int]:
    """Op, conn and time out of a record's header, extent of its data; op -1 when there is no whole record at `at`."""
    no_record = (-1, np.int64(-1), np.int64(-1), np.int64(0), np.int64(0))
    header_length = _u32(buffer, at)
    start = at + 8 + header_length
    if header_length < 0 or start > len(buffer):
        return no_record
    data_length = _u32(buffer, start - 4)
    if data_length > len(buffer) - start:
        return no_record
    op, conn, time = -1, np.int64(-1), np.int64(-1)
    field = at + 4
    while field < start - 4:
        size = _u32(buffer, field)
        first, field = field + 4, field + 4 + size
        if size < 4 or field > start - 4:
            return no_record
        if size == 4 and buffer[first] == 111 and buffer[first + 1] == 112 and buffer[first + 2] == 61:  # op=
            op = np.int64(buffer[first + 3])
        elif size == 9 and buffer[first] == 99 and buffer[first + 3] == 110 and buffer[first + 4] == 61:  # conn=
            conn = _u32(buffer, first + 5)
        elif size == 13 and buffer[first] == 116 and buffer[first + 3] == 101 and buffer[first + 4] == 61:  # time=
            time = _u32(buffer, first + 5) * 1_000_000_000 + _u32(buffer, first + 9)
    return op, conn, time, start, start + data_length


@njit(cache=True)
def scan_bag(buffer: Buffer, begin: int) -> tuple[Offsets, Offsets, Offsets, Offsets, Offsets, Offsets, int]:
    """Walk ROS 1 bag records (u32 header length, header fields, u32 data length, data) from `begin` to the end or to damage.

    buffer: (N,) uint8. Returns op (n,), conn (n,) and time_ns (n,) (-1 where the header has none), header start (n,), start
    (n,) and stop (n,) of the data, all int64, and where the walk ended: N when all was read.
    """
    count = 0
    at = begin
    while at < len(buffer):
        op, _, _, _, stop = _bag_record(buffer, at)
        if op < 0:
            break
        count += 1
        at = stop
    columns = np.empty((6, count), np.int64)
    end = at
    at = begin
    for i in range(count):
        op, conn, time, start, stop = _bag_record(buffer, at)
        columns[0, i], columns[1, i], columns[2, i] = op, conn, time
        columns[3, i], columns[4, i], columns[5, i] = at + 4, start, stop
        at = stop
    return columns[0], columns[1], columns[2], columns[3], columns[4], columns[5], end
