"""Reader of MCAP logs: any compression, with or without index, whole or damaged."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
from mcap.opcode import Opcode

from importers.containers.compression import DamagedDataError
from importers.containers.mcap_records import (
    MAGIC,
    MESSAGE_HEADER,
    RECORD_HEAD,
    Directory,
    footer_of,
    is_summary_damaged,
    open_chunk,
    read_summary,
    walk_file,
)
from importers.containers.record_file import RecordFile
from importers.containers.record_walk import Walk
from importers.decoding.blocks import Block, Buffer, Decoder, Loss, Offsets
from importers.decoding.channel_reading import name_numbers, read_channels
from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["McapLog"]

_BLOCK_MESSAGES = 1 << 15
_IDL = "ros2idl"


class McapLog:
    """An MCAP file as a `Log`.

    Message encodings ``cdr``, ``ros1``, ``json`` and ``protobuf``. A file without an index is scanned when opened; that is told
    only where the recording was not closed, or its index is damaged. A closed file may hold no channel at all. Of a damaged
    file everything outside the damage is read; `notes` tells what was lost. Messages in a damaged chunk are counted as
    rejected where the file's indexes tell their number. Raises LogError when nothing can be read.
    """

    format = "mcap"

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self._file = RecordFile(self.path, MAGIC, "an MCAP file", walk_file)
        self._buffer = self._file.buffer
        self._directory = read_summary(self._buffer) or self._scan()

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Log`."""
        return self._file.notes

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`; `name_numbers` tells which channel numbers are one channel."""
        counts = self._directory.counts
        channels = []
        for name, numbers in self._numbers().items():
            first = self._directory.channels[numbers[0]]
            count = None if counts is None else sum(counts.get(number, 0) for number in numbers)
            channels.append(Channel(name, self._type(numbers[0]), first.message_encoding, count))
        return tuple(channels)

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        return read_channels(self, names, self._numbers(), self._decoder, self._messages, self._directory.counts)

    def _numbers(self) -> dict[str, list[int]]:
        channels = self._directory.channels
        return name_numbers((number, channel.topic, self._type(number)) for number, channel in channels.items())

    def _type(self, number: int) -> str:
        channel = self._directory.channels[number]
        schema = self._directory.schemas.get(channel.schema_id)
        name = schema.name if schema else ""
        if channel.message_encoding in ("cdr", "ros1") and name.count("/") == 1:
            return name.replace("/", "/msg/")
        return name

    def _decoder(self, number: int) -> Decoder:
        channel = self._directory.channels[number]
        schema = self._directory.schemas.get(channel.schema_id)
        encoding = channel.message_encoding
        if encoding == "json":
            from importers.decoding.json_text import JsonDecoder

            return JsonDecoder()
        if schema is None:
            raise LogError(
                f"its schema {channel.schema_id} is missing in the file, so its {encoding or 'unnamed'} messages cannot be read"
            )
        if encoding == "protobuf":
            from importers.decoding.protobuf import ProtobufDecoder

            return ProtobufDecoder(schema.name, schema.data)
        if encoding in ("cdr", "ros1"):
            from importers.decoding.ros import RosDecoder
            from importers.decoding.ros_definitions import find_types

            language = "idl" if schema.encoding == _IDL else "msg"
            return RosDecoder(find_types(schema.name, schema.data.decode(errors="replace"), language, encoding), encoding)
        raise LogError(f"message encoding {encoding!r} is not supported; cdr, ros1, json and protobuf are")

    def _scan(self) -> Directory:
        """The directory of a file without a usable index, from all its records."""
        closed = footer_of(self._buffer) is not None
        if not closed:
            self._file.note("no usable index (was the recording closed?); the file was read through from its start")
        elif is_summary_damaged(self._buffer):
            self._file.note("its index is damaged; the file was read through from its start")
        walk = self._file.walk(np.empty(0, dtype=np.int64))
        directory, counts = Directory(), Counter[int]()
        for place in np.flatnonzero((walk.op == Opcode.SCHEMA) | (walk.op == Opcode.CHANNEL)):
            directory.add(walk.op[place], self._buffer[walk.start[place] : walk.stop[place]])
        for item in self._blocks(walk, None, directory):
            if isinstance(item, Block):
                counts.update(dict(enumerate(np.bincount(item.channel).tolist())))
            else:
                counts.update(item.counts)
        directory.counts = {number: counts[number] for number in directory.channels}
        if not directory.channels and (not closed or walk.fragments):
            raise LogError(
                f"{self.path}: no channel could be read from this MCAP file; it was cut off early, or is damaged beyond use"
            )
        return directory

    def _messages(self, wanted: set[int]) -> Iterator[Block | Loss]:
        return self._blocks(self._file.walk(self._directory.chunk_offsets), wanted, self._directory)

    def _blocks(self, walk: Walk, wanted: set[int] | None, directory: Directory) -> Iterator[Block | Loss]:
        """Blocks of all chunks that may hold a wanted channel (None: any), then of the messages outside chunks. Schemas and
        channels met on the way enter the directory."""
        for start, stop, indexed in self._chunks(walk):
            if wanted is not None and indexed and not wanted & indexed.keys():
                continue
            try:
                records, whole = open_chunk(self._buffer[start:stop])
            except DamagedDataError as error:
                self._file.note(f"the chunk at byte {start} {error} and was left out")
                yield Loss(indexed, "in a damaged chunk")
                continue
            if not whole:
                self._file.note(f"the chunk at byte {start} is cut off; {len(records)} bytes of it could be unpacked")
            yield from self._chunk_blocks(records, directory, start if whole else None)
        yield from _message_blocks(self._buffer, walk.op, walk.start, walk.stop)

    def _chunks(self, walk: Walk) -> list[tuple[int, int, dict[int, int]]]:
        """Extent of each chunk's content, in file order, and its messages per channel as far as indexed."""
        places = np.flatnonzero(walk.op == Opcode.CHUNK)
        chunks: list[tuple[int, int, dict[int, int]]]
        chunks = [(int(walk.start[place]), int(walk.stop[place]), self._index_counts(walk, int(place))) for place in places]
        for offset, limit in walk.fragments:
            if self._buffer[offset] == Opcode.CHUNK:
                chunks.append((offset + RECORD_HEAD, limit, {}))
        return sorted(chunks, key=lambda chunk: chunk[0])

    def _chunk_blocks(self, records: Buffer, directory: Directory, at: int | None) -> Iterator[Block]:
        from importers.containers.record_scan import scan_mcap

        opcode, start, stop, end = scan_mcap(records, 0)
        if at is not None and end != len(records):
            self._file.note(f"the chunk at byte {at} is damaged inside; {len(records) - end} bytes of it were left out")
        for place in np.flatnonzero((opcode == Opcode.SCHEMA) | (opcode == Opcode.CHANNEL)):
            directory.add(opcode[place], records[start[place] : stop[place]])
        yield from _message_blocks(records, opcode, start, stop)

    def _index_counts(self, walk: Walk, place: int) -> dict[int, int]:
        """Messages per channel number by the index records behind a chunk; empty where it has none."""
        counts = {}
        for index in range(place + 1, len(walk.op)):
            if walk.op[index] != Opcode.MESSAGE_INDEX or walk.stop[index] - walk.start[index] < 6:
                break
            channel, length = self._buffer[walk.start[index] : walk.start[index] + 6].view(
                [("channel", "<u2"), ("length", "<u4")]
            )[0]
            counts[int(channel)] = int(length) // 16
        return counts


def _message_blocks(buffer: Buffer, opcode: np.ndarray, start: Offsets, stop: Offsets) -> Iterator[Block]:
    """Message records among the records of a buffer, some ten thousand at a time."""
    header = MESSAGE_HEADER.itemsize
    places = np.flatnonzero((opcode == Opcode.MESSAGE) & (stop - start >= header))
    for first in range(0, len(places), _BLOCK_MESSAGES):
        some = places[first : first + _BLOCK_MESSAGES]
        windows = np.ndarray((len(buffer) - header + 1,), f"V{header}", buffer, strides=(1,))
        heads = windows[start[some]].view(MESSAGE_HEADER)
        times = heads["log_time"].astype(np.int64)
        yield Block(buffer, heads["channel"].astype(np.int64), times, start[some] + header, stop[some])
