"""The common timeline: what importers produce and filters consume.

Conventions, for the whole program: SI units and radians; NED navigation frame ``n``; forward-right-down body frame ``b``;
quaternion ``q_nb`` (body to navigation), scalar first; ``C_nb`` projects from ``b`` to ``n``; positions as latitude [rad],
longitude [rad], ellipsoidal height [m]; time as int64 nanoseconds of GPS time since 1980-01-06. NaN means unknown.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "AttitudeFrame",
    "AttitudeSeries",
    "BaroSeries",
    "ChannelUse",
    "FixStatus",
    "GnssFixSeries",
    "ImuSeries",
    "LogError",
    "Provenance",
    "RangeColumns",
    "RangeSeries",
    "SourceFile",
    "SpeedSeries",
    "Timeline",
    "Trajectory",
]

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


class LogError(Exception):
    """Input that cannot be used. The message is one line: what, where, the likely cause, what to do."""


class FixStatus(IntEnum):
    """Kind of a GNSS fix; rows without any fix never enter a series."""

    UNKNOWN = 0
    SINGLE = 1
    DIFFERENTIAL = 2
    FLOAT = 3
    FIXED = 4
    DEAD_RECKONING = 5


def _check_times(name: str, t_ns: Times) -> None:
    if t_ns.ndim != 1 or t_ns.dtype != np.int64:
        raise LogError(f"{name}: time must be one column of int64 nanoseconds, got {t_ns.dtype} of shape {t_ns.shape}")
    if len(t_ns) == 0:
        raise LogError(f"{name}: no samples")
    backward = np.flatnonzero(np.diff(t_ns) <= 0)
    if len(backward):
        i = int(backward[0])
        raise LogError(f"{name}: time must strictly increase, but sample {i + 1} is at {t_ns[i + 1]} ns after {t_ns[i]} ns")


def _check_shape(name: str, column: str, values: np.ndarray, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise LogError(f"{name}: {column} must have shape {shape}, got {values.shape}")


def _check_finite(name: str, column: str, values: Floats) -> None:
    rows = values.reshape(len(values), -1)
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise LogError(f"{name}: {column} of sample {int(bad[0])} is not finite ({len(bad)} such samples)")


def _check_lla(name: str, lla: Floats) -> None:
    known = lla[np.isfinite(lla[:, 0])]
    if len(known) and (np.abs(known[:, 0]) > np.pi / 2).any():
        raise LogError(
            f"{name}: latitude beyond 90 degrees; were latitude and longitude exchanged, or degrees taken for radians?"
        )


@dataclass(frozen=True, eq=False, slots=True)
class ImuSeries:
    """Angular rate and specific force in the body frame.

    t_ns: (n,) end of the sampling interval. gyro: (n, 3) [rad/s]. accel: (n, 3) [m/s^2], specific force.
    increments: True when each sample is the mean over the interval that ends at its stamp (an integrating sensor's
    increment divided by the interval), False when it is the instantaneous value at its stamp.
    Raises LogError unless times strictly increase and all samples are finite.
    """

    t_ns: Times
    gyro: Floats
    accel: Floats
    increments: bool = False

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        _check_times("imu", self.t_ns)
        for column, values in (("gyro", self.gyro), ("accel", self.accel)):
            _check_shape("imu", column, values, (n, 3))
            _check_finite("imu", column, values)

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True, eq=False, slots=True)
class GnssFixSeries:
    """Position and/or velocity of the GNSS antenna; a row holds at least one of the two.

    t_ns: (n,). lla: (n, 3) [rad, rad, m], NaN where unknown. vel_n: (n, 3) NED [m/s], NaN where unknown.
    cov_pos: (n, 3, 3) NED [m^2], cov_vel: (n, 3, 3) NED [m^2/s^2], all NaN where unknown. status: (n,) int8 of FixStatus.
    Raises LogError unless times strictly increase and known covariances have a positive diagonal.
    """

    t_ns: Times
    lla: Floats
    vel_n: Floats
    cov_pos: Floats
    cov_vel: Floats
    status: NDArray[np.int8]

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        _check_times("fixes", self.t_ns)
        for column, values, shape in (
            ("lla", self.lla, (n, 3)),
            ("vel_n", self.vel_n, (n, 3)),
            ("cov_pos", self.cov_pos, (n, 3, 3)),
            ("cov_vel", self.cov_vel, (n, 3, 3)),
            ("status", self.status, (n,)),
        ):
            _check_shape("fixes", column, values, shape)
        _check_lla("fixes", self.lla)
        empty = ~(self.has_position | self.has_velocity)
        if empty.any():
            raise LogError(f"fixes: row {int(np.flatnonzero(empty)[0])} holds neither position nor velocity")
        for column, cov in (("cov_pos", self.cov_pos), ("cov_vel", self.cov_vel)):
            bad = np.flatnonzero((np.diagonal(cov, axis1=1, axis2=2) <= 0).any(axis=1))
            if len(bad):
                raise LogError(f"fixes: {column} of row {int(bad[0])} has a diagonal that is not positive; unknown is NaN")

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def has_position(self) -> NDArray[np.bool_]:
        """(n,) rows whose position is known."""
        return np.asarray(np.isfinite(self.lla).all(axis=1))

    @property
    def has_velocity(self) -> NDArray[np.bool_]:
        """(n,) rows whose velocity is known."""
        return np.asarray(np.isfinite(self.vel_n).all(axis=1))


@dataclass(frozen=True, eq=False, slots=True)
class RangeColumns:
    """The columns of observed ranges, a row per satellite signal and epoch: as read (`importers.rows.ranges.RangeRows`) and as
    filtered (`RangeSeries`, which says what each holds)."""

    t_ns: Times
    sat: NDArray[np.str_]
    signal: NDArray[np.str_]
    pseudorange: Floats
    range_rate: Floats
    pseudorange_std: Floats
    range_rate_std: Floats
    cn0: Floats
    sat_pos_e: Floats
    sat_vel_e: Floats


@dataclass(frozen=True, eq=False, slots=True)
class RangeSeries(RangeColumns):
    """Pseudoranges and range rates of one receiver: a row per satellite signal and epoch, rows in the order of time.

    t_ns: (n,) receive time, equal within an epoch. sat: (n,) such as ``G05`` (RINEX system letter and number). signal: (n,)
    RINEX code such as ``1C``. pseudorange: (n,) [m], with satellite clock, relativity and group delay already added.
    range_rate: (n,) [m/s], with the satellite's clock drift already added, NaN where unknown. pseudorange_std, range_rate_std,
    cn0 [dB-Hz]: (n,), NaN where unknown. sat_pos_e: (n, 3) [m] of the satellite at transmission, in Earth-fixed axes of the
    time of reception (turned for the signal's flight). sat_vel_e: (n, 3) [m/s] in the same axes.
    ionosphere_removed, troposphere_removed: whether the pseudoranges are free of them already. klobuchar: (8,) broadcast
    alpha0..3 and beta0..3, None where unknown; klobuchar_system: whose model they belong to, G (GPS) or C (BeiDou).
    Raises LogError unless times never fall and pseudoranges and satellite states are finite.
    """

    ionosphere_removed: bool = False
    troposphere_removed: bool = False
    klobuchar: Floats | None = None
    klobuchar_system: str = "G"

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        if n == 0:
            raise LogError("ranges: no samples")
        falling = np.flatnonzero(np.diff(self.t_ns) < 0)
        if len(falling):
            raise LogError(f"ranges: time must not fall, but it does behind row {int(falling[0])}")
        for column in ("sat", "signal", "pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0"):
            _check_shape("ranges", column, getattr(self, column), (n,))
        for column in ("sat_pos_e", "sat_vel_e"):
            _check_shape("ranges", column, getattr(self, column), (n, 3))
        for column in ("pseudorange", "sat_pos_e", "sat_vel_e"):
            _check_finite("ranges", column, getattr(self, column))

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def epoch_starts(self) -> NDArray[np.intp]:
        """(k + 1,) index of each epoch's first row, and the number of rows."""
        return np.concatenate([np.flatnonzero(np.diff(self.t_ns, prepend=self.t_ns[0] - 1)), [len(self)]])


AttitudeFrame = Literal["navigation", "earth"]


@dataclass(frozen=True, eq=False, slots=True)
class AttitudeSeries:
    """Attitude measured by another sensor (dual antenna, AHRS, star tracker).

    t_ns: (n,). q: (n, 4) body to frame, scalar first, of unit length. cov: (n, 3, 3) of the small rotation about the axes of
    frame [rad^2], NaN where unknown. frame: NED at the vehicle, or Earth-fixed. heading_only: True when roll and pitch in q
    carry no information.
    Raises LogError unless times strictly increase, quaternions are of unit length and heading_only goes with navigation.
    """

    t_ns: Times
    q: Floats
    cov: Floats
    frame: AttitudeFrame = "navigation"
    heading_only: bool = False

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        _check_times("attitude", self.t_ns)
        _check_shape("attitude", "q", self.q, (n, 4))
        _check_shape("attitude", "cov", self.cov, (n, 3, 3))
        _check_finite("attitude", "q", self.q)
        length = np.linalg.norm(self.q, axis=1)
        bad = np.flatnonzero(np.abs(length - 1) > 1e-6)
        if len(bad):
            raise LogError(f"attitude: the quaternion of row {int(bad[0])} has length {length[bad[0]]:.6g}, not 1")
        if self.heading_only and self.frame != "navigation":
            raise LogError("attitude: a heading alone can only be told against north, not against Earth-fixed axes")

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True, eq=False, slots=True)
class SpeedSeries:
    """Speed along a land vehicle's way by its wheels, at the middle of the rear axle.

    t_ns: (n,). speed: (n,) [m/s] forward, or in a unit of the sensor's own until it is fitted to fixes. turn: (n,) angular
    rate to the right [rad/s] by the difference of left and right wheels, or in a unit of its own; NaN where unknown. std:
    [m/s] of one speed. scale_std: of its scale. delay_std [s]: of its time. turn_std: [rad/s] of one angular rate.
    Raises LogError unless times strictly increase and speeds are finite.
    """

    t_ns: Times
    speed: Floats
    turn: Floats
    std: float = 0.1
    scale_std: float = 0.01
    delay_std: float = 0.05
    turn_std: float = 0.02

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        _check_times("speed", self.t_ns)
        for column, values in (("speed", self.speed), ("turn", self.turn)):
            _check_shape("speed", column, values, (n,))
        _check_finite("speed", "speed", self.speed)

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True, eq=False, slots=True)
class BaroSeries:
    """Height by a barometer, whose zero nobody knows and which drifts: only its changes count.

    t_ns: (n,). height: (n,) [m].
    Raises LogError unless times strictly increase and heights are finite.
    """

    t_ns: Times
    height: Floats

    def __post_init__(self) -> None:
        _check_times("baro", self.t_ns)
        _check_shape("baro", "height", self.height, (len(self.t_ns),))
        _check_finite("baro", "height", self.height)

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True, eq=False, slots=True)
class Trajectory:
    """A path: the reference solution, or a truth.

    t_ns: (n,). lla: (n, 3) [rad, rad, m]. vel_n: (n, 3) NED [m/s] and q_nb: (n, 4), NaN where unknown.
    cov_pos: (n, 3, 3) NED [m^2], NaN where unknown.
    """

    t_ns: Times
    lla: Floats
    vel_n: Floats
    q_nb: Floats
    cov_pos: Floats

    def __post_init__(self) -> None:
        n = len(self.t_ns)
        _check_times("trajectory", self.t_ns)
        for column, values, shape in (
            ("lla", self.lla, (n, 3)),
            ("vel_n", self.vel_n, (n, 3)),
            ("q_nb", self.q_nb, (n, 4)),
            ("cov_pos", self.cov_pos, (n, 3, 3)),
        ):
            _check_shape("trajectory", column, values, shape)
        _check_finite("trajectory", "lla", self.lla)
        _check_lla("trajectory", self.lla)

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(frozen=True, slots=True)
class SourceFile:
    """One input file: path as given, format name, size [bytes] and SHA-256 in hex."""

    path: str
    format: str
    size: int
    sha256: str


