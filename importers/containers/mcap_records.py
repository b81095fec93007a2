"""Structure of an MCAP file: the walk over its records, chunks, and the directory of schemas and channels.

Source: the MCAP specification (https://mcap.dev/spec). Single records are parsed by the `mcap` library.
"""

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import Protocol, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema, Statistics
from numpy.typing import NDArray

from importers.containers.compression import DamagedDataError, decompress, decompress_prefix
from importers.containers.record_walk import Walk, walk_records
from importers.decoding.blocks import Buffer, Offsets

__all__ = [
    "MAGIC",
    "MESSAGE_HEADER",
    "RECORD_HEAD",
    "Directory",
    "footer_of",
    "is_summary_damaged",
    "open_chunk",
    "parse_record",
    "read_summary",
    "walk_file",
]

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEADER = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8"), ("publish_time", "<u8")])
RECORD_HEAD = 9
_FOOTER_LENGTH = 20
_CHUNK_HEADER = struct.Struct("<QQQII")
_PARSE_ERRORS = (McapError, struct.error, UnicodeDecodeError, OverflowError, ValueError)

R = TypeVar("R", covariant=True)


class _Parser(Protocol[R]):
    @staticmethod
    def read(stream: ReadDataStream) -> R:
        """The record that the stream holds."""
        ...


def parse_record(kind: _Parser[R], content: Buffer) -> R | None:
    """A record of the `mcap` library from its content; None where it is damaged."""
    try:
        return kind.read(ReadDataStream(BytesIO(content.tobytes())))
    except _PARSE_ERRORS:
        return None


@dataclass(slots=True)
class Directory:
    """Schemas and channels by number. counts: messages per channel, None where only reading would tell. chunk_offsets:
    places of the chunk records, ascending, as far as known."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    chunk_offsets: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def add(self, opcode: int, content: Buffer) -> bool:
        """Take up a schema or channel record; False where it is damaged."""
        if opcode == Opcode.SCHEMA:
            schema = parse_record(Schema, content)
            if schema:
                self.schemas.setdefault(schema.id, schema)
            return schema is not None
        channel = parse_record(Channel, content)
        if channel:
            self.channels.setdefault(channel.id, channel)
        return channel is not None

    def is_complete(self) -> bool:
        """False where channels or schemas are missing; a summary need not repeat them."""
        unknown = (self.counts or {}).keys() - self.channels.keys()
        needed = {channel.schema_id for channel in self.channels.values()} - {0}
        return bool(self.channels) and not unknown and needed <= self.schemas.keys()


def footer_of(buffer: Buffer) -> Footer | None:
    """The footer of a file that was closed; None where the end of the file is missing or damaged."""
    footer_at = len(buffer) - len(MAGIC) - _FOOTER_LENGTH
    if (
        footer_at < len(MAGIC) + RECORD_HEAD
        or buffer[-len(MAGIC) :].tobytes() != MAGIC
        or buffer[footer_at - RECORD_HEAD] != Opcode.FOOTER
    ):
        return None
    return parse_record(Footer, buffer[footer_at : footer_at + _FOOTER_LENGTH])


def is_summary_damaged(buffer: Buffer) -> bool:
    """Whether a closed file has a summary section that cannot be where its footer says, or fails its checksum."""
    footer = footer_of(buffer)
    if footer is None or footer.summary_start == 0:
        return False
    if not len(MAGIC) < footer.summary_start < len(buffer) - len(MAGIC) - _FOOTER_LENGTH:
        return True
    return (
        footer.summary_crc != 0 and zlib.crc32(buffer[footer.summary_start : -len(MAGIC) - 4].tobytes()) != footer.summary_crc
    )


def read_summary(buffer: Buffer) -> Directory | None:
    """The directory from the summary section; None where the file has none, or a damaged or incomplete one."""
    from importers.containers.record_scan import scan_mcap

    footer = footer_of(buffer)
    if footer is None or footer.summary_start == 0 or is_summary_damaged(buffer):
        return None
    directory, offsets = Directory(), []
    for opcode, start, stop in zip(*scan_mcap(buffer, footer.summary_start)[:3], strict=True):
        content = buffer[start:stop]
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            if not directory.add(opcode, content):
                return None
        elif opcode == Opcode.STATISTICS:
            statistics = parse_record(Statistics, content)
            directory.counts = statistics and statistics.channel_message_counts
        elif opcode == Opcode.CHUNK_INDEX:
            index = parse_record(ChunkIndex, content)
            if index is None or index.chunk_start_offset >= len(buffer):
                return None
            offsets.append(index.chunk_start_offset)
    directory.chunk_offsets = np.array(sorted(offsets), dtype=np.int64)
    return directory if directory.is_complete() else None


def walk_file(buffer: Buffer, landmarks: Offsets) -> Walk:
    """All records outside chunks; landmarks: known places of chunk records."""
    from importers.containers.record_scan import scan_mcap

    def scan(part: Buffer, begin: int) -> tuple[np.ndarray, Offsets, Offsets, Offsets, int]:
        """See `walk_records`."""
        opcode, start, stop, end = scan_mcap(part, begin)
        return opcode, start - RECORD_HEAD, start, stop, end

    return walk_records(scan, buffer, len(MAGIC), landmarks)


def open_chunk(content: Buffer) -> tuple[Buffer, bool]:
    """The records in a chunk, and whether they are all: of a chunk that was cut off, what is there.

    Raises DamagedDataError where they cannot be had or fail their checksum.
    """
    if len(content) < _CHUNK_HEADER.size:
        return content[:0], False
    _, _, size, crc, name_length = _CHUNK_HEADER.unpack(content[: _CHUNK_HEADER.size].tobytes())
    data_at = _CHUNK_HEADER.size + name_length + 8
    if data_at > len(content):
        raise DamagedDataError("has a damaged header")
    name = content[_CHUNK_HEADER.size : data_at - 8].tobytes().decode("ascii", "replace")
    length = int.from_bytes(content[data_at - 8 : data_at].tobytes(), "little")
    data = content[data_at : data_at + length].tobytes()
    if len(data) < length:
        return np.frombuffer(decompress_prefix(name, data), dtype=np.uint8), False
    records = decompress(name, data, size)
    if crc and zlib.crc32(records) != crc:
        raise DamagedDataError("fails its checksum")
    return np.frombuffer(records, dtype=np.uint8), True
