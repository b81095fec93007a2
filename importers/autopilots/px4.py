"""What the topics of PX4 mean: IMU, fixes of the receiver, and its own filter's solution as a reference.

Source: message definitions of PX4 1.16 (SensorCombined, VehicleImu, SensorGps, VehicleGlobalPosition, VehicleLocalPosition,
VehicleAttitude) and of 1.13, whose fixes count in other units.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from importers.autopilots.boot_clock import BootClock, tie_clock
from importers.autopilots.ulog import Topic, ULog, open_ulog
from importers.decoding.channel_log import ChannelLog
from importers.rows.log import Channel, Table
from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, Floats, LogError, Times

__all__ = ["open_px4"]

_STATUS = {
    2: int(FixStatus.SINGLE),
    3: int(FixStatus.SINGLE),
    4: int(FixStatus.DIFFERENTIAL),
    5: int(FixStatus.FLOAT),
    6: int(FixStatus.FIXED),
    8: int(FixStatus.DEAD_RECKONING),
}
_NEVER = 2**31 - 1
_TOGETHER_NS = 20_000_000
_FIRST_DATE_US = 631_152_000 * 10**6
_Columns = dict[str, np.ndarray]


def open_px4(path: str, leap: LeapSeconds) -> ChannelLog:
    """A flight log of PX4. Raises LogError where it holds no topic that is read."""
    log = open_ulog(path)
    flight = _Flight(path, log, leap)
    readers = [
        (Channel(_channel(topic), _type(topic), "ulog", len(topic.start) + topic.short), _reader(flight, topic))
        for topic in sorted(log.topics.values(), key=lambda topic: (topic.name, topic.instance))
        if topic.name in _TOPICS and len(topic.start) + topic.short
    ]
    if not readers:
        there = ", ".join(sorted({name for name, _ in log.topics})[:12]) or "none at all"
        raise LogError(
            f"{path}: holds none of the topics that are read ({', '.join(_TOPICS)}); it has {there}. Was logging of sensors on "
            "(SDLOG_PROFILE), or is the file cut behind its head?"
        )
    return ChannelLog(path, "ulog", readers, [f"{log.lost} bytes are no messages and were left out"] if log.lost else [])


def _channel(topic: Topic) -> str:
    return f"{topic.name}_{topic.instance}" if topic.instance else topic.name


def _type(topic: Topic) -> str:
    """Further instances of a topic serve where they are named."""
    return f"ulog/{topic.name}{'/spare' if topic.instance else ''}"


class _Flight:
    """A log with its clock, which is set when it is first needed."""

    def __init__(self, path: str, log: ULog, leap: LeapSeconds) -> None:
        self.path, self.log, self.leap = path, log, leap
        self._clock: BootClock | None = None

    def topic(self, *names: str) -> NDArray[np.void] | None:
        """The records of the first of some topics that has any."""
        topics = [self.log.topics[name, 0] for name in names if (name, 0) in self.log.topics]
        usable = [topic for topic in topics if len(topic.start) and not _missing(topic)]
        return self.log.records(usable[0]) if usable else None

    def clock(self) -> BootClock:
        """The clock by the fixes. Raises LogError."""
        if self._clock is None:
            fixes = self.topic("vehicle_gps_position", "sensor_gps")
            times = np.empty((2, 0), dtype=np.int64)
            if fixes is not None:
                dated = fixes[fixes["time_utc_usec"] > _FIRST_DATE_US]
                utc_ns = dated["time_utc_usec"].astype(np.int64) * 1000
                times = np.stack([_stamps(dated) + _relative(dated), gps_from_utc(utc_ns, self.leap)])
            self._clock = tie_clock(self.path, times[0], times[1])
        return self._clock


def _stamps(rows: NDArray[np.void]) -> Times:
    """Times since power-on (n,) [ns]."""
    return np.minimum(rows["timestamp"], 1 << 53).astype(np.int64) * 1000


def _relative(rows: NDArray[np.void]) -> Times:
    if "timestamp_time_relative" not in (rows.dtype.names or ()):
        return np.zeros(len(rows), dtype=np.int64)
    return rows["timestamp_time_relative"].astype(np.int64) * 1000


def _missing(topic: Topic) -> list[str]:
    """Fields that the definition of a topic lacks, of the version of PX4 that it is nearest to."""
    versions = _TOPICS[topic.name][1:] if topic.name in _TOPICS else (_LOCAL,)
    return min((sorted(set(fields) - set(topic.layout.names or ())) for fields in versions), key=len)


def _reader(flight: _Flight, topic: Topic) -> Callable[[], Table]:
    def read() -> Table:
        """The table of the topic."""
        if missing := _missing(topic):
            names = ", ".join(missing)
            raise LogError(f"{flight.path}: {_channel(topic)} is defined without {names}; is it of another version of PX4?")
        columns = _TOPICS[topic.name][0](flight, flight.log.records(topic))
        rejected = {"shorter than its definition": topic.short} if topic.short else {}
        return Table(columns["t_gps_ns"], columns, len(topic.start) + topic.short, rejected)

    return read


def _sensor_combined(flight: _Flight, rows: NDArray[np.void]) -> _Columns:
    gyro, accel = rows["gyro_rad"].astype(np.float64), rows["accelerometer_m_s2"].astype(np.float64)
    accel[rows["accelerometer_timestamp_relative"] == _NEVER] = np.nan
    return {"t_gps_ns": flight.clock().gps_ns(_stamps(rows)), "gyro": gyro, "accel": accel}


def _vehicle_imu(flight: _Flight, rows: NDArray[np.void]) -> _Columns:
    columns: _Columns = {"t_gps_ns": flight.clock().gps_ns(rows["timestamp_sample"].astype(np.int64) * 1000)}
    for name, change in (("gyro", "delta_angle"), ("accel", "delta_velocity")):
        interval_us = rows[f"{change}_dt"].astype(np.float64)
        seconds = np.where(interval_us > 0, interval_us, np.nan) * 1e-6
        columns[name] = rows[change].astype(np.float64) / seconds[:, None]
    return columns


def _fixes(flight: _Flight, rows: NDArray[np.void]) -> _Columns:
    dated = rows["time_utc_usec"] > _FIRST_DATE_US
    utc_ns = np.where(dated, rows["time_utc_usec"], 0).astype(np.int64) * 1000
    t_ns = np.where(dated, gps_from_utc(utc_ns, flight.leap), flight.clock().gps_ns(_stamps(rows) + _relative(rows)))
    vel = np.column_stack([rows[f"vel_{axis}_m_s"] for axis in "ned"]).astype(np.float64)
    vel[~rows["vel_ned_valid"].astype(bool)] = np.nan
    horizontal, vertical, speed = (rows[name].astype(np.float64) for name in ("eph", "epv", "s_variance_m_s"))
    return {
        "t_gps_ns": t_ns,
        "lla": _geodetic(rows),
        "vel_n": vel,
        "cov_pos": diagonal_covariance(np.column_stack([horizontal, horizontal, vertical])),
        "cov_vel": diagonal_covariance(np.column_stack([speed] * 3)),
        "status": np.array([_STATUS.get(int(code), NO_FIX) for code in range(256)], dtype=np.int8)[rows["fix_type"]],
    }


def _geodetic(rows: NDArray[np.void]) -> Floats:
    """Positions (n, 3) [rad, rad, m]: in degrees and metres since PX4 1.14, before in 1e-7 degrees and millimetres. A height
    above the ellipsoid of exactly 0 was never filled."""
    if "latitude_deg" in (rows.dtype.names or ()):
        names, scale, metre = ("latitude_deg", "longitude_deg", "altitude_ellipsoid_m", "altitude_msl_m"), 1.0, 1.0
    else:
        names, scale, metre = ("lat", "lon", "alt_ellipsoid", "alt"), 1e-7, 1e-3
    lat, lon, ellipsoidal, msl = (rows[name].astype(np.float64) for name in names)
    height = np.where(ellipsoidal != 0, ellipsoidal, msl) * metre
    return np.column_stack([np.radians(lat * scale), np.radians(lon * scale), height])


def _separation(flight: _Flight) -> float:
    """Height of the geoid above the ellipsoid, by the receiver; 0 where it does not tell."""
    rows = flight.topic("vehicle_gps_position", "sensor_gps")
    if rows is None:
        return 0.0
    names = (
        ("altitude_ellipsoid_m", "altitude_msl_m") if "latitude_deg" in (rows.dtype.names or ()) else ("alt_ellipsoid", "alt")
    )
    above, msl = (rows[name].astype(np.float64) for name in names)
    told = (above != 0) & (msl != 0) & (rows["fix_type"] >= 3)
    metre = 1.0 if names[0] == "altitude_ellipsoid_m" else 1e-3
    return float(np.median((above - msl)[told])) * metre if told.any() else 0.0


def _own_solution(flight: _Flight, rows: NDArray[np.void]) -> _Columns:
    """Global position, with the velocity and the attitude of the same filter at the same time."""
    boot_ns = _stamps(rows)
    lla = np.column_stack([np.radians(rows["lat"]), np.radians(rows["lon"]), rows["alt"] + _separation(flight)])
    vel, q = np.full((len(rows), 3), np.nan), np.full((len(rows), 4), np.nan)
    for own, other in _together(flight, "vehicle_local_position", boot_ns):
        vel[own] = np.column_stack([other[name] for name in ("vx", "vy", "vz")])
    for own, other in _together(flight, "vehicle_attitude", boot_ns):
        q[own] = other["q"]
    return {"t_gps_ns": flight.clock().gps_ns(boot_ns), "lla": lla, "vel_n": vel, "q_nb": q}


def _together(flight: _Flight, name: str, boot_ns: Times) -> Iterator[tuple[NDArray[np.intp], NDArray[np.void]]]:
    """Rows that a record of another topic is within 20 ms of, and those records."""
    records = flight.topic(name)
    if records is None:
        return
    other_ns = _stamps(records)
    after = np.clip(np.searchsorted(other_ns, boot_ns), 0, len(other_ns) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(other_ns[after] - boot_ns) <= np.abs(other_ns[before] - boot_ns), after, before)
    own = np.flatnonzero(np.abs(other_ns[nearest] - boot_ns) <= _TOGETHER_NS)
    yield own, records[nearest[own]]


def _attitude(flight: _Flight, rows: NDArray[np.void]) -> _Columns:
    return {"t_gps_ns": flight.clock().gps_ns(_stamps(rows)), "q_nb": rows["q"].astype(np.float64)}


_FIX_FIELDS = (
    "time_utc_usec",
    "fix_type",
    "eph",
    "epv",
    "s_variance_m_s",
    "vel_n_m_s",
    "vel_e_m_s",
    "vel_d_m_s",
    "vel_ned_valid",
)
_LOCAL = ("vx", "vy", "vz")
_FIX_1_14 = (*_FIX_FIELDS, "latitude_deg", "longitude_deg", "altitude_ellipsoid_m", "altitude_msl_m")
_FIX_1_13 = (*_FIX_FIELDS, "lat", "lon", "alt_ellipsoid", "alt")
_TOPICS: dict[str, tuple[Callable[[_Flight, NDArray[np.void]], _Columns], *tuple[tuple[str, ...], ...]]] = {
    "sensor_combined": (_sensor_combined, ("gyro_rad", "accelerometer_m_s2", "accelerometer_timestamp_relative")),
    "vehicle_imu": (_vehicle_imu, ("timestamp_sample", "delta_angle", "delta_angle_dt", "delta_velocity", "delta_velocity_dt")),
    "vehicle_gps_position": (_fixes, _FIX_1_14, _FIX_1_13),
    "sensor_gps": (_fixes, _FIX_1_14, _FIX_1_13),
    "vehicle_global_position": (_own_solution, ("lat", "lon", "alt")),
    "vehicle_attitude": (_attitude, ("q",)),
}
"""By topic, what makes its columns and the fields that needs, in one version of PX4 or another."""
