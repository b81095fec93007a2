"""Reader of one sqlite3 storage file (.db3) of a ROS 2 bag."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path

import numpy as np

from importers.containers.file_bytes import map_file, scratch_file
from importers.decoding.blocks import Block, Buffer, Decoder
from importers.decoding.channel_reading import read_tables, require_channels
from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["SqliteStorage"]

_MAGIC = b"SQLite format 3\0"
_BLOCK_MESSAGES = 1 << 12
_LANGUAGES = {"ros2msg": "msg", "ros2idl": "idl"}


class SqliteStorage:
    """A .db3 file as a `Log`. Of a damaged file the messages up to the damage are read. Raises LogError when it is no sqlite3
    database, or not one of ROS 2."""

    format = "ros2"

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self.notes: tuple[str, ...] = ()
        self._database = self._whole_pages(map_file(self.path, _MAGIC, "a sqlite3 storage file of ROS 2"))
        try:
            self._load()
        except sqlite3.DatabaseError as error:
            reason = str(error).partition("\n")[0]
            raise LogError(
                f"{self.path}: no readable ROS 2 storage ({reason}); is the file damaged, or of another program?"
            ) from error

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        channels = {name: Channel(name, kind, form, None) for name, kind, form in self._topics.values()}
        if self._counts is None:
            return tuple(channels.values())
        return tuple(
            Channel(name, channel.type, channel.encoding, sum(self._counts.get(number, 0) for number in self._numbers(name)))
            for name, channel in channels.items()
        )

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        require_channels(self.path, names, self.channels())
        numbers = {name: self._numbers(name) for name in names}
        return read_tables(numbers, self._decoder, self._messages, self._counts)

    def _whole_pages(self, content: Buffer) -> Path:
        """The file, or a copy without its last page where that was cut: SQLite would take what is missing for zeros."""
        page = int.from_bytes(content[16:18].tobytes(), "big")
        rest = len(content) % (page if page > 1 else 65536)
        if not rest:
            return Path(self.path)
        self._note(f"the file is cut off within a page; its last {rest} bytes were left out")
        copy = scratch_file(self, Path(self.path).name)
        content[: len(content) - rest].tofile(copy)
        return copy

    def _connect(self) -> sqlite3.Connection:
        # Without a write-ahead log beside it nobody writes to the file, so it need not be locked (nor its folder writable).
        writing = self._database.with_name(f"{self._database.name}-wal").exists()
        mode = "mode=ro" if writing else "immutable=1"
        database = sqlite3.connect(f"{self._database.absolute().as_uri()}?{mode}", uri=True)
        # Nothing is written; this is what lets SQLite open a file that is shorter than its header says.
        database.execute("PRAGMA writable_schema = ON")
        return database

    def _load(self) -> None:
        with closing(self._connect()) as database:
            rows = database.execute("SELECT id, name, type, serialization_format FROM topics ORDER BY id").fetchall()
            self._topics: dict[int, tuple[str, str, str]] = {row[0]: (str(row[1]), str(row[2]), str(row[3])) for row in rows}
            self._definitions: dict[str, tuple[str, str]] = {}
            if database.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
                query = "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
                for kind, text, encoding in database.execute(query):
                    self._definitions[str(kind)] = (str(text), _LANGUAGES.get(encoding, "msg"))
            self._counts: dict[int, int] | None = None
            try:
                self._counts = dict(database.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
            except sqlite3.DatabaseError as error:
                self._note(f"the messages cannot be counted ({error}); the file is damaged")

    def _numbers(self, name: str) -> list[int]:
        return [number for number, topic in self._topics.items() if topic[0] == name]

    def _decoder(self, number: int) -> Decoder:
        from importers.decoding.ros import RosDecoder
        from importers.decoding.ros_definitions import find_types

        _, kind, encoding = self._topics[number]
        if encoding != "cdr":
            raise LogError(f"serialization format {encoding!r} is not supported; cdr is")
        return RosDecoder(find_types(kind, *self._definitions.get(kind, ("", "msg")), "cdr"), "cdr")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes = (*self.notes, text)

    def _messages(self, wanted: set[int]) -> Iterator[Block]:
        marks = ",".join("?" * len(wanted))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
        with closing(self._connect()) as database:
            cursor = database.cursor()
            try:
                cursor.execute(query, tuple(wanted))
            except sqlite3.DatabaseError as error:
                self._note(f"no message can be read ({error}); the file is damaged")
            block = _block_of(cursor, self._note)
            while block:
                yield block
                block = _block_of(cursor, self._note)


def _block_of(cursor: sqlite3.Cursor, note: Callable[[str], None]) -> Block | None:
    """The next few thousand rows (topic, time, message); None at the end, and behind damage."""
    topics, times, stops, buffer = [], [], [0], bytearray()
    try:
        for topic, time, message in islice(cursor, _BLOCK_MESSAGES):
            # A damaged row may hold anything; that it is lost shows in the balance with the count.
            if isinstance(time, int) and isinstance(message, bytes):
                buffer += message
                topics.append(topic)
                times.append(time)
                stops.append(len(buffer))
    except sqlite3.DatabaseError as error:
        note(f"reading stopped at damage in the file ({error}); messages before it were kept")
    if not times:
        return None
    limits = np.array(stops, dtype=np.int64)
    content = np.frombuffer(buffer, dtype=np.uint8)
    return Block(content, np.array(topics, dtype=np.int64), np.array(times, dtype=np.int64), limits[:-1], limits[1:])
