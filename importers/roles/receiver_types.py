"""Layouts of receivers and autopilots whose columns need no translation: what each can serve as.

Their readers deliver the columns of a text: ``gyro``, ``accel``, ``lla``, ``vel_n``, ``cov_pos``, ``cov_vel``, ``status``,
``q_nb``, ``cov_att``.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from importers.ublox.sensors import SENSOR_NOTE

__all__ = ["RECEIVER_TYPES", "ReceiverType"]


@dataclass(frozen=True, slots=True)
class ReceiverType:
    """roles: the first being the usual. note: told whenever it is used. automatic: whether it is used without being named.
    rank: among the automatic ones of a file the least is used. means: its IMU samples are means over their intervals."""

    roles: tuple[str, ...]
    note: str = ""
    automatic: bool = True
    rank: int = 0
    means: bool = False


_FIX = ("fix", "reference")
_OWN_FUSION = "the receiver's own fusion with its inertial sensor serves as the reference; it shares the fixes' errors"

RECEIVER_TYPES: Mapping[str, ReceiverType] = {
    "ubx/NAV-PVT": ReceiverType(_FIX),
    "ubx/NAV-HPPOSLLH": ReceiverType(_FIX, rank=1),
    "ubx/HNR-PVT": ReceiverType(("reference", "fix"), _OWN_FUSION),
    "ubx/NAV-ATT": ReceiverType(("attitude",), automatic=False),
    "ubx/ESF-RAW": ReceiverType(("imu",), SENSOR_NOTE),
    "ubx/ESF-MEAS": ReceiverType(("imu",), SENSOR_NOTE, rank=1),
}