@dataclass(frozen=True, slots=True)
class ChannelUse:
    """Accounting of one channel: read = used + rejected, always (checked here).

    name: the topic, or the file name where a file is one channel. file: path as given. type: message type or layout name.
    role: ``imu``, ``fix``, ``velocity``, ``attitude``, ``reference``, ... or ``unused`` (then read = used = 0).
    rejected: count per reason, a reason being a short plain phrase such as ``not finite`` or ``time not increasing``.
    """

    name: str
    file: str
    type: str
    role: str
    read: int
    used: int
    rejected: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rejected = sum(self.rejected.values())
        if self.read != self.used + rejected:
            raise AssertionError(f"{self.name}: read {self.read} but used {self.used} + rejected {rejected}")


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a timeline came from: files, channels, and in plain sentences what was assumed or converted on the way and what
    damage the files have. recognised: of what was not set, what it was taken as, by the key that sets it."""

    files: tuple[SourceFile, ...] = ()
    channels: tuple[ChannelUse, ...] = ()
    assumptions: tuple[str, ...] = ()
    damage: tuple[str, ...] = ()
    recognised: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Timeline:
    """All series of a log on GPS time, converted to the program's conventions.

    fix_lever_b: (3,) from the IMU to the GNSS antenna, body axes [m]. reference_lever_b: (3,) from the IMU to the point
    that the reference describes, body axes [m].
    """

    imu: ImuSeries | None = None
    fixes: GnssFixSeries | None = None
    ranges: RangeSeries | None = None
    attitude: AttitudeSeries | None = None
    reference: Trajectory | None = None
    speed: SpeedSeries | None = None
    baro: BaroSeries | None = None
    fix_lever_b: Floats = field(default_factory=lambda: np.zeros(3))
    reference_lever_b: Floats = field(default_factory=lambda: np.zeros(3))
    provenance: Provenance = Provenance()
