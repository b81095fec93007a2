"""A log read in place of another file: what came out of a packed one, or was fetched."""

from collections.abc import Callable
from typing import TypeVar

from importers.rows.log import Channel, Log, Table
from navreplay.timeline import LogError

__all__ = ["Scratch", "StandIn", "told_as"]

R = TypeVar("R")


class Scratch:
    """Owns scratch files: they go away with it."""


def told_as(path: str, scratch: str, action: Callable[[], R]) -> R:
    """What the action returns; its LogError names path in place of the scratch file."""
    try:
        return action()
    except LogError as error:
        raise LogError(str(error).replace(scratch, path)) from error


class StandIn:
    """A log under the path that the user named. local: the file that is here, for its size and digest. note: a sentence on
    damage while it was unpacked."""

    def __init__(self, log: Log, path: str, scratch: str, owner: Scratch, local: str, note: str = "") -> None:
        self.path, self.format, self.local = path, log.format, local
        self._log, self._scratch, self._owner, self._note = log, scratch, owner, note

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Log`."""
        return (*([self._note] if self._note else []), *(note.replace(self._scratch, self.path) for note in self._log.notes))

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        return self._log.channels()

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        return told_as(self.path, self._scratch, lambda: self._log.read(names))
