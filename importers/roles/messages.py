"""Message types and layouts: what each means to navigation, and its columns as rows.

Types are named without the ``/msg/`` of ROS 2. ROS conventions are those of REP 103 and REP 105.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from importers.nmea.fixes import NMEA_NOTE
from importers.roles.ephemeris_messages import EPHEMERIS_TYPES
from importers.roles.fix_messages import gps_fix, nav_sat_fix
from importers.roles.range_messages import RANGE_TYPES
from importers.roles.receiver_types import RECEIVER_TYPES
from importers.rows.log import Channel, Table
from importers.rows.message_fields import covariances, numbers_of, vectors
from importers.rows.tables import Rows
from importers.rows.vehicle_columns import pressure_height
from navreplay.geodesy.rotation import scalar_first_from_last
from navreplay.timeline import Floats, LogError

__all__ = ["KINDS", "Kind", "find_kind", "kind_of", "stamp_column"]

_LATEST_NS = 9.2e18
_EARLIEST_UNIX_NS = 631_152_000 * 10**9
_NS_OF_UNITS = (10**3, 10**6, 10**9)


@dataclass(frozen=True, slots=True)
class Kind:
    """roles: what a channel of a type can serve as, the first being the usual. rows: its table as rows. note: an assumption
    that is told whenever it is used. automatic: whether it is used without being named. rank: of several automatic ones in a
    file the least is used."""

    roles: tuple[str, ...]
    rows: Callable[[Mapping[str, np.ndarray]], Rows]
    note: str = ""
    automatic: bool = True
    rank: int = 0


def find_kind(type: str) -> Kind | None:
    """The kind of a message type or layout, None for one without meaning to navigation."""
    return KINDS.get(type.replace("/msg/", "/"))


def kind_of(channel: Channel) -> Kind | None:
    """The kind of a channel, by its mapping or else by its type; None for one without meaning to navigation."""
    return find_kind(channel.layout or channel.type)


def stamp_column(table: Table) -> np.ndarray | None:
    """Stamps in nanoseconds since 1970 within the messages, None where the type has none.

    A stamp that is a number in JSON may count seconds, milliseconds or microseconds: that is taken with which it is a date, and
    spans the time that the recorder does.
    """
    columns = (table.columns.get(name) for name in ("header.stamp", "timestamp", "stamp"))
    column = next((column for column in columns if column is not None), None)
    if column is None or len(column) == 0:
        return column
    counts = column if column.dtype.kind in "iu" else numbers_of(column)
    scale = _stamp_scale(counts.astype(np.float64), table.log_time_ns)
    if scale == 1 and counts.dtype.kind in "iu":
        return counts
    stamps = counts * float(scale) if counts.dtype.kind == "f" else counts.astype(np.float64) * scale
    return np.where(np.abs(stamps) < _LATEST_NS, np.nan_to_num(np.rint(stamps)), 0.0).astype(np.int64)


def _stamp_scale(counts: Floats, log_time_ns: np.ndarray) -> int:
    """Nanoseconds per count."""
    known = counts[np.isfinite(counts)]
    if len(known) < 2 or np.median(known) >= _EARLIEST_UNIX_NS:
        return 1
    span, recorded = float(np.ptp(known)), float(np.ptp(log_time_ns))
    for scale in _NS_OF_UNITS:
        dated = _EARLIEST_UNIX_NS <= np.median(known) * scale < _LATEST_NS
        if dated and 0.5 * recorded <= span * scale <= 2 * recorded:
            return scale
    return 1


def _count(columns: Mapping[str, np.ndarray]) -> int:
    return len(next(iter(columns.values()), ()))


def _imu(columns: Mapping[str, np.ndarray]) -> Rows:
    n = _count(columns)
    has_orientation = "orientation" in columns and "orientation_covariance" in columns
    cov = covariances(columns, "orientation_covariance", 3, n) if has_orientation else None
    return Rows(
        gyro=_unless_absent(columns, "angular_velocity", n),
        accel=_unless_absent(columns, "linear_acceleration", n),
        sensor_axes="flu",
        units_known=False,
        q=scalar_first_from_last(vectors(columns, "orientation", 4, n)) if has_orientation else None,
        ros_attitude=True,
        cov_att=cov,
        # a first element of -1 says that there is none
        q_missing=None if cov is None else cov[:, 0, 0] == -1,
    )


def _unless_absent(columns: Mapping[str, np.ndarray], name: str, n: int) -> Floats | None:
    """Vectors (n, 3); None where the messages say that they have none (a first covariance element of -1) and never hold
    anything but one value, or hold nothing but zeros, which no inertial sensor does."""
    if name not in columns:
        raise KeyError(name)
    values = vectors(columns, name, 3, n)
    told = covariances(columns, f"{name}_covariance", 3, n)[:, 0, 0]
    constant = n > 1 and not np.any(values[1:] != values[0])
    absent = constant and (bool((told == -1).all()) or not np.any(values))
    return None if absent else values


def _own_imu(columns: Mapping[str, np.ndarray]) -> Rows:
    n = _count(columns)
    return Rows(gyro=vectors(columns, "angular_velocity", 3, n), accel=vectors(columns, "linear_acceleration", 3, n))


def _twist(prefix: str) -> Callable[[Mapping[str, np.ndarray]], Rows]:
    def rows(columns: Mapping[str, np.ndarray]) -> Rows:
        """Velocities and, where the message has them, their covariances."""
        n = _count(columns)
        if prefix + "linear" not in columns:
            raise KeyError(prefix + "linear")
        cov_vel = covariances(columns, "twist.covariance", 6, n)[:, :3, :3] if "twist.covariance" in columns else None
        along = _along(columns, prefix)
        return Rows(vel=vectors(columns, prefix + "linear", 3, n), vel_frame="auto", cov_vel=cov_vel, **along)

    return rows


def _own_velocity(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(vel=vectors(columns, "velocity", 3, _count(columns)))


def _pose(prefix: str) -> Callable[[Mapping[str, np.ndarray]], Rows]:
    def rows(columns: Mapping[str, np.ndarray]) -> Rows:
        """Local positions and attitudes."""
        n = _count(columns)
        if prefix + "position" not in columns:
            raise KeyError(prefix + "position")
        q = scalar_first_from_last(vectors(columns, prefix + "orientation", 4, n))
        cov_att = covariances(columns, "pose.covariance", 6, n)[:, 3:, 3:] if "pose.covariance" in columns else None
        return Rows(local=vectors(columns, prefix + "position", 3, n), q=q, ros_attitude=True, cov_att=cov_att)

    return rows


def _odometry(columns: Mapping[str, np.ndarray]) -> Rows:
    """Pose, and the twist, which is that of the body (nav_msgs/Odometry: in child_frame_id)."""
    pose = _pose("pose.pose.")(columns)
    return replace(pose, **_along(columns, "twist.twist.")) if "twist.twist.linear" in columns else pose


def _along(columns: Mapping[str, np.ndarray], prefix: str) -> dict[str, Floats]:
    """Speed along x and turn to the right of a twist of an FLU body."""
    n = _count(columns)
    forward = vectors(columns, prefix + "linear", 3, n)[:, 0]
    angular = vectors(columns, prefix + "angular", 3, n)[:, 2] if prefix + "angular" in columns else np.full(n, np.nan)
    unknown = np.full(n, np.nan)
    return {"wheels": np.column_stack([forward, unknown, unknown]), "turn": -angular}


def _ackermann(columns: Mapping[str, np.ndarray]) -> Rows:
    if "drive.speed" not in columns:
        raise KeyError("drive.speed")
    speed = np.asarray(columns["drive.speed"], dtype=np.float64)
    return Rows(wheels=np.column_stack([speed, np.full(len(speed), np.nan), np.full(len(speed), np.nan)]))


def _quaternion(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(q=scalar_first_from_last(vectors(columns, "quaternion", 4, _count(columns))), ros_attitude=True)


def _no_rows(columns: Mapping[str, np.ndarray]) -> Rows:
    raise LogError(f"messages with the columns {', '.join(columns)} have no rows of navigation")


def _tum(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(local=columns["local"], q=columns["q"], ros_attitude=True)


def _text(columns: Mapping[str, np.ndarray], units_known: bool = True, means: bool = False, axes: str = "frd") -> Rows:
    earth_fixed = "vel_ecef" in columns
    return Rows(
        gyro=columns.get("gyro"),
        accel=columns.get("accel"),
        sensor_axes=axes,
        units_known=units_known,
        means=means,
        lla=columns.get("lla"),
        vel=columns.get("vel_ecef") if earth_fixed else columns.get("vel_n"),
        vel_frame="ecef" if earth_fixed else "ned",
        cov_pos=columns.get("cov_pos"),
        cov_vel=columns.get("cov_vel"),
        status=columns.get("status"),
        q=columns.get("q_nb"),
        cov_att=columns.get("cov_att"),
    )


def _wheels(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(wheels=columns.get("wheels"), ticks=columns.get("ticks"), turn=columns.get("turn"))


def _baro(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(baro=columns["baro"])


def _fluid_pressure(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(baro=pressure_height(np.asarray(columns["fluid_pressure"], dtype=np.float64)))


def _earth_attitude(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(q=columns["q_eb"], q_frame="earth", cov_att=columns.get("cov_att"))


def _text_means(columns: Mapping[str, np.ndarray]) -> Rows:
    return _text(columns, means=True)


def _mapped(columns: Mapping[str, np.ndarray]) -> Rows:
    return _text(columns, units_known=False)


_FIX = ("fix", "reference")
_RAW_GNSS = {"range": RANGE_TYPES, "ephemeris": EPHEMERIS_TYPES}
_POSE = ("reference", "attitude")
_MSL_NOTE = "heights of the fixes are taken as ellipsoidal, as NavSatFix defines them; some drivers give mean sea level"

KINDS: dict[str, Kind] = {
    "sensor_msgs/Imu": Kind(("imu", "attitude"), _imu),
    "sensor_msgs/NavSatFix": Kind(_FIX, nav_sat_fix, _MSL_NOTE),
    "sensor_msgs/TimeReference": Kind(("time",), _no_rows),
    "gps_common/GPSFix": Kind(_FIX, gps_fix),
    "gps_msgs/GPSFix": Kind(_FIX, gps_fix),
    "foxglove.LocationFix": Kind(_FIX, nav_sat_fix, _MSL_NOTE),
    "foxglove_msgs/LocationFix": Kind(_FIX, nav_sat_fix, _MSL_NOTE),
    "geometry_msgs/TwistStamped": Kind(("velocity", "speed"), _twist("twist.")),
    "geometry_msgs/TwistWithCovarianceStamped": Kind(("velocity", "speed"), _twist("twist.twist.")),
    "geometry_msgs/QuaternionStamped": Kind(("attitude",), _quaternion, automatic=False),
    "geometry_msgs/PoseStamped": Kind(_POSE, _pose("pose."), automatic=False),
    "geometry_msgs/PoseWithCovarianceStamped": Kind(_POSE, _pose("pose.pose."), automatic=False),
    "nav_msgs/Odometry": Kind((*_POSE, "speed"), _odometry, automatic=False),
    "ackermann_msgs/AckermannDriveStamped": Kind(("speed",), _ackermann, automatic=False),
    "foxglove.PoseInFrame": Kind(_POSE, _pose("pose."), automatic=False),
    "foxglove_msgs/PoseInFrame": Kind(_POSE, _pose("pose."), automatic=False),
    "navreplay.Imu": Kind(("imu",), _own_imu),
    "navreplay.Velocity": Kind(("velocity",), _own_velocity),
    "navreplay/imu": Kind(("imu",), _text),
    "navreplay/imu_mean": Kind(("imu",), _text_means),
    "navreplay/fix": Kind(_FIX, _text),
    "navreplay/attitude": Kind(("attitude",), _earth_attitude),
    "navreplay/trajectory": Kind(("reference",), _text),
    "navreplay/solution": Kind(("reference",), _text),
    "rtklib/pos": Kind(_FIX, _text),
    "kf_gins/imu": Kind(("imu",), _text_means),
    "kf_gins/gnss": Kind(_FIX, _text),
    "nmea": Kind(_FIX, _text, NMEA_NOTE, rank=3),
    "tum": Kind(("reference",), _tum),
    "message/imu": Kind(("imu",), _mapped),
    "message/imu_si": Kind(("imu",), _text),
    "message/imu_mean": Kind(("imu",), _text_means),
    "message/fix": Kind(_FIX, _text),
    "message/velocity": Kind(("velocity",), _text),
    "message/attitude": Kind(("attitude",), _text),
    "sensor_msgs/FluidPressure": Kind(("baro",), _fluid_pressure, automatic=False),
    "message/baro": Kind(("baro",), _baro),
    "message/speed": Kind(("speed",), _wheels),
    "message/reference": Kind(("reference",), _text),
    "csv/imu": Kind(("imu",), _mapped),
    "csv/fix": Kind(_FIX, _mapped),
    "csv/velocity": Kind(("velocity",), _mapped),
    "csv/attitude": Kind(("attitude",), _mapped),
    "csv/baro": Kind(("baro",), _baro),
    "csv/speed": Kind(("speed",), _wheels),
    "csv/reference": Kind(("reference",), _mapped),
}
KINDS |= {type: Kind((role,), _no_rows) for role, types in _RAW_GNSS.items() for type in types}
KINDS |= {
    name: Kind(type.roles, partial(_text, means=type.means, axes=type.axes), type.note, type.automatic, type.rank)
    for name, type in RECEIVER_TYPES.items()
}
