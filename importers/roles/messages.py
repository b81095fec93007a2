"""Message types and layouts: what each means to navigation, and its columns as rows.

Types are named without the ``/msg/`` of ROS 2. ROS conventions are those of REP 103 and REP 105.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from importers.roles.ephemeris_messages import EPHEMERIS_TYPES
from importers.roles.range_messages import RANGE_TYPES
from importers.roles.receiver_types import RECEIVER_TYPES
from importers.rows.log import Table
from importers.rows.tables import NO_FIX, Rows
from importers.text.nmea import NMEA_NOTE
from navreplay.geodesy.rotation import scalar_first_from_last
from navreplay.timeline import FixStatus, Floats, LogError

__all__ = ["KINDS", "Kind", "find_kind", "stamp_column"]

_NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_RTK_FIXED_STD = 0.1
_RTK_FLOAT_STD = 1.0
_APPROXIMATE = (1, 2)
"""Covariance types of which only the diagonal is meant."""


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


def stamp_column(table: Table) -> np.ndarray | None:
    """Stamps in nanoseconds since 1970 within the messages, None where the type has none."""
    return next((table.columns[name] for name in ("header.stamp", "timestamp", "stamp") if name in table.columns), None)


def _imu(columns: Mapping[str, np.ndarray]) -> Rows:
    has_orientation = "orientation" in columns and "orientation_covariance" in columns
    cov = columns["orientation_covariance"].astype(np.float64).reshape(-1, 3, 3) if has_orientation else None
    return Rows(
        gyro=columns["angular_velocity"].astype(np.float64),
        accel=columns["linear_acceleration"].astype(np.float64),
        sensor_axes="flu",
        units_known=False,
        q=scalar_first_from_last(columns["orientation"]) if has_orientation else None,
        ros_attitude=True,
        cov_att=cov,
        # a first element of -1 says that there is none
        q_missing=None if cov is None else cov[:, 0, 0] == -1,
    )


def _own_imu(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(gyro=columns["angular_velocity"].astype(float), accel=columns["linear_acceleration"].astype(float))


def _nav_sat_fix(columns: Mapping[str, np.ndarray]) -> Rows:
    cov = _position_covariance(columns)
    status = np.zeros(len(cov), dtype=np.int8)
    if "status.status" in columns:
        status = _satellite_status(columns["status.status"].astype(np.int64), cov)
    return Rows(lla=_geodetic(columns), cov_pos=cov, status=status)


def _gps_fix(columns: Mapping[str, np.ndarray]) -> Rows:
    rows = _nav_sat_fix(columns)
    course = np.radians(columns["track"].astype(np.float64))
    speed, climb = columns["speed"].astype(np.float64), columns["climb"].astype(np.float64)
    vel = np.column_stack([speed * np.cos(course), speed * np.sin(course), -climb])
    return Rows(lla=rows.lla, cov_pos=rows.cov_pos, status=rows.status, vel=vel)


def _geodetic(columns: Mapping[str, np.ndarray]) -> Floats:
    lla = np.column_stack([columns["latitude"], columns["longitude"], columns["altitude"]]).astype(np.float64)
    return np.asarray(lla * [np.pi / 180, np.pi / 180, 1.0])


def _position_covariance(columns: Mapping[str, np.ndarray]) -> Floats:
    """NED covariances (n, 3, 3) of ENU ones, all NaN where their type says unknown."""
    cov = columns["position_covariance"].astype(np.float64).reshape(-1, 3, 3)
    kind = columns.get("position_covariance_type", np.full(len(cov), 3)).astype(np.int64)
    diagonal = np.isin(kind, _APPROXIMATE)
    cov = np.where(diagonal[:, None, None], cov * np.eye(3), cov)
    cov = _NED_OF_ENU @ cov @ _NED_OF_ENU.T
    cov[kind == 0] = np.nan
    return np.asarray(cov)


def _satellite_status(code: np.ndarray, cov: Floats) -> np.ndarray:
    """FixStatus of NavSatStatus. A ground-based augmentation (2) is how drivers tell carrier-phase solutions; the standard
    deviation separates fixed from float from code-differential."""
    std = np.sqrt(np.maximum(cov[:, 0, 0], cov[:, 1, 1]), where=cov[:, 0, 0] >= 0, out=np.full(len(cov), np.inf))
    ground = np.where(std <= _RTK_FIXED_STD, FixStatus.FIXED, np.where(std <= _RTK_FLOAT_STD, FixStatus.FLOAT, 2))
    status = np.where(code == 2, ground, np.where(code > 0, FixStatus.DIFFERENTIAL, FixStatus.SINGLE))
    return np.where(code < 0, NO_FIX, status).astype(np.int8)


def _twist(prefix: str) -> Callable[[Mapping[str, np.ndarray]], Rows]:
    def rows(columns: Mapping[str, np.ndarray]) -> Rows:
        """Velocities and, where the message has them, their covariances."""
        cov = columns.get("twist.covariance")
        cov_vel = None if cov is None else cov.astype(np.float64).reshape(-1, 6, 6)[:, :3, :3]
        return Rows(vel=columns[prefix + "linear"].astype(np.float64), vel_frame="auto", cov_vel=cov_vel)

    return rows


def _own_velocity(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(vel=columns["velocity"].astype(np.float64))


def _pose(prefix: str) -> Callable[[Mapping[str, np.ndarray]], Rows]:
    def rows(columns: Mapping[str, np.ndarray]) -> Rows:
        """Local positions and attitudes."""
        q = scalar_first_from_last(columns[prefix + "orientation"])
        cov = columns.get("pose.covariance")
        cov_att = None if cov is None else cov.astype(np.float64).reshape(-1, 6, 6)[:, 3:, 3:]
        return Rows(local=columns[prefix + "position"].astype(np.float64), q=q, ros_attitude=True, cov_att=cov_att)

    return rows


def _quaternion(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(q=scalar_first_from_last(columns["quaternion"]), ros_attitude=True)


def _no_rows(columns: Mapping[str, np.ndarray]) -> Rows:
    raise LogError(f"messages with the columns {', '.join(columns)} have no rows of navigation")


def _tum(columns: Mapping[str, np.ndarray]) -> Rows:
    return Rows(local=columns["local"], q=columns["q"], ros_attitude=True)


def _text(columns: Mapping[str, np.ndarray], units_known: bool = True, means: bool = False) -> Rows:
    earth_fixed = "vel_ecef" in columns
    return Rows(
        gyro=columns.get("gyro"),
        accel=columns.get("accel"),
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
    "sensor_msgs/NavSatFix": Kind(_FIX, _nav_sat_fix, _MSL_NOTE),
    "sensor_msgs/TimeReference": Kind(("time",), _no_rows),
    "gps_common/GPSFix": Kind(_FIX, _gps_fix),
    "gps_msgs/GPSFix": Kind(_FIX, _gps_fix),
    "foxglove.LocationFix": Kind(_FIX, _nav_sat_fix, _MSL_NOTE),
    "foxglove_msgs/LocationFix": Kind(_FIX, _nav_sat_fix, _MSL_NOTE),
    "geometry_msgs/TwistStamped": Kind(("velocity",), _twist("twist.")),
    "geometry_msgs/TwistWithCovarianceStamped": Kind(("velocity",), _twist("twist.twist.")),
    "geometry_msgs/QuaternionStamped": Kind(("attitude",), _quaternion, automatic=False),
    "geometry_msgs/PoseStamped": Kind(_POSE, _pose("pose."), automatic=False),
    "geometry_msgs/PoseWithCovarianceStamped": Kind(_POSE, _pose("pose.pose."), automatic=False),
    "nav_msgs/Odometry": Kind(_POSE, _pose("pose.pose."), automatic=False),
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
    "nmea": Kind(_FIX, _text, NMEA_NOTE, rank=2),
    "tum": Kind(("reference",), _tum),
    "csv/imu": Kind(("imu",), _mapped),
    "csv/fix": Kind(_FIX, _mapped),
    "csv/velocity": Kind(("velocity",), _mapped),
    "csv/attitude": Kind(("attitude",), _mapped),
    "csv/reference": Kind(("reference",), _mapped),
}
KINDS |= {type: Kind((role,), _no_rows) for role, types in _RAW_GNSS.items() for type in types}
KINDS |= {
    name: Kind(type.roles, _text_means if type.means else _text, type.note, type.automatic, type.rank)
    for name, type in RECEIVER_TYPES.items()
}
