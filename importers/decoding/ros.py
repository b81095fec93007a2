"""Decoder of ROS messages (CDR and ROS 1): by the column where the layout is fixed, else message by message with rosbags."""

import numpy as np
import zstandard
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from importers.decoding.blocks import Buffer, Columns, Decoded, Offsets, join_columns
from importers.decoding.fixed_layout import Layout, columns_of_rows, derive_layout, matching_rows
from importers.decoding.leaves import columns_of_messages
from importers.decoding.ros_definitions import RosType

__all__ = ["RosDecoder"]

_MAX_LAYOUTS = 16
_LARGEST_MESSAGE = 1 << 28
_ZSTD_MAGIC = bytes.fromhex("28b52ffd")


class RosDecoder:
    """Decodes the messages of one channel.

    Layouts found are kept and tried first on the next block; a channel with more than a few layouts (strings of ever new
    length) goes on message by message. Arrays of variable length, and arrays of messages, are object columns. ros_types: the
    type, or what it is in several releases: the one that decodes the first message is meant.
    """

    def __init__(self, ros_types: RosType | tuple[RosType, ...], encoding: str) -> None:
        self._releases = ros_types if isinstance(ros_types, tuple) else (ros_types,)
        self._type = self._releases[0]
        self._encoding = encoding
        self._layouts: list[Layout] = []
        self._derived = 0 if self._type.fixed else _MAX_LAYOUTS

    def decode(self, buffer: Buffer, start: Offsets, stop: Offsets) -> Decoded:
        """See `Decoder`; equal to rosbags' own decoding, bit for bit."""
        if self._encoding == "cdr":
            buffer, start, stop = _expand(buffer, start, stop)
        if len(self._releases) > 1 and len(start):
            self._choose_release(buffer[start[0] : stop[0]].tobytes())
        pieces: list[tuple[NDArray[np.intp], Columns]] = []
        left = np.arange(len(start))
        for layout in self._layouts:
            left = self._take(layout, buffer, start, stop, left, pieces)
        odd: list[int] = []
        while len(left) and self._derived < _MAX_LAYOUTS:
            self._derived += 1
            first = buffer[start[left[0]] : stop[left[0]]].tobytes()
            derived = derive_layout(self._type.leaves, first, self._encoding)
            rest = self._take(derived, buffer, start, stop, left, pieces) if derived else left
            if derived and len(rest) < len(left):
                self._layouts.append(derived)
                left = rest
            else:
                odd.append(left[0])
                left = left[1:]
        singly = np.sort(np.concatenate([np.array(odd, dtype=np.intp), left]))
        if len(singly) or not pieces:
            pieces.append(self._decode_singly(buffer, start, stop, singly))
        return Decoded(*_in_order(pieces), reason=f"not decodable as {self._type.name}")

    def _choose_release(self, message: bytes) -> None:
        for release in self._releases:
            self._type = release
            if self._deserialize(message) is not None:
                self._releases = (release,)
                break
        else:
            self._type = self._releases[0]
        self._derived = 0 if self._type.fixed else _MAX_LAYOUTS

    def _take(
        self,
        layout: Layout,
        buffer: Buffer,
        start: Offsets,
        stop: Offsets,
        left: NDArray[np.intp],
        pieces: list[tuple[NDArray[np.intp], Columns]],
    ) -> NDArray[np.intp]:
        """Decode those of the messages left that have the layout; returns the rest."""
        if not len(left):
            return left
        places, rows = matching_rows(layout, buffer, start[left], stop[left])
        if not len(places):
            return left
        try:
            pieces.append((left[places], columns_of_rows(self._type.leaves, rows)))
        except UnicodeDecodeError:
            return left  # one by one, so that only the bad ones are lost
        return np.delete(left, places)

    def _decode_singly(
        self, buffer: Buffer, start: Offsets, stop: Offsets, places: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], Columns]:
        kept, messages = [], []
        for place in places:
            message = self._deserialize(buffer[start[place] : stop[place]].tobytes())
            if message is not None:  # the others are counted by their absence from kept
                messages.append(message)
                kept.append(place)
        return np.array(kept, dtype=np.intp), columns_of_messages(self._type.leaves, messages)

    def _deserialize(self, content: bytes) -> object | None:
        store = self._type.store
        deserialize = store.deserialize_cdr if self._encoding == "cdr" else store.deserialize_ros1
        try:
            return deserialize(content, self._type.name)
        except SerdeError:
            return None


def _in_order(pieces: list[tuple[NDArray[np.intp], Columns]]) -> tuple[Columns, NDArray[np.intp]]:
    if len(pieces) == 1:
        places, columns = pieces[0]
        return columns, places
    places = np.concatenate([places for places, _ in pieces])
    joined = join_columns([dict(columns) for _, columns in pieces], [len(places) for places, _ in pieces])
    order = np.argsort(places)
    return {path: column[order] for path, column in joined.items()}, places[order]


def _expand(buffer: Buffer, start: Offsets, stop: Offsets) -> tuple[Buffer, Offsets, Offsets]:
    """Messages that rosbag2 compressed one by one, decompressed; a CDR message begins with 0, never as a zstd frame does."""
    if not (buffer[start[stop > start]] == _ZSTD_MAGIC[0]).any():
        return buffer, start, stop
    messages = [buffer[a:b].tobytes() for a, b in zip(start, stop, strict=True)]
    messages = [_decompress(message) if message.startswith(_ZSTD_MAGIC) else message for message in messages]
    lengths = np.array([len(message) for message in messages], dtype=np.int64)
    ends = np.cumsum(lengths)
    return np.frombuffer(b"".join(messages), dtype=np.uint8), ends - lengths, ends


def _decompress(frame: bytes) -> bytes:
    """The message; empty where it is damaged, or larger than any is."""
    try:
        with zstandard.ZstdDecompressor().stream_reader(frame) as reader:
            message = reader.read(_LARGEST_MESSAGE + 1)
        return message if len(message) <= _LARGEST_MESSAGE else b""
    except zstandard.ZstdError:
        return b""
