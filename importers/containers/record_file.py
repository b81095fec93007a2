"""A container file of records: its bytes, the walk over them, and what is told of its damage."""

from collections.abc import Callable

from importers.containers.file_bytes import map_file
from importers.containers.record_walk import Walk
from importers.decoding.blocks import Buffer, Offsets

__all__ = ["RecordFile"]


class RecordFile:
    """Mapped bytes of the file at path and, once asked for, its records. notes: sentences on damage, each once."""

    def __init__(self, path: str, magic: bytes, what: str, walk_file: Callable[[Buffer, Offsets], Walk]) -> None:
        self.buffer = map_file(path, magic, what)
        self.notes: tuple[str, ...] = ()
        self._walk_file = walk_file
        self._records: Walk | None = None

    def note(self, text: str) -> None:
        """Keeps a sentence."""
        if text not in self.notes:
            self.notes = (*self.notes, text)

    def walk(self, landmarks: Offsets) -> Walk:
        """The records outside chunks, walked once; landmarks: known places of chunk records."""
        if self._records is None:
            self._records = self._walk_file(self.buffer, landmarks)
            for offset, limit in self._records.fragments:
                self.note(f"damaged from byte {offset} to {limit} of {len(self.buffer)}; the rest was read")
        return self._records
