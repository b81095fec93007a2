"""What the messages of ArduPilot mean: IMU, fixes of the receiver, and its own filter's solution as a reference.

Source: ArduPilot log messages (ardupilot.org, "Onboard Message Log Messages"): IMU, GPS, GPA, XKF1, NKF1, ORGN, POS.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from importers.autopilots.boot_clock import BootClock, tie_clock
from importers.autopilots.dataflash import DataFlash, open_dataflash
from importers.decoding.channel_log import ChannelLog
from importers.rows.log import Channel, Table
from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import WEEK_S, gps_from_week_tow
from navreplay.timeline import FixStatus, Floats, LogError, Times

__all__ = ["open_ardupilot"]

_STATUS = {
    2: int(FixStatus.SINGLE),
    3: int(FixStatus.SINGLE),
    4: int(FixStatus.DIFFERENTIAL),
    5: int(FixStatus.FLOAT),
    6: int(FixStatus.FIXED),
    7: int(FixStatus.FIXED),
}
_FIX_NEEDS = ("TimeUS", "Status", "GMS", "GWk", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ")
_IMU_NEEDS = ("TimeUS", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")
_FILTER_NEEDS = ("TimeUS", "Roll", "Pitch", "Yaw", "VN", "VE", "VD")
_POSITION_NEEDS = ("TimeUS", "Lat", "Lng", "Alt")
_FIRST_WEEK = 600
_TOGETHER_NS = 60_000_000
_Columns = dict[str, NDArray[np.generic]]


def open_ardupilot(path: str) -> ChannelLog:
    """A flight log of ArduPilot. Raises LogError where it holds no message that is read."""
    log = open_dataflash(path)
    flight = _Flight(path, log)
    readers: list[tuple[Channel, Callable[[], Table]]] = []
    for name, needs in (
        ("IMU", _IMU_NEEDS),
        ("IMU2", _IMU_NEEDS),
        ("IMU3", _IMU_NEEDS),
        ("GPS", _FIX_NEEDS),
        ("GPS2", _FIX_NEEDS),
    ):
        for number, rows in _instances(flight.columns(name, needs)).items():
            make = _fixes if needs is _FIX_NEEDS else _samples
            spare = "/spare" if number or name[-1].isdigit() else ""
            channel = Channel(
                f"{name}[{number}]" if number else name, f"dataflash/{name[:3]}{spare}", "dataflash", _length(rows)
            )
            readers.append((channel, lambda make=make, rows=rows: _table(make(flight, rows))))
    position = flight.columns("POS", _POSITION_NEEDS)
    if position:
        channel = Channel("POS", "dataflash/POS", "dataflash", _length(position))
        readers.append((channel, lambda: _table(_own_solution(flight, position))))
    if not readers:
        there = ", ".join(sorted(name for name, start in log.start.items() if len(start))[:12]) or "none at all"
        raise LogError(f"{path}: holds none of the messages that are read (IMU, GPS, POS); it has {there}. Is LOG_BITMASK set?")
    return ChannelLog(path, "dataflash", readers, [f"{log.lost} bytes are no messages and were left out"] if log.lost else [])


class _Flight:
    """A log with its clock, which is set when it is first needed."""

    def __init__(self, path: str, log: DataFlash) -> None:
        self.path, self.log = path, log
        self._clock: BootClock | None = None

    def columns(self, name: str, needs: tuple[str, ...]) -> _Columns:
        """The columns of a message; empty where there are none or the needed ones are missing."""
        columns = self.log.columns(name)
        return columns if set(needs) <= set(columns) else {}

    def clock(self) -> BootClock:
        """The clock by the fixes. Raises LogError."""
        if self._clock is None:
            rows = self.columns("GPS", _FIX_NEEDS)
            dated = _dated(rows) if rows else np.zeros(0, dtype=bool)
            boot_ns = _stamps(rows)[dated] if rows else np.zeros(0, dtype=np.int64)
            self._clock = tie_clock(self.path, boot_ns, _gps_times(rows)[dated] if rows else boot_ns)
        return self._clock


def _instances(rows: _Columns) -> dict[int, _Columns]:
    """The columns of each instance of a message."""
    if not rows:
        return {}
    if "I" not in rows:
        return {0: rows}
    numbers = rows["I"].astype(np.int64)
    return {int(number): {name: values[numbers == number] for name, values in rows.items()} for number in np.unique(numbers)}


def _length(rows: _Columns) -> int:
    return len(next(iter(rows.values())))


def _table(columns: _Columns) -> Table:
    return Table(columns["t_gps_ns"].astype(np.int64), columns, _length(columns))


def _stamps(rows: _Columns) -> Times:
    """Times since power-on (n,) [ns]."""
    return np.minimum(rows["TimeUS"], 1 << 53).astype(np.int64) * 1000


def _dated(rows: _Columns) -> NDArray[np.bool_]:
    return np.asarray((rows["GWk"] >= _FIRST_WEEK) & (rows["GMS"] < WEEK_S * 1000))


def _gps_times(rows: _Columns) -> Times:
    milliseconds = np.minimum(rows["GMS"], WEEK_S * 1000).astype(np.int64)
    return gps_from_week_tow(rows["GWk"].astype(np.int64), np.zeros(len(milliseconds))) + milliseconds * 1_000_000


def _vectors(rows: _Columns, *names: str) -> Floats:
    return np.column_stack([rows[name].astype(np.float64) for name in names])


def _samples(flight: _Flight, rows: _Columns) -> _Columns:
    gyro, accel = _vectors(rows, "GyrX", "GyrY", "GyrZ"), _vectors(rows, "AccX", "AccY", "AccZ")
    return {"t_gps_ns": flight.clock().gps_ns(_stamps(rows)), "gyro": gyro, "accel": accel}


def _fixes(flight: _Flight, rows: _Columns) -> _Columns:
    dated = _dated(rows)
    t_ns = np.where(dated, _gps_times(rows), flight.clock().gps_ns(_stamps(rows)))
    speed, course = rows["Spd"].astype(np.float64), np.radians(rows["GCrs"].astype(np.float64))
    vel = np.column_stack([speed * np.cos(course), speed * np.sin(course), rows["VZ"].astype(np.float64)])
    columns: _Columns = {"t_gps_ns": t_ns, "lla": _geodetic(rows), "vel_n": vel}
    columns["status"] = np.array([_STATUS.get(code, NO_FIX) for code in range(256)], dtype=np.int8)[
        rows["Status"].astype(np.uint8)
    ]
    return columns | _accuracies(flight, rows)


def _accuracies(flight: _Flight, rows: _Columns) -> _Columns:
    """Covariances by the message GPA of the same time and instance; NaN without."""
    std = np.full((len(rows["TimeUS"]), 4), np.nan)
    beside = flight.columns("GPA", ("TimeUS", "HAcc", "VAcc", "SAcc"))
    for number, own in _instances(beside).items():
        if "I" in rows and len(rows["I"]) and int(rows["I"][0]) != number:
            continue
        _, here, there = np.intersect1d(rows["TimeUS"], own["TimeUS"], return_indices=True)
        std[here] = _vectors(own, "HAcc", "HAcc", "VAcc", "SAcc")[there]
    return {"cov_pos": diagonal_covariance(std[:, :3]), "cov_vel": diagonal_covariance(std[:, [3, 3, 3]])}


def _geodetic(rows: _Columns) -> Floats:
    lat, lon, height = (rows[name].astype(np.float64) for name in ("Lat", "Lng", "Alt"))
    return np.column_stack([np.radians(lat), np.radians(lon), height])


def _own_solution(flight: _Flight, rows: _Columns) -> _Columns:
    """POS, with velocity and attitude of the first core of the filter at the nearest time."""
    boot_ns = _stamps(rows)
    vel, q = np.full((len(boot_ns), 3), np.nan), np.full((len(boot_ns), 4), np.nan)
    own = flight.columns("XKF1", _FILTER_NEEDS) or flight.columns("NKF1", _FILTER_NEEDS)
    if own:
        own = _first_core(own)
        other_ns = _stamps(own)
        after = np.clip(np.searchsorted(other_ns, boot_ns), 0, len(other_ns) - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(np.abs(other_ns[after] - boot_ns) <= np.abs(other_ns[before] - boot_ns), after, before)
        near = np.abs(other_ns[nearest] - boot_ns) <= _TOGETHER_NS
        vel[near] = _vectors(own, "VN", "VE", "VD")[nearest[near]]
        q[near] = quat_from_euler(*np.radians(_vectors(own, "Roll", "Pitch", "Yaw"))[nearest[near]].T)
    return {"t_gps_ns": flight.clock().gps_ns(boot_ns), "lla": _geodetic(rows), "vel_n": vel, "q_nb": q}


def _first_core(rows: _Columns) -> _Columns:
    if "C" not in rows:
        return rows
    first = rows["C"] == rows["C"].min()
    return {name: values[first] for name, values in rows.items()}
