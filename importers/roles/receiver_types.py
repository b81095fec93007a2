"""Layouts of receivers, autopilots and trajectories whose columns need no translation: what each can serve as.

Their readers deliver the columns of a text: ``gyro``, ``accel``, ``lla``, ``vel_n``, ``cov_pos``, ``cov_vel``, ``status``,
``q_nb``, ``cov_att``.
"""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["RECEIVER_TYPES", "ReceiverType"]


@dataclass(frozen=True, slots=True)
class ReceiverType:
    """roles: the first being the usual. note: told whenever it is used. automatic: whether it is used without being named.
    rank: among the automatic ones of a file the least is used. means: its IMU samples are means over their intervals.
    axes: where those of its IMU point unless told otherwise."""

    roles: tuple[str, ...]
    note: str = ""
    automatic: bool = True
    rank: int = 0
    means: bool = False
    axes: str = "frd"


_FIX = ("fix", "reference")
_SENSOR_NOTE = (
    "its samples are stamped by a clock of their own, which the order of the messages in the stream ties to GPS time to about "
    "0.1 s; input.imu.time_offset_s corrects the rest"
)
_BOOT_NOTE = (
    "the autopilot's clock is set by the fixes of the smallest delay; their remaining delay (about 0.1 s) is an offset of the "
    "IMU against the fixes, which input.imu.time_offset_s corrects"
)
_HEIGHT_NOTE = (
    "ArduPilot logs heights above mean sea level; input.fix.height = 'msl' with input.fix.geoid_separation_m makes them "
    "ellipsoidal"
)
_CASE_NOTE = (
    "the axes of the IMU are taken as right, forward, up, as SPAN's vehicle frame; input.imu.axes says how it is mounted where "
    "it is not so"
)
_GPX_NOTE = (
    "GPX holds no accuracies and no velocities; its heights are taken as they are, which is above mean sea level as a rule "
    "(input.fix.height = 'msl' with input.fix.geoid_separation_m)"
)
_OWN_FILTER = "the autopilot's own filter serves as the reference; it shares the sensors"
_OWN_FUSION = "the receiver's own fusion with its inertial sensor serves as the reference; it shares the fixes' errors"

RECEIVER_TYPES: Mapping[str, ReceiverType] = {
    "ubx/NAV-PVT": ReceiverType(_FIX),
    "ubx/NAV-HPPOSLLH": ReceiverType(_FIX, rank=2),
    "ubx/NAV-POSLLH": ReceiverType(_FIX, rank=1),
    "ubx/HNR-PVT": ReceiverType(("reference", "fix"), _OWN_FUSION),
    "ubx/NAV-ATT": ReceiverType(("attitude",), automatic=False),
    "ubx/HNR-ATT": ReceiverType(("attitude",), automatic=False),
    "ubx/ESF-RAW": ReceiverType(("imu",), _SENSOR_NOTE),
    "ulog/sensor_combined": ReceiverType(("imu",), _BOOT_NOTE, means=True),
    "ulog/vehicle_imu": ReceiverType(("imu",), _BOOT_NOTE, rank=1, means=True),
    "ulog/vehicle_imu/spare": ReceiverType(("imu",), _BOOT_NOTE, automatic=False, means=True),
    "ulog/vehicle_gps_position": ReceiverType(_FIX),
    "ulog/sensor_gps": ReceiverType(_FIX, rank=1),
    "ulog/sensor_gps/spare": ReceiverType(_FIX, automatic=False),
    "ulog/vehicle_global_position": ReceiverType(("reference",), _OWN_FILTER),
    "ulog/vehicle_attitude": ReceiverType(("attitude",), automatic=False),
    "dataflash/IMU": ReceiverType(("imu",), _BOOT_NOTE),
    "dataflash/IMU/spare": ReceiverType(("imu",), _BOOT_NOTE, automatic=False),
    "dataflash/GPS": ReceiverType(_FIX, _HEIGHT_NOTE),
    "dataflash/GPS/spare": ReceiverType(_FIX, _HEIGHT_NOTE, automatic=False),
    "dataflash/POS": ReceiverType(("reference",), _OWN_FILTER),
    "novatel/BESTGNSSPOS": ReceiverType(_FIX),
    "novatel/BESTPOS": ReceiverType(_FIX, rank=1),
    "novatel/PSRPOS": ReceiverType(_FIX, rank=2),
    "novatel/BESTGNSSVEL": ReceiverType(("velocity",)),
    "novatel/BESTVEL": ReceiverType(("velocity",), rank=1),
    "novatel/PSRVEL": ReceiverType(("velocity",), rank=2),
    "novatel/RAWIMUSX": ReceiverType(("imu",), _CASE_NOTE, means=True, axes="rfu"),
    "novatel/RAWIMUX": ReceiverType(("imu",), _CASE_NOTE, rank=1, means=True, axes="rfu"),
    "novatel/RAWIMUS": ReceiverType(("imu",), rank=2),
    "novatel/RAWIMU": ReceiverType(("imu",), rank=3),
    "novatel/INSPVAX": ReceiverType(("reference",), _OWN_FUSION),
    "novatel/INSPVA": ReceiverType(("reference",), _OWN_FUSION, rank=1),
    "novatel/INSPVAS": ReceiverType(("reference",), _OWN_FUSION, rank=2),
    "sbf/PVTGeodetic": ReceiverType(_FIX),
    "sbf/ExtSensorMeas": ReceiverType(("imu",)),
    "sbf/INSNavGeod": ReceiverType(("reference",), _OWN_FUSION),
    "gpx": ReceiverType(_FIX, _GPX_NOTE, rank=3),
    "sbet": ReceiverType(("reference",)),
    "ubx/ESF-MEAS": ReceiverType(("imu",), _SENSOR_NOTE, rank=1),
}
