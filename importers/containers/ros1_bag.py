"""Reader of ROS 1 bags (format 2.0): any compression, indexed or not, whole or damaged."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from importers.containers.bag_records import MAGIC, Directory, Op, header_fields, open_chunk, read_index, walk_file
from importers.containers.compression import DamagedDataError
from importers.containers.record_file import RecordFile
from importers.containers.record_walk import Walk
from importers.decoding.blocks import Block, Buffer, Decoder, Loss
from importers.decoding.channel_reading import name_numbers, read_channels
from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["Ros1Bag"]


class Ros1Bag:
    """A ROS 1 bag as a `Log`.

    A bag that was never closed (``.bag.active``) is scanned when opened. Of a damaged bag everything outside the damage is
    read; `notes` tells what was lost. Chunks carry no checksum in this format: in an uncompressed bag, damage to the
    measurements themselves cannot be seen. Raises LogError when nothing can be read.
    """

    format = "ros1"

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self._file = RecordFile(self.path, MAGIC, "a ROS 1 bag of format 2.0", walk_file)
        self._buffer = self._file.buffer
        self._directory = read_index(self._buffer) or self._scan()

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Log`."""
        return self._file.notes

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`; `name_numbers` tells which connections are one channel."""
        directory = self._directory
        return tuple(
            Channel(
                name,
                directory.connections[numbers[0]].type.replace("/", "/msg/", 1),
                "ros1",
                sum(directory.counts.get(number, 0) for number in numbers),
            )
            for name, numbers in self._numbers().items()
        )

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        return read_channels(self, names, self._numbers(), self._decoder, self._messages, self._directory.counts)

    def _numbers(self) -> dict[str, list[int]]:
        connections = self._directory.connections
        return name_numbers((number, connection.topic, connection.type) for number, connection in connections.items())

    def _decoder(self, number: int) -> Decoder:
        from importers.decoding.ros import RosDecoder
        from importers.decoding.ros_definitions import find_types

        connection = self._directory.connections[number]
        return RosDecoder(find_types(connection.type, connection.definition, "msg", "ros1"), "ros1")

    def _scan(self) -> Directory:
        """The directory of a bag without a usable index, from all its records."""
        self._file.note("no usable index (was the recording closed?); the bag was read through from its start")
        walk = self._file.walk(np.empty(0, dtype=np.int64))
        directory, counts = Directory(), Counter[int]()
        for place in np.flatnonzero(walk.op == Op.CONNECTION):
            directory.add(
                self._buffer[walk.at[place] + 4 : walk.start[place] - 4], self._buffer[walk.start[place] : walk.stop[place]]
            )
        for item in self._blocks(walk, None, directory):
            counts.update(item.counts if isinstance(item, Loss) else Counter(item.channel.tolist()))
        directory.counts = {number: counts[number] for number in directory.connections}
        if not directory.connections:
            raise LogError(
                f"{self.path}: no connection could be read from this bag; it holds no messages or is damaged beyond use"
            )
        return directory

    def _messages(self, wanted: set[int]) -> Iterator[Block | Loss]:
        return self._blocks(self._file.walk(self._directory.chunk_offsets), wanted, self._directory)

    def _blocks(self, walk: Walk, wanted: set[int] | None, directory: Directory) -> Iterator[Block | Loss]:
        """Blocks of all chunks that may hold a wanted connection (None: any). Connections met on the way enter the
        directory."""
        for at, stop, indexed in self._chunks(walk):
            if wanted is not None and indexed and not wanted & indexed.keys():
                continue
            try:
                opened = open_chunk(self._buffer[at:stop])
            except DamagedDataError as error:
                self._file.note(f"the chunk at byte {at} {error} and was left out")
                yield Loss(indexed, "in a damaged chunk")
                continue
            if opened is None:
                continue
            records, whole = opened
            if not whole:
                self._file.note(f"the chunk at byte {at} is cut off; {len(records)} bytes of it could be unpacked")
            yield self._chunk_block(records, directory, at if whole else None)

    def _chunks(self, walk: Walk) -> list[tuple[int, int, dict[int, int]]]:
        """Extent of each chunk record, in file order, and its messages per connection as far as indexed."""
        places = np.flatnonzero(walk.op == Op.CHUNK)
        chunks = [(int(walk.at[place]), int(walk.stop[place]), self._index_counts(walk, int(place))) for place in places]
        return sorted(chunks + [(offset, limit, {}) for offset, limit in walk.fragments], key=lambda chunk: chunk[0])

    def _chunk_block(self, records: Buffer, directory: Directory, at: int | None) -> Block:
        from importers.containers.record_scan import scan_bag

        op, conn, time, header, start, stop, end = scan_bag(records, 0)
        if at is not None and end != len(records):
            self._file.note(f"the chunk at byte {at} is damaged inside; {len(records) - end} bytes of it were left out")
        for place in np.flatnonzero(op == Op.CONNECTION):
            directory.add(records[header[place] : start[place] - 4], records[start[place] : stop[place]])
        message = (op == Op.MESSAGE) & (time >= 0)
        return Block(records, conn[message], time[message], start[message], stop[message])

    def _index_counts(self, walk: Walk, place: int) -> dict[int, int]:
        """Messages per connection by the index records behind a chunk; empty where it has none."""
        counts = {}
        for index in range(place + 1, len(walk.op)):
            if walk.op[index] != Op.INDEX:
                break
            fields = header_fields(self._buffer[walk.at[index] + 4 : walk.start[index] - 4])
            number, count = (int.from_bytes(fields.get(name, b""), "little") for name in ("conn", "count"))
            counts[number] = count
        return counts
