"""A file whose channels are read when asked."""

from collections.abc import Callable, Sequence

import numpy as np

from importers.decoding.channel_reading import require_channels
from importers.rows.log import Channel, Table

__all__ = ["ChannelLog"]


class ChannelLog:
    """A `Log` of channels, each with what reads it."""

    def __init__(
        self, path: str, format: str, readers: Sequence[tuple[Channel, Callable[[], Table]]], notes: Sequence[str] = ()
    ) -> None:
        self.path = path
        self.format = format
        self.notes: tuple[str, ...] = tuple(notes)
        self._readers = {channel.name: (channel, read) for channel, read in readers}

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        return tuple(channel for channel, _ in self._readers.values())

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`."""
        require_channels(self.path, names, self.channels())
        with np.errstate(invalid="ignore", over="ignore"):  # bytes of damaged numbers are no news: what they give is screened
            return {name: self._readers[name][1]() for name in names}
