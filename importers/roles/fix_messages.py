"""Fixes as messages: sensor_msgs/NavSatFix, gps_msgs/GPSFix and foxglove's LocationFix, whatever of them was never filled."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from importers.rows.message_fields import codes, covariances, numbers, numbers_of
from importers.rows.tables import NO_FIX, Rows, diagonal_covariance
from navreplay.options import FilterOptions
from navreplay.timeline import FixStatus, Floats

__all__ = ["gps_fix", "nav_sat_fix"]

_EAST_NORTH = [1, 0, 2]
_UP_SIGNS = np.outer([1.0, 1.0, -1.0], [1.0, 1.0, -1.0])
_RTK_FIXED_STD = 0.1
_RTK_FLOAT_STD = 1.0
_APPROXIMATE = (1, 2)
"""Covariance types of which only the diagonal is meant."""
_STATUS_UNKNOWN = -2
_COVARIANCE_KNOWN = 3
_COVARIANCE_TYPES = {"UNKNOWN": 0, "APPROXIMATED": 1, "DIAGONAL_KNOWN": 2, "KNOWN": 3}
_GPS_STATUS = {
    -1: NO_FIX, 0: FixStatus.SINGLE, 1: FixStatus.DIFFERENTIAL, 18: FixStatus.DIFFERENTIAL, 19: FixStatus.FIXED,
    20: FixStatus.FLOAT, 33: FixStatus.DIFFERENTIAL,
}  # fmt: skip
"""Of gps_msgs/GPSStatus; 2 (ground-based augmentation) is judged by the accuracy told."""
_STDS_OF_95_PERCENT = 2.0
_CLIMB_STD = 100.0


def nav_sat_fix(columns: Mapping[str, np.ndarray]) -> Rows:
    """Rows of sensor_msgs/NavSatFix and foxglove's LocationFix. Raises KeyError where latitude or longitude are missing."""
    cov = _position_covariance(columns)
    status = np.zeros(len(cov), dtype=np.int8)
    if "status.status" in columns:
        status = _satellite_status(codes(columns, "status.status", len(cov), _STATUS_UNKNOWN), cov)
    return Rows(lla=_geodetic(columns), cov_pos=cov, status=status)


def gps_fix(columns: Mapping[str, np.ndarray]) -> Rows:
    """Rows of gps_msgs/GPSFix, with velocities. Raises KeyError as `nav_sat_fix`."""
    rows = nav_sat_fix(columns)
    n = len(columns["latitude"])
    if "status.status" in columns:
        code = codes(columns, "status.status", n, _STATUS_UNKNOWN)
        meant = np.array([_GPS_STATUS.get(value, FixStatus.UNKNOWN) for value in code.tolist()], dtype=np.int8)
        rows = replace(rows, status=np.where(code == 2, rows.status, meant))
    vel, cov_vel = _track_velocity(columns, n)
    return replace(rows, vel=vel, cov_vel=cov_vel)


def _track_velocity(columns: Mapping[str, np.ndarray], n: int) -> tuple[Floats, Floats | None]:
    """Velocities NED (n, 3) of speed, track [deg] and climb, and their covariances (None: unknown). What a driver never fills
    stays 0 throughout, without an error told: such a speed is unknown, such a climb too uncertain to count."""
    speed, climb = numbers(columns, "speed", n), numbers(columns, "climb", n)
    track = np.where(speed == 0, np.nan_to_num(numbers(columns, "track", n)), numbers(columns, "track", n))
    if not np.any(np.nan_to_num(speed)) and not np.any(np.nan_to_num(track)) and not _told(columns, "err_speed", n):
        return np.full((n, 3), np.nan), None
    no_climb = ~np.isfinite(climb)
    if not np.any(np.nan_to_num(climb)) and not _told(columns, "err_climb", n):
        no_climb[:] = True
    course = np.radians(track)
    vel = np.column_stack([speed * np.cos(course), speed * np.sin(course), -np.where(no_climb, 0.0, climb)])
    if not no_climb.any():
        return vel, None
    std = numbers(columns, "err_speed", n) / _STDS_OF_95_PERCENT
    std = np.where(std > 0, std, FilterOptions().default_velocity_std[0])
    return vel, diagonal_covariance(np.column_stack([std, std, np.where(no_climb, _CLIMB_STD, std)]))


def _told(columns: Mapping[str, np.ndarray], name: str, n: int) -> bool:
    return bool(np.any(np.nan_to_num(numbers(columns, name, n)) > 0))


def _geodetic(columns: Mapping[str, np.ndarray]) -> Floats:
    n = len(columns["latitude"])
    lla = np.column_stack([numbers_of(columns["latitude"]), numbers_of(columns["longitude"]), numbers(columns, "altitude", n)])
    return np.asarray(lla * [np.pi / 180, np.pi / 180, 1.0])


def _position_covariance(columns: Mapping[str, np.ndarray]) -> Floats:
    """NED covariances (n, 3, 3) of ENU ones, all NaN where their type says unknown or there is none."""
    n = len(columns["latitude"])
    cov = covariances(columns, "position_covariance", 3, n)
    kind = codes(columns, "position_covariance_type", n, _COVARIANCE_KNOWN, _COVARIANCE_TYPES)
    diagonal = np.isin(kind, _APPROXIMATE)
    cov = np.where(diagonal[:, None, None] & ~np.eye(3, dtype=bool), 0.0, cov)
    cov = cov[:, _EAST_NORTH][:, :, _EAST_NORTH] * _UP_SIGNS + 0.0  # by place: an unknown element stays alone; no -0
    cov[kind == 0] = np.nan
    return np.asarray(cov)


def _satellite_status(code: np.ndarray, cov: Floats) -> np.ndarray:
    """FixStatus of NavSatStatus. A ground-based augmentation (2) is how drivers tell carrier-phase solutions; the standard
    deviation separates fixed from float from code-differential. -2 is unknown (since ROS 2 Jazzy), as is any other code."""
    std = np.sqrt(np.maximum(cov[:, 0, 0], cov[:, 1, 1]), where=cov[:, 0, 0] >= 0, out=np.full(len(cov), np.inf))
    ground = np.where(std <= _RTK_FIXED_STD, FixStatus.FIXED, np.where(std <= _RTK_FLOAT_STD, FixStatus.FLOAT, 2))
    known = [code == -1, code == 0, code == 1, code == 2]
    return np.select(known, [NO_FIX, FixStatus.SINGLE, FixStatus.DIFFERENTIAL, ground], FixStatus.UNKNOWN).astype(np.int8)
