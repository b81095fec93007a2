"""Structure of a ROS 1 bag: connections, chunks and the index.

Source: the bag format 2.0 of ROS (http://wiki.ros.org/Bags/Format/2.0).
"""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from importers.containers.compression import decompress, decompress_prefix
from importers.containers.record_walk import Walk, walk_records
from importers.decoding.blocks import Buffer, Offsets

__all__ = ["MAGIC", "Connection", "Directory", "Op", "open_chunk", "read_index", "walk_file"]

MAGIC = b"#ROSBAG V2.0\n"


class Op(IntEnum):
    """Kinds of records."""

    MESSAGE = 2
    BAG_HEADER = 3
    INDEX = 4
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


@dataclass(frozen=True, slots=True)
class Connection:
    """A topic as one publisher sent it. type: in the style of ROS 1. definition: full text."""

    topic: str
    type: str
    definition: str


@dataclass(slots=True)
class Directory:
    """Connections by number. counts: messages per connection. chunk_offsets: places of the chunk records, ascending."""

    connections: dict[int, Connection] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunk_offsets: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def add(self, header: Buffer, data: Buffer) -> bool:
        """Take up a connection record; False where it is damaged."""
        fields = {**header_fields(data), **header_fields(header)}
        if not {"conn", "topic", "type"} <= fields.keys() or len(fields["conn"]) != 4:
            return False
        texts = [fields.get(name, b"").decode(errors="replace") for name in ("topic", "type", "message_definition")]
        self.connections.setdefault(int.from_bytes(fields["conn"], "little"), Connection(*texts))
        return True


def header_fields(header: Buffer) -> dict[str, bytes]:
    """Fields of a record header (u32 length, name=value); those up to the first damage."""
    data, at, fields = header.tobytes(), 0, {}
    while at + 4 <= len(data):
        stop = at + 4 + int.from_bytes(data[at : at + 4], "little")
        name, equals, value = data[at + 4 : stop].partition(b"=")
        if stop > len(data) or not equals:
            break
        fields[name.decode(errors="replace")] = value
        at = stop
    return fields


def read_index(buffer: Buffer) -> Directory | None:
    """The directory from the index at the end of the bag; None where the bag was never closed or the index is damaged."""
    from importers.containers.record_scan import scan_bag

    op, _, _, header, start, _, _ = scan_bag(buffer[: 1 << 16], len(MAGIC))
    if not len(op) or op[0] != Op.BAG_HEADER:
        return None
    fields = header_fields(buffer[header[0] : start[0] - 4])
    index_at = int.from_bytes(fields.get("index_pos", b""), "little")
    if not start[0] <= index_at < len(buffer):
        return None
    op, _, _, header, start, stop, end = scan_bag(buffer, index_at)
    directory, offsets = Directory(), []
    for kind, head, begin, finish in zip(op, header, start, stop, strict=True):
        if kind == Op.CONNECTION and not directory.add(buffer[head : begin - 4], buffer[begin:finish]):
            return None
        if kind == Op.CHUNK_INFO:
            chunk = header_fields(buffer[head : begin - 4])
            offsets.append(int.from_bytes(chunk.get("chunk_pos", b""), "little"))
            for number, count in buffer[begin : finish - (finish - begin) % 8].view("<u4").reshape(-1, 2).tolist():
                directory.counts[number] = directory.counts.get(number, 0) + count
    promised = [int.from_bytes(fields.get(name, b""), "little") for name in ("conn_count", "chunk_count")]
    if end != len(buffer) or promised != [len(directory.connections), len(offsets)] or max(offsets, default=0) >= len(buffer):
        return None
    directory.chunk_offsets = np.array(sorted(offsets), dtype=np.int64)
    return directory


def walk_file(buffer: Buffer, landmarks: Offsets) -> Walk:
    """All records outside chunks; landmarks: known places of chunk records."""
    from importers.containers.record_scan import scan_bag

    def scan(part: Buffer, begin: int) -> tuple[np.ndarray, Offsets, Offsets, Offsets, int]:
        """See `walk_records`; a record begins with the length of its header."""
        op, _, _, header, start, stop, end = scan_bag(part, begin)
        return op, header - 4, start, stop, end

    return walk_records(scan, buffer, len(MAGIC), landmarks)


def open_chunk(record: Buffer) -> tuple[Buffer, bool] | None:
    """The records in a chunk record (from its header on) and whether they are all: of a chunk that was cut off, what is
    there. None where the record is no chunk. Raises DamagedDataError where they cannot be had."""
    header_stop = 4 + int.from_bytes(record[:4].tobytes(), "little")
    fields = header_fields(record[4:header_stop])
    if fields.get("op") != bytes([Op.CHUNK]) or header_stop + 4 > len(record):
        return None
    length = int.from_bytes(record[header_stop : header_stop + 4].tobytes(), "little")
    data = record[header_stop + 4 : header_stop + 4 + length].tobytes()
    compression = fields.get("compression", b"").decode(errors="replace")
    if len(data) < length:
        return np.frombuffer(decompress_prefix(compression, data), dtype=np.uint8), False
    size = int.from_bytes(fields.get("size", b""), "little")
    return np.frombuffer(decompress(compression, data, size), dtype=np.uint8), True
