"""u-blox streams: raw measurements and navigation data, the receiver's own fixes and attitudes, and its inertial sensor.

Source: u-blox F9 HPG 1.32 interface description (UBX-22008968), 3.1, 3.15 and 3.17.
"""

from collections.abc import Callable
from datetime import date
from typing import cast

import numpy as np

from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer
from importers.decoding.byte_rows import gather, records
from importers.decoding.channel_reading import require_channels
from importers.nmea.fixes import read_sentences
from importers.nmea.sentences import find_sentences, is_nmea
from importers.rows.log import Channel, Table
from importers.ublox import navigation
from importers.ublox.frames import Frames, find_frames
from importers.ublox.measurements import RAWX_BLOCK, RAWX_HEAD, measurement_columns
from importers.ublox.sensors import sensor_samples
from navreplay.geodesy.time_scales import LEAP_SECONDS, LeapSeconds, gps_from_week_tow
from navreplay.timeline import LogError, Times

__all__ = ["UbxLog", "is_ubx"]

_RAWX, _SFRBX, _PVT, _HPPOSLLH, _COV = 0x0215, 0x0213, 0x0107, 0x0114, 0x0136
_POSLLH, _VELNED, _SOL = 0x0102, 0x0112, 0x0106
_ATT, _HNR_PVT, _HNR_ATT, _ESF_MEAS, _ESF_RAW = 0x0105, 0x2800, 0x2801, 0x1002, 0x1003
_SFRBX_HEAD_BYTES, _WORDS = 8, 10
_NMEA = "NMEA"
_LENGTHS = {
    _RAWX: (RAWX_HEAD.itemsize, RAWX_BLOCK.itemsize),
    _SFRBX: (_SFRBX_HEAD_BYTES + 4, 4),
    _PVT: (84, 8),
    _HPPOSLLH: (36, 0),
    _COV: (64, 0),
    _POSLLH: (28, 0),
    _VELNED: (36, 0),
    _SOL: (52, 0),
    _ATT: (32, 0),
    _HNR_ATT: (32, 0),
    _HNR_PVT: (72, 0),
    _ESF_MEAS: (12, 4),
    _ESF_RAW: (12, 8),
}
_NAMES = {
    _RAWX: "RXM-RAWX",
    _SFRBX: "RXM-SFRBX",
    _PVT: "NAV-PVT",
    _HPPOSLLH: "NAV-HPPOSLLH",
    _POSLLH: "NAV-POSLLH",
    _ATT: "NAV-ATT",
    _HNR_PVT: "HNR-PVT",
    _HNR_ATT: "HNR-ATT",
    _ESF_RAW: "ESF-RAW",
    _ESF_MEAS: "ESF-MEAS",
}
"""Channels; NAV-COV goes into NAV-PVT, NAV-VELNED and NAV-SOL into NAV-POSLLH."""


def is_ubx(head: bytes) -> bool:
    """Whether a beginning holds a whole message of one of the kinds that are read."""
    frames, _ = find_frames(np.frombuffer(head, dtype=np.uint8), _LENGTHS)
    return any(len(of_kind.start) for of_kind in frames.values())


