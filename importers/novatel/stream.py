"""NovAtel OEM4 to OEM7 logs, binary or ASCII: ranges, fixes, velocities, raw IMU and the inertial solution of SPAN.

Source: NovAtel OEM7 Commands and Logs Reference Manual (OM-20000169): headers, RANGE, BESTPOS, BESTVEL, INSPVA, INSPVAX,
RAWIMU, RAWIMUSX.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather, records
from importers.decoding.channel_log import ChannelLog
from importers.novatel.ascii_text import ascii_messages
from importers.novatel.fixes import POSITION, VELOCITY, positions, velocities
from importers.novatel.imu import RAW, RAW_EXTENDED, raw_samples
from importers.novatel.ins import INSPVA, INSPVAX, inertial_solution
from importers.novatel.ranges import OBSERVATION, observations
from importers.receivers.frame_scan import CRC32, scan_novatel
from importers.rows.log import Channel, Table
from navreplay.geodesy.time_scales import WEEK_S
from navreplay.timeline import LogError, Times

__all__ = ["is_novatel", "open_novatel"]

_WEEK_NS = WEEK_S * 10**9


@dataclass(frozen=True, slots=True)
class _Kind:
    """A message: its layout, what makes columns of its rows and their times, and whether rows repeat behind a count."""

    name: str
    layout: np.dtype[np.void]
    columns: Callable[[NDArray[np.void], Times], dict[str, np.ndarray]]
    repeated: bool = False


_KINDS = {
    43: _Kind("RANGE", OBSERVATION, observations, repeated=True),
    1429: _Kind("BESTGNSSPOS", POSITION, positions),
    42: _Kind("BESTPOS", POSITION, positions),
    47: _Kind("PSRPOS", POSITION, positions),
    1430: _Kind("BESTGNSSVEL", VELOCITY, velocities),
    99: _Kind("BESTVEL", VELOCITY, velocities),
    100: _Kind("PSRVEL", VELOCITY, velocities),
    1461: _Kind("RAWIMUX", RAW_EXTENDED, raw_samples),
    1462: _Kind("RAWIMUSX", RAW_EXTENDED, raw_samples),
    268: _Kind("RAWIMU", RAW, raw_samples),
    325: _Kind("RAWIMUS", RAW, raw_samples),
    1465: _Kind("INSPVAX", INSPVAX, inertial_solution),
    507: _Kind("INSPVA", INSPVA, inertial_solution),
    508: _Kind("INSPVAS", INSPVA, inertial_solution),
}


def is_novatel(head: bytes) -> bool:
    """Whether a beginning holds a whole message of a NovAtel receiver that is read."""
    buffer = np.frombuffer(head, dtype=np.uint8)
    return bool(np.isin(_binary(buffer).number, list(_KINDS)).any() or ascii_messages(head, _LAYOUTS).rows)


def open_novatel(path: str) -> ChannelLog:
    """A stream as a log with a channel per message. Raises LogError."""
    buffer = map_file(path, b"", "a NovAtel stream")
    binary, text = _binary(buffer), ascii_messages(buffer.data, _LAYOUTS)
    readers: list[tuple[Channel, Callable[[], Table]]] = []
    for number, kind in _KINDS.items():
        own = np.flatnonzero(binary.number == number)
        rows, times = text.rows.get(number, (np.empty(0, kind.layout), np.empty(0, np.int64)))
        if len(own) + len(rows) == 0:
            continue
        channel = Channel(kind.name, f"novatel/{kind.name}", "novatel", len(own) + len(np.unique(times)))
        readers.append((channel, partial(_read, path, buffer, binary, own, kind, rows, times)))
    wrong = binary.wrong + text.wrong
    return ChannelLog(path, "novatel", readers, [f"{wrong} messages have a wrong checksum and were left out"] if wrong else [])


@dataclass(frozen=True, eq=False, slots=True)
class _Binary:
    """Binary messages: start (n,) and size (n,) of their contents, number (n,), time (n,); wrong: checksums."""

    start: Offsets
    size: NDArray[np.int64]
    number: NDArray[np.int64]
    t_ns: Times
    wrong: int


def _binary(buffer: Buffer) -> _Binary:
    inside = buffer[: max(len(buffer) - 2, 0)]
    third = buffer[2:] if len(buffer) > 2 else buffer[:0]
    candidates = np.flatnonzero((inside == 0xAA) & (buffer[1 : len(inside) + 1] == 0x44) & ((third == 0x12) | (third == 0x13)))
    at, head, size, number, wrong = scan_novatel(buffer, candidates.astype(np.int64), CRC32)
    short = head == 12
    time = gather(buffer, at + np.where(short, 6, 14), 6).astype(np.int64)
    week = time[:, 0] + 256 * time[:, 1]
    milliseconds = (time[:, 2:] << np.array([0, 8, 16, 24])).sum(axis=1)
    return _Binary(at + head, size, number, week * _WEEK_NS + milliseconds * 10**6, wrong)


def _read(
    path: str,
    buffer: Buffer,
    binary: _Binary,
    own: NDArray[np.intp],
    kind: _Kind,
    text_rows: NDArray[np.void],
    text_t_ns: Times,
) -> Table:
    """The table of a kind, of binary and ASCII messages together. Raises LogError."""
    start, size, t_ns = binary.start[own], binary.size[own], binary.t_ns[own]
    rejected = 0
    if kind.repeated:
        told = np.ascontiguousarray(gather(buffer, start, 4)).view("<u4")[:, 0].astype(np.int64)
        count = np.minimum(told, np.maximum(size - 4, 0) // kind.layout.itemsize)
        message = np.repeat(np.arange(len(start)), count)
        within = np.arange(len(message)) - np.repeat(np.cumsum(count) - count, count)
        start, t_ns = start[message] + 4 + within * kind.layout.itemsize, t_ns[message]
    else:
        whole = size >= kind.layout.itemsize
        rejected = int((~whole).sum())
        start, t_ns = start[whole], t_ns[whole]
    rows = np.concatenate([records(buffer, start, kind.layout), text_rows])
    try:
        columns = kind.columns(rows, np.concatenate([t_ns, text_t_ns]))
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    return Table(columns["t_gps_ns"], columns, len(rows) + rejected, {"shorter than its kind": rejected} if rejected else {})


_LAYOUTS = {kind.name: (number, kind.layout, kind.repeated) for number, kind in _KINDS.items()}
