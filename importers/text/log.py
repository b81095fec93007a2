"""A text file as a log with one channel."""

from collections.abc import Callable
from pathlib import Path

from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["TextLog"]


class TextLog:
    """One text file, read when asked. type: name of its layout. load: parses it."""

    def __init__(self, path: str, format: str, type: str, load: Callable[[], Table]) -> None:
        self.path = path
        self.format = format
        self.notes: tuple[str, ...] = ()
        self._channel = Channel(Path(path).name, type, "text", None)
        self._load = load

    def channels(self) -> tuple[Channel, ...]:
        """The one channel, named as the file."""
        return (self._channel,)

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """The file as a table. Raises LogError for another name than the file's, or where its layout does not hold."""
        for name in names:
            if name != self._channel.name:
                raise LogError(f"{self.path}: has no channel {name}; its only channel is {self._channel.name}")
        return {name: self._load() for name in names}