class UbxLog:
    """A UBX stream as a `Log`, with a channel per kind of message that it holds."""

    format = "ubx"

    def __init__(self, path: str, leap: LeapSeconds = LEAP_SECONDS, utc_date: date | None = None) -> None:
        self.path = str(path)
        self._leap = leap
        self._buffer: Buffer = map_file(self.path, b"", "a UBX stream")
        self._frames, cut = find_frames(self._buffer, _LENGTHS)
        self.notes: tuple[str, ...] = ("ends within a message, which was left out",) if cut else ()
        self._sentences = self._read_sentences(utc_date)

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        counts = {kind: len(self._frames[kind].start) + self._frames[kind].wrong for kind in _NAMES}
        own = tuple(Channel(name, f"ubx/{name}", "ubx", counts[kind]) for kind, name in _NAMES.items() if counts[kind])
        return own if self._sentences is None else (*own, Channel(_NMEA, "nmea", "text", self._sentences.read))

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`. RXM-RAWX has a row per measurement, ESF messages one per sample, the others one per message."""
        require_channels(self.path, names, self.channels())
        readers: dict[str, Callable[[], Table]] = {
            "RXM-RAWX": self._measurements,
            "RXM-SFRBX": self._words,
            "NAV-PVT": self._solutions,
            "NAV-HPPOSLLH": self._precise_positions,
            "NAV-POSLLH": self._separate_solutions,
            "NAV-ATT": lambda: self._attitudes(_ATT),
            "HNR-ATT": lambda: self._attitudes(_HNR_ATT),
            "HNR-PVT": self._high_rate,
            "ESF-RAW": lambda: self._sensor(_ESF_RAW),
            "ESF-MEAS": lambda: self._sensor(_ESF_MEAS),
            _NMEA: lambda: cast(Table, self._sentences),
        }
        with np.errstate(invalid="ignore", over="ignore"):  # of damaged numbers, which are screened later
            return {name: readers[name]() for name in names}

    def _read_sentences(self, utc_date: date | None) -> Table | None:
        """Positions of the NMEA sentences between the messages, where there are any; a note where they cannot be used."""
        sentences = find_sentences(self._buffer.data)
        if not is_nmea(sentences.decode()):
            return None
        try:
            return read_sentences(f"{self.path}: NMEA", sentences, utc_date, self._leap)
        except LogError as error:
            self.notes += (f"its NMEA sentences are not used: {str(error).removeprefix(f'{self.path}: NMEA: ')}",)
            return None

    def _measurements(self) -> Table:
        frames = self._frames[_RAWX]
        blocks = (frames.length - RAWX_HEAD.itemsize) // RAWX_BLOCK.itemsize
        message = np.repeat(np.arange(len(frames.start)), blocks)
        within = np.arange(len(message)) - np.repeat(np.cumsum(blocks) - blocks, blocks)
        places = frames.start[message] + RAWX_HEAD.itemsize + within * RAWX_BLOCK.itemsize
        times = _rawx_times(self._buffer, frames)
        columns = measurement_columns(times[message], records(self._buffer, places, RAWX_BLOCK))
        return _table(columns, frames, {"epoch without satellites": int((blocks == 0).sum())})

    def _words(self) -> Table:
        frames = self._frames[_SFRBX]
        head = gather(self._buffer, frames.start, _SFRBX_HEAD_BYTES)
        payload = gather(self._buffer, frames.start + _SFRBX_HEAD_BYTES, 4 * _WORDS)
        words = payload.view("<u4").astype(np.int64)
        words[np.arange(_WORDS) >= ((frames.length - _SFRBX_HEAD_BYTES) // 4)[:, None]] = 0
        columns: dict[str, np.ndarray] = {"t_gps_ns": self._word_times(frames)}
        columns |= {"gnssId": head[:, 0], "svId": head[:, 1], "freqId": head[:, 3], "dwrd": words}
        return _table(columns, frames)

    def _word_times(self, frames: Frames) -> Times:
        """Of the measurements before each message; 0 where there are none."""
        epochs = self._frames[_RAWX]
        if len(epochs.start) == 0:
            return np.zeros(len(frames.start), dtype=np.int64)
        times = _rawx_times(self._buffer, epochs)
        return times[np.maximum(np.searchsorted(epochs.start, frames.start) - 1, 0)]

    def _solutions(self) -> Table:
        precise, covariances = self._records(_HPPOSLLH), self._records(_COV)
        columns = navigation.solutions(self._records(_PVT), precise, covariances, self._leap)
        return _dated(columns, self._frames[_PVT])

    def _precise_positions(self) -> Table:
        return _dated(navigation.precise_positions(self._records(_HPPOSLLH), self._epochs()), self._frames[_HPPOSLLH])

    def _separate_solutions(self) -> Table:
        parts = (self._records(kind) for kind in (_POSLLH, _VELNED, _SOL))
        return _dated(navigation.separate_solutions(*parts, self._epochs()), self._frames[_POSLLH])

    def _high_rate(self) -> Table:
        return _dated(navigation.high_rate(self._records(_HNR_PVT), self._leap), self._frames[_HNR_PVT])

    def _attitudes(self, kind: int) -> Table:
        return _dated(navigation.attitudes(self._records(kind), self._epochs()), self._frames[kind])

    def _sensor(self, kind: int) -> Table:
        frames = self._frames[kind]
        places, times = self._epoch_places()
        columns = sensor_samples(self._buffer, frames.start, frames.length, kind == _ESF_RAW, places, times)
        if len(columns["t_gps_ns"]) and not columns["t_gps_ns"].any():
            raise LogError(
                f"{self.path}: {_NAMES[kind]} has ticks but no time: the stream needs NAV-PVT or RXM-RAWX beside it, by which "
                "they are tied to GPS time"
            )
        return _table(columns, frames)

    def _records(self, kind: int) -> np.ndarray:
        return records(self._buffer, self._frames[kind].start, _LAYOUTS[kind])

    def _epochs(self) -> navigation.Epochs:
        return navigation.Epochs(self._epoch_places()[1])

    def _epoch_places(self) -> tuple[np.ndarray, Times]:
        """Where the epochs of NAV-PVT, else NAV-SOL, else RXM-RAWX stand in the stream, and their GPS times."""
        nothing = np.empty(0, navigation.HIGH_PRECISION), np.empty(0, navigation.COVARIANCE)
        times = navigation.solutions(self._records(_PVT), *nothing, self._leap)["t_gps_ns"]
        places = self._frames[_PVT].start
        if not times.any():
            places, times = self._frames[_SOL].start, navigation.state_times(self._records(_SOL))
        if not times.any():
            places, times = self._frames[_RAWX].start, _rawx_times(self._buffer, self._frames[_RAWX])
        return places[times > 0], times[times > 0]


_LAYOUTS = {
    _PVT: navigation.SOLUTION,
    _HPPOSLLH: navigation.HIGH_PRECISION,
    _COV: navigation.COVARIANCE,
    _POSLLH: navigation.POSITION,
    _VELNED: navigation.VELOCITY,
    _SOL: navigation.STATUS,
    _ATT: navigation.ATTITUDE,
    _HNR_ATT: navigation.ATTITUDE,
    _HNR_PVT: navigation.HIGH_RATE,
}


def _table(columns: dict[str, np.ndarray], frames: Frames, rejected: dict[str, int] | None = None) -> Table:
    """A table of columns that hold their own time, with the wrong checksums among what is rejected."""
    counts = {"checksum wrong": frames.wrong, **(rejected or {})}
    counts = {reason: count for reason, count in counts.items() if count}
    return Table(columns["t_gps_ns"], columns, len(columns["t_gps_ns"]) + sum(counts.values()), counts)


def _dated(columns: dict[str, np.ndarray], frames: Frames) -> Table:
    """The same without the rows that have no date yet."""
    known = columns["t_gps_ns"] > 0
    return _table({name: values[known] for name, values in columns.items()}, frames, {"no date yet": int((~known).sum())})


def _rawx_times(buffer: Buffer, frames: Frames) -> Times:
    """Receive times; 0 where the seconds are no seconds of a week."""
    heads = records(buffer, frames.start, RAWX_HEAD)
    good = (heads["rcvTow"] >= 0) & (heads["rcvTow"] < 604_801)
    return np.where(good, gps_from_week_tow(heads["week"], np.where(good, heads["rcvTow"], 0.0)), 0)
