"""u-blox streams: raw measurements (RXM-RAWX) and broadcast navigation data (RXM-SFRBX), whatever stands between them.

Source: u-blox F9 HPG 1.32 interface description (UBX-22008968), 3.1 and 3.17.
"""

import numpy as np
from numpy.typing import NDArray

from importers.containers.file_bytes import map_file
from importers.decoding.channel_reading import require_channels
from importers.rows.log import Channel, Table
from importers.ublox.measurements import RAWX_BLOCK, RAWX_HEAD, measurement_columns
from navreplay.geodesy.time_scales import gps_from_week_tow

__all__ = ["UbxLog", "is_ubx"]

_SYNC = b"\xb5\x62"
_FRAME = 8
_RAWX, _SFRBX = 0x15, 0x13
_NAMES = {_RAWX: "RXM-RAWX", _SFRBX: "RXM-SFRBX"}
_RXM = 0x02
_RAWX_HEAD_BYTES, _SFRBX_HEAD_BYTES = RAWX_HEAD.itemsize, 8
_WORDS = 10


def is_ubx(head: bytes) -> bool:
    """Whether a beginning holds a whole message of one of the two kinds."""
    frames, _, _ = _find_frames(np.frombuffer(head, dtype=np.uint8))
    return any(len(starts) for starts, _ in frames.values())


