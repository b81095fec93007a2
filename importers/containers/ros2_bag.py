"""Reader of ROS 2 bags: a directory with metadata.yaml, or a bare storage file; sqlite3 and MCAP storage."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from importers.containers.file_bytes import storage_suffix
from importers.containers.mcap import McapLog
from importers.containers.packed import packing_of, unpack_file
from importers.containers.sqlite_storage import SqliteStorage
from importers.decoding.blocks import join_columns
from importers.decoding.channel_reading import require_channels
from importers.rows.log import Channel, Log, Table
from navreplay.timeline import LogError

__all__ = ["Ros2Bag"]

_BY_CONTENT: tuple[tuple[bytes, Callable[[str], Log]], ...] = ((b"SQLite format 3", SqliteStorage), (b"\x89MCAP", McapLog))


class Ros2Bag:
    """A ROS 2 bag as a `Log`, of one or several storage files, plain or compressed with zstd (by file or by message).

    Without metadata.yaml (a recording that was not closed) all storage files of the directory are read in the order of their
    numbers. A part that is missing or cannot be read is told in `notes`; messages that metadata.yaml promises and that did
    not turn up are rejected. Raises LogError when no part can be read.
    """

    format = "ros2"

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self.notes: tuple[str, ...] = ()
        self._promised: dict[str, int] = {}
        self._parts: list[Log] = []
        refusals: list[str] = []
        for part in self._part_paths(Path(path)):
            try:
                self._parts.append(self._open(part))
            except LogError as error:
                refusals.append(str(error))
        if not self._parts:
            raise LogError(refusals[0] if refusals else f"{self.path}: no storage file (.db3 or .mcap) of a ROS 2 bag in it")
        self._note(*refusals)
        self._note_parts()

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        found: dict[str, list[Channel]] = {}
        for part in self._parts:
            for channel in part.channels():
                found.setdefault(channel.name, []).append(channel)
        return tuple(
            Channel(name, same[0].type, same[0].encoding, _sum([channel.count for channel in same]))
            for name, same in found.items()
        )

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        require_channels(self.path, names, self.channels())
        tables: dict[str, list[Table]] = {name: [] for name in names}
        for part in self._parts:
            here = {channel.name for channel in part.channels()}
            for name, table in part.read(tuple(name for name in names if name in here)).items():
                tables[name].append(table)
        self._note_parts()
        return {name: self._joined(name, parts) for name, parts in tables.items()}

    def _joined(self, name: str, parts: list[Table]) -> Table:
        lengths = [len(table.log_time_ns) for table in parts]
        rejected = Counter[str]()
        for table in parts:
            rejected.update(table.rejected)
        read = sum(table.read for table in parts)
        missing = self._promised.get(name, 0) - read
        if missing > 0:
            rejected["in a missing or damaged part"] += missing
        columns = join_columns([dict(table.columns) for table in parts], lengths)
        times = np.concatenate([table.log_time_ns for table in parts])
        return Table(times, columns, read + max(missing, 0), dict(rejected))

    def _note(self, *texts: str) -> None:
        self.notes = (*self.notes, *(text for text in texts if text not in self.notes))

    def _note_parts(self) -> None:
        for part in self._parts:
            self._note(*(f"{Path(part.path).name}: {note}" for note in part.notes))

    def _part_paths(self, path: Path) -> list[Path]:
        """The storage files, in order."""
        if not path.is_dir():
            return [path]
        listed = self._read_metadata(path / "metadata.yaml")
        missing = [name for name in listed if not (path / name).exists()]
        self._note(*(f"part {name} is listed in metadata.yaml but missing" for name in missing))
        present = [path / name for name in listed if name not in missing]
        if present:
            return present
        files = [file for file in path.iterdir() if storage_suffix(file)]
        return sorted(files, key=lambda file: (len(file.name), file.name))

    def _read_metadata(self, path: Path) -> list[str]:
        """File names that the metadata list; also takes up the message counts they promise."""
        try:
            information = YAML(typ="safe").load(path.read_text())["rosbag2_bagfile_information"]
            promised = {
                topic["topic_metadata"]["name"]: int(topic["message_count"])
                for topic in information["topics_with_message_count"]
            }
            listed = [Path(name).name for name in information["relative_file_paths"]]
        except FileNotFoundError:
            self._note("metadata.yaml is missing (was the recording closed?); all storage files of the directory were read")
            return []
        except (OSError, YAMLError, KeyError, TypeError, ValueError):
            self._note("metadata.yaml is damaged; all storage files of the directory were read")
            return []
        self._promised = promised
        return listed

    def _open(self, path: Path) -> Log:
        packing = packing_of(_head(path))
        if packing:
            packed, (path, note) = path, unpack_file(str(path), packing, self)
            if note:
                self._note(f"{packed.name}: {note}")
        return next((storage for magic, storage in _BY_CONTENT if _head(path).startswith(magic)), SqliteStorage)(str(path))


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(16)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _sum(counts: list[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None
