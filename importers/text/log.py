"""A text file as a log with one channel, or one for each role of its table."""

from collections.abc import Callable, Mapping
from pathlib import Path

from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["TableLog", "TextLog"]


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


class TableLog:
    """One table that serves several roles: a channel for each. The first is named as the file, others ``file#role``. drafts:
    lines of TOML that describe the table, where its meaning was read off its header."""

    def __init__(self, path: str, loads: Mapping[str, Callable[[], Table]], drafts: tuple[str, ...] = ()) -> None:
        self.path = path
        self.format = "csv"
        self.notes: tuple[str, ...] = ()
        self.drafts = drafts
        name = Path(path).name
        self._loads: dict[str, Callable[[], Table]] = {}
        channels = []
        for role, load in loads.items():
            own = f"{name}#{role}" if self._loads else name
            self._loads[own] = load
            channels.append(Channel(own, f"csv/{role}", "text", None))
        self._channels = tuple(channels)

    def channels(self) -> tuple[Channel, ...]:
        """A channel for each role."""
        return self._channels

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """The tables of the named channels. Raises LogError for another name, or where a column is missing."""
        for name in names:
            if name not in self._loads:
                raise LogError(f"{self.path}: has no channel {name}; its channels are {', '.join(self._loads)}")
        return {name: self._loads[name]() for name in names}