class UbxLog:
    """A UBX stream as a `Log`, with the channels RXM-RAWX and RXM-SFRBX as far as there are any."""

    format = "ubx"

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self._buffer = map_file(self.path, b"", "a UBX stream")
        self._frames, self._wrong, cut = _find_frames(self._buffer)
        self.notes: tuple[str, ...] = ("ends within a message, which was left out",) if cut else ()

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        return tuple(
            Channel(name, f"ubx/{name}", "ubx", len(self._frames[kind][0]) + self._wrong[kind])
            for kind, name in _NAMES.items()
            if len(self._frames[kind][0]) + self._wrong[kind]
        )

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`. RXM-RAWX has a row per measurement; RXM-SFRBX a row per message."""
        require_channels(self.path, names, self.channels())
        return {name: self._measurements() if name == _NAMES[_RAWX] else self._words() for name in names}

    def _measurements(self) -> Table:
        start, length = self._frames[_RAWX]
        blocks = (length - _RAWX_HEAD_BYTES) // RAWX_BLOCK.itemsize
        heads = _gather(self._buffer, start, _RAWX_HEAD_BYTES).view(RAWX_HEAD)[:, 0]
        message = np.repeat(np.arange(len(start)), blocks)
        within = np.arange(len(message)) - np.repeat(np.cumsum(blocks) - blocks, blocks)
        places = start[message] + _RAWX_HEAD_BYTES + within * RAWX_BLOCK.itemsize
        rows = _gather(self._buffer, places, RAWX_BLOCK.itemsize).view(RAWX_BLOCK)[:, 0]
        times = _times(heads)
        rejected = {"checksum wrong": self._wrong[_RAWX], "epoch without satellites": int((blocks == 0).sum())}
        rejected = {reason: count for reason, count in rejected.items() if count}
        columns = measurement_columns(times[message], rows)
        return Table(times[message], columns, len(message) + sum(rejected.values()), rejected)

    def _words(self) -> Table:
        start, length = self._frames[_SFRBX]
        head = _gather(self._buffer, start, _SFRBX_HEAD_BYTES)
        payload = _gather(self._buffer, start + _SFRBX_HEAD_BYTES, 4 * _WORDS)
        words = payload.view("<u4").astype(np.int64)
        words[np.arange(_WORDS) >= ((length - _SFRBX_HEAD_BYTES) // 4)[:, None]] = 0
        times = self._word_times(start)
        columns: dict[str, np.ndarray] = {"t_gps_ns": times, "gnssId": head[:, 0], "svId": head[:, 1], "freqId": head[:, 3]}
        columns["dwrd"] = words
        rejected = {"checksum wrong": self._wrong[_SFRBX]} if self._wrong[_SFRBX] else {}
        return Table(times, columns, len(start) + self._wrong[_SFRBX], rejected)

    def _word_times(self, start: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of the measurements before each message; 0 where there are none."""
        epochs, _ = self._frames[_RAWX]
        if len(epochs) == 0:
            return np.zeros(len(start), dtype=np.int64)
        times = _times(_gather(self._buffer, epochs, _RAWX_HEAD_BYTES).view(RAWX_HEAD)[:, 0])
        return times[np.maximum(np.searchsorted(epochs, start) - 1, 0)]


def _times(heads: NDArray[np.void]) -> NDArray[np.int64]:
    """Receive times; 0 where the seconds are no seconds of a week."""
    good = (heads["rcvTow"] >= 0) & (heads["rcvTow"] < 604_801)
    return np.where(good, gps_from_week_tow(heads["week"], np.where(good, heads["rcvTow"], 0.0)), 0)


def _gather(buffer: NDArray[np.uint8], start: NDArray[np.int64], width: int) -> NDArray[np.uint8]:
    """Bytes (n, width) from each start (n,); zeros beyond the end of the buffer."""
    place = start[:, None] + np.arange(width)
    inside = place < len(buffer)
    return np.where(inside, buffer[np.where(inside, place, 0)], np.uint8(0)) if len(buffer) else np.zeros((0, width), np.uint8)


def _find_frames(
    buffer: NDArray[np.uint8],
) -> tuple[dict[int, tuple[NDArray[np.int64], NDArray[np.int64]]], dict[int, int], bool]:
    """By kind, start and length of the payloads of good messages, and the number of messages with a wrong checksum; whether
    the last message is cut."""
    frames = {kind: (np.empty(0, np.int64), np.empty(0, np.int64)) for kind in _NAMES}
    wrong = dict.fromkeys(_NAMES, 0)
    if len(buffer) < _FRAME:
        return frames, wrong, False
    body = buffer[: len(buffer) - _FRAME + 1]
    sync = np.flatnonzero((body == _SYNC[0]) & (buffer[1 : len(body) + 1] == _SYNC[1]) & (buffer[2 : len(body) + 2] == _RXM))
    kind = buffer[sync + 3]
    length = buffer[sync + 4].astype(np.int64) + 256 * buffer[sync + 5].astype(np.int64)
    fits = np.where(
        kind == _RAWX,
        (length >= _RAWX_HEAD_BYTES) & ((length - _RAWX_HEAD_BYTES) % RAWX_BLOCK.itemsize == 0),
        (kind == _SFRBX) & (length > _SFRBX_HEAD_BYTES) & (length % 4 == 0) & (length <= 4 * 20),
    )
    sync, kind, length = sync[fits].astype(np.int64), kind[fits], length[fits]
    whole = sync + _FRAME + length <= len(buffer)
    good = np.zeros(len(sync), dtype=bool)
    for size in np.unique(length[whole]):
        own = np.flatnonzero(whole & (length == size))
        good[own] = _checksum_right(buffer, sync[own], int(size))
    for name in _NAMES:
        own = good & (kind == name)
        frames[name] = (sync[own] + 6, length[own])
        wrong[name] = int((whole & ~good & (kind == name)).sum())
    return frames, wrong, bool((~whole).any())


def _checksum_right(buffer: NDArray[np.uint8], sync: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
    """The 8-bit Fletcher checksum over class, kind, length and payload."""
    content = _gather(buffer, sync + 2, size + 4).astype(np.int64)
    first = content.sum(axis=1) % 256
    second = (content @ np.arange(size + 4, 0, -1)) % 256
    stated = _gather(buffer, sync + 6 + size, 2)
    return np.asarray((stated[:, 0] == first) & (stated[:, 1] == second))
