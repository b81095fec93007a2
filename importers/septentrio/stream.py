"""Septentrio Binary Format: ranges, fixes with their covariances, the receiver's IMU and its inertial solution.

Source: Septentrio AsteRx SBi3 and mosaic-X5 reference guides, chapter 4 (block header, PVTGeodetic, PosCovGeodetic,
VelCovGeodetic, MeasEpoch, ExtSensorMeas, INSNavGeod).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.containers.file_bytes import map_file
from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import records
from importers.decoding.channel_log import ChannelLog
from importers.receivers.frame_scan import CRC16_CCITT, scan_sbf
from importers.rows.log import Channel, Table
from importers.septentrio.ephemerides import EPHEMERIS_BLOCKS, ephemerides
from importers.septentrio.fixes import POSITION_COVARIANCE, SOLUTION, VELOCITY_COVARIANCE, solutions
from importers.septentrio.imu import sensor_samples
from importers.septentrio.ins import inertial_solution
from importers.septentrio.ranges import observations
from navreplay.geodesy.time_scales import WEEK_S
from navreplay.timeline import LogError, Times

__all__ = ["is_sbf", "open_sbf"]

_PVT, _POSITION_COVARIANCE, _VELOCITY_COVARIANCE, _MEASUREMENTS, _SENSOR, _INERTIAL = 4007, 5906, 5908, 4027, 4050, 4226
_CHANNELS = {_MEASUREMENTS: "MeasEpoch", _PVT: "PVTGeodetic", _SENSOR: "ExtSensorMeas", _INERTIAL: "INSNavGeod"}
_TIME = np.dtype([("tow", "<u4"), ("week", "<u2")])
_HEAD, _BODY = 8, 14
_NO_WEEK = 65_535
_WITHOUT_ACCURACY = 66
"""Length of PVTGeodetic up to SignalInfo: the first revision ends behind it."""


@dataclass(frozen=True, eq=False, slots=True)
class _Blocks:
    """Blocks of a stream: start (n,) and size (n,) of what follows their time, number (n,), time (n,) (0 where unknown); wrong:
    checksums."""

    start: Offsets
    size: NDArray[np.int64]
    number: NDArray[np.int64]
    t_ns: Times
    wrong: int


def is_sbf(head: bytes) -> bool:
    """Whether a beginning holds a whole block that is read."""
    return bool(np.isin(_blocks(np.frombuffer(head, dtype=np.uint8)).number, list(_CHANNELS)).any())


def open_sbf(path: str) -> ChannelLog:
    """A stream as a log with a channel per kind of block."""
    buffer = map_file(path, b"", "an SBF stream")
    blocks = _blocks(buffer)
    makers: dict[int, Callable[[Buffer, _Blocks], dict[str, np.ndarray]]] = {
        _PVT: _fixes,
        _MEASUREMENTS: lambda buffer, own: observations(buffer, own.start, own.size, own.t_ns),
        _SENSOR: lambda buffer, own: sensor_samples(buffer, own.start, own.size, own.t_ns),
        _INERTIAL: lambda buffer, own: inertial_solution(buffer, own.start, own.size, own.t_ns),
    }
    readers = []
    for number, name in _CHANNELS.items():
        count = int((blocks.number == number).sum())
        if count:
            reader = _reader(path, name, buffer, blocks, makers[number], () if number == _PVT else (number,))
            readers.append((Channel(name, f"sbf/{name}", "sbf", count), reader))
    of_ephemerides = np.isin(blocks.number, EPHEMERIS_BLOCKS)
    if of_ephemerides.any():
        channel = Channel("ephemerides", "sbf/ephemerides", "sbf", int(of_ephemerides.sum()))
        readers.append((channel, lambda: _ephemerides(buffer, blocks, of_ephemerides)))
    notes = [f"{blocks.wrong} blocks have a wrong checksum and were left out"] if blocks.wrong else []
    return ChannelLog(path, "sbf", readers, notes)


def _ephemerides(buffer: Buffer, blocks: _Blocks, own: NDArray[np.bool_]) -> Table:
    """A row per ephemeris; the blocks of the ionosphere, and those that are damaged, make none."""
    columns = ephemerides(buffer, blocks.start[own], blocks.size[own], blocks.number[own], blocks.t_ns[own])
    n = len(columns["t_gps_ns"])
    lost = int(own.sum()) - n
    return Table(columns["t_gps_ns"], columns, n + lost, {"no ephemeris": lost} if lost else {})


def _reader(
    path: str,
    name: str,
    buffer: Buffer,
    blocks: _Blocks,
    make: Callable[[Buffer, _Blocks], dict[str, np.ndarray]],
    numbers: tuple[int, ...],
) -> Callable[[], Table]:
    """Reads the blocks of some numbers (empty: make chooses them)."""

    def read() -> Table:
        """The table; rows without a time are rejected."""
        own = _chosen(blocks, numbers[0]) if numbers else blocks
        try:
            columns = make(buffer, own)
        except LogError as error:
            raise LogError(f"{path}: {name}: {error}") from error
        known = columns["t_gps_ns"] > 0
        rejected = {"no time yet": int((~known).sum())} if not known.all() else {}
        kept = {key: values[known] for key, values in columns.items()}
        return Table(kept["t_gps_ns"], kept, len(known), rejected)

    return read


def _blocks(buffer: Buffer) -> _Blocks:
    inside = buffer[: max(len(buffer) - _BODY, 0)]
    candidates = np.flatnonzero((inside == ord("$")) & (buffer[1 : len(inside) + 1] == ord("@"))).astype(np.int64)
    at, size, number, wrong = scan_sbf(buffer, candidates, CRC16_CCITT)
    time = records(buffer, at + _HEAD, _TIME)
    known = (time["tow"] < WEEK_S * 1000) & (time["week"] != _NO_WEEK) & (size >= _BODY)
    t_ns = time["week"].astype(np.int64) * WEEK_S * 10**9 + time["tow"].astype(np.int64) * 10**6
    return _Blocks(at + _BODY, size - _BODY, number, np.where(known, t_ns, 0), wrong)


def _chosen(blocks: _Blocks, number: int, least: int = 0) -> _Blocks:
    own = (blocks.number == number) & (blocks.size >= least)
    return _Blocks(blocks.start[own], blocks.size[own], blocks.number[own], blocks.t_ns[own], 0)


def _fixes(buffer: Buffer, blocks: _Blocks) -> dict[str, np.ndarray]:
    """PVTGeodetic with the covariances of the same epochs."""
    parts = []
    for number, layout in (
        (_PVT, SOLUTION),
        (_POSITION_COVARIANCE, POSITION_COVARIANCE),
        (_VELOCITY_COVARIANCE, VELOCITY_COVARIANCE),
    ):
        own = _chosen(blocks, number, _WITHOUT_ACCURACY if number == _PVT else layout.itemsize)
        rows = records(buffer, own.start, layout)
        if number == _PVT:
            rows["accuracy"][own.size < layout.itemsize] = _NO_WEEK
        parts.append((rows, own.t_ns))
    return solutions(*parts)
