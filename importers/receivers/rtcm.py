"""RTCM 3 streams: pseudoranges of MSM and broadcast ephemerides, decoded by RTKLIB (the package ``pyrtklib``).

Frames are found and checked here (RTCM 10403.3, chapter 4: preamble, length, CRC-24Q), so that only whole messages of the kinds
wanted reach the library. An epoch tells only the time of week: `input.gps_week`, or else the week of an ephemeris, dates it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather
from importers.decoding.channel_log import ChannelLog
from importers.receivers.frame_scan import CRC24Q, scan_rtcm
from importers.receivers.rtcm_records import Observations, ephemeris_columns, glonass_record, kepler_record
from importers.rows.log import Channel, Table
from importers.satellites.ephemeris import GLONASS, KEPLER
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, WEEK_S
from navreplay.timeline import LogError

if TYPE_CHECKING:
    import pyrtklib

__all__ = ["is_rtcm", "open_rtcm"]

_MSM = frozenset(system + kind for system in (1070, 1080, 1090, 1110, 1120) for kind in (4, 5, 6, 7))
_EPHEMERIDES = frozenset((1019, 1020, 1041, 1042, 1044, 1045, 1046))
_GPS_EPHEMERIS = 1019
_LEAST_FRAMES = 2
_FIRST_WEEK = 2048
"""Of the 1024 weeks of message 1019 that begin in April 2019."""
_NEW_EPOCH, _NEW_EPHEMERIS = 1, 2


@dataclass(frozen=True, eq=False, slots=True)
class _Frames:
    """Frames with right checksums: start (n,) and length (n,) of the whole frames, kind (n,) of their messages; wrong:
    checksums."""

    start: Offsets
    length: NDArray[np.int64]
    kind: NDArray[np.int64]
    wrong: int


def is_rtcm(head: bytes) -> bool:
    """Whether a beginning holds two or more whole messages of the kinds that are read."""
    kinds = _frames(np.frombuffer(head, dtype=np.uint8)).kind
    return int(np.isin(kinds, [*_MSM, *_EPHEMERIDES]).sum()) >= _LEAST_FRAMES


def open_rtcm(path: str, gps_week: int | None) -> ChannelLog:
    """A stream as a log with a channel of ranges and one of ephemerides. Raises LogError where the package is missing."""
    buffer = map_file(path, b"", "an RTCM stream")
    frames = _frames(buffer)
    decoded: list[tuple[Table, Table]] = []

    def read(part: int) -> Table:
        """Both tables come of one pass over the stream, made when the first is asked for."""
        if not decoded:
            decoded.append(_decode(path, buffer, frames, gps_week))
        return decoded[0][part]

    readers = []
    for part, (name, kinds) in enumerate((("MSM", _MSM), ("ephemerides", _EPHEMERIDES))):
        count = int(np.isin(frames.kind, list(kinds)).sum())
        if count:
            readers.append((Channel(name, f"rtcm/{name}", "rtcm", count), lambda part=part: read(part)))
    notes = [f"{frames.wrong} frames have a wrong checksum and were left out"] if frames.wrong else []
    return ChannelLog(path, "rtcm", readers, notes)


def _frames(buffer: Buffer) -> _Frames:
    inside = buffer[: max(len(buffer) - 5, 0)]
    second = buffer[1 : len(inside) + 1]
    candidates = np.flatnonzero((inside == 0xD3) & (second < 4)).astype(np.int64)
    start, length, wrong = scan_rtcm(buffer, candidates, CRC24Q)
    head = gather(buffer, start, 5).astype(np.int64)
    return _Frames(start, length, head[:, 3] << 4 | head[:, 4] >> 4, wrong)


def _week(path: str, buffer: Buffer, frames: _Frames, gps_week: int | None) -> int:
    """The week in which the stream begins. Raises LogError where nothing tells it."""
    if gps_week is not None:
        return gps_week
    first = np.flatnonzero((frames.kind == _GPS_EPHEMERIS) & (frames.length >= 9))
    if len(first) == 0:
        raise LogError(f"{path}: RTCM tells the time of week without the week, and holds no GPS ephemeris; set input.gps_week")
    # message number (12 bits), satellite (6), week modulo 1024 (10)
    bits = int.from_bytes(bytes(buffer[frames.start[first[0]] + 3 : frames.start[first[0]] + 7]), "big")
    return _FIRST_WEEK + (bits >> 4 & 1023)


def _decode(path: str, buffer: Buffer, frames: _Frames, gps_week: int | None) -> tuple[Table, Table]:
    try:
        import pyrtklib
    except ImportError as error:
        raise LogError(
            f"{path}: RTCM needs the package pyrtklib: pip install 'navreplay[formats]', or convert it to RINEX (convbin)"
        ) from error
    state = pyrtklib.rtcm_t()
    pyrtklib.init_rtcm(state)
    try:
        return _feed(pyrtklib, state, path, buffer, frames, gps_week)
    finally:
        pyrtklib.free_rtcm(state)


def _feed(
    library: "pyrtklib", state: Any, path: str, buffer: Buffer, frames: _Frames, gps_week: int | None
) -> tuple[Table, Table]:
    """Ranges and ephemerides of the frames in turn."""
    week = _week(path, buffer, frames, gps_week)
    state.time = _library_time(library, week, _first_tow_s(buffer, frames))
    observations = Observations(library)
    kepler, glonass = [], []
    for start, length, kind in zip(frames.start.tolist(), frames.length.tolist(), frames.kind.tolist(), strict=True):
        if kind not in _MSM and kind not in _EPHEMERIDES:
            continue
        for byte in bytes(buffer[start : start + length]):
            outcome = library.input_rtcm3(state, byte)
            if outcome == _NEW_EPOCH:
                observations.add(state)
            elif outcome == _NEW_EPHEMERIS and kind == 1020:
                glonass.append(glonass_record(library, state))
            elif outcome == _NEW_EPHEMERIS:
                kepler.append(kepler_record(library, state))
    columns = ephemeris_columns(np.array(kepler, KEPLER), np.array(glonass, GLONASS))
    ephemerides = Table(columns["t_gps_ns"], columns, len(columns["t_gps_ns"]))
    ranges = observations.columns()
    return Table(ranges["t_gps_ns"], ranges, len(ranges["t_gps_ns"])), ephemerides


def _first_tow_s(buffer: Buffer, frames: _Frames) -> float:
    """Time of week of the first MSM of GPS or Galileo: message number and station (24 bits), then milliseconds (30)."""
    first = np.flatnonzero(np.isin(frames.kind // 10, (107, 109)))
    if len(first) == 0:
        return WEEK_S / 2
    at = int(frames.start[first[0]]) + 3
    return (int.from_bytes(bytes(buffer[at + 3 : at + 7]), "big") >> 2) / 1000 % WEEK_S


def _library_time(library: "pyrtklib", week: int, tow_s: float) -> Any:
    time = library.gtime_t()
    time.time, time.sec = GPS_EPOCH_UNIX_S + week * WEEK_S + int(tow_s), tow_s % 1
    return time
