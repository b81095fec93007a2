"""Kinds of recordings: messages filled, stamped and named as drivers do it."""

from pathlib import Path
from typing import Any

import numpy as np

from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.timeline import Floats
from synthetic_logs import SyntheticLog, truth_at
from tests.field.strangers.files import Message, fix_message, imu_message, twist_message, utc, write_bag, write_json, write_ros
from tests.field.strangers.judge import kind
from tests.field.strangers.tables import imu_columns

_G = 9.80665
_FT = 0.3048
_IMU, _FIX, _TWIST = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "geometry_msgs/msg/TwistStamped"


def _imu(
    log: SyntheticLog, axes: str = "flu", rate: float = 1.0, force: float = 1.0, moved: Any = None, topic: str = "/imu/data"
) -> list[Message]:
    """moved: nanoseconds (n,) that the stamps, but not the recorder's clock, are moved by."""
    values = np.column_stack(imu_columns(log, (axes[0], axes[1], axes[2]), rate, force))
    t_ns = utc(log.imu.t_ns)
    stamps = t_ns if moved is None else t_ns + moved
    return [
        (topic, _IMU, int(t), imu_message(int(stamp), row[:3], row[3:]))
        for t, stamp, row in zip(t_ns, stamps, values, strict=True)
    ]


def _lla(log: SyntheticLog) -> Floats:
    assert log.fixes is not None
    return log.fixes.lla * [180 / np.pi, 180 / np.pi, 1.0]


def _fixes(
    log: SyntheticLog, lla: Floats, variances: tuple[float, ...] | None = None, moved: Any = None, topic: str = "/fix"
) -> list[Message]:
    assert log.fixes is not None
    t_ns = utc(log.fixes.t_ns)
    stamps = t_ns if moved is None else t_ns + moved
    own = np.diagonal(log.fixes.cov_pos, axis1=1, axis2=2)
    return [
        (topic, _FIX, int(t), fix_message(int(stamp), row, variances or cov))
        for t, stamp, row, cov in zip(t_ns, stamps, lla, own, strict=True)
    ]


def _ddmm(values: Floats) -> Floats:
    whole = np.trunc(values)
    return whole * 100 + (values - whole) * 60


@kind(said=("radians",))
def navsatfix_in_radians(log: SyntheticLog, folder: Path) -> list[str]:
    """NavSatFix whose latitude and longitude are radians"""
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, _lla(log) * [np.pi / 180, np.pi / 180, 1]))
    return ["log.mcap"]


@kind(said=("minutes",))
def navsatfix_degrees_and_minutes(log: SyntheticLog, folder: Path) -> list[str]:
    """NavSatFix with the degrees and minutes of NMEA: 4722.614 for 47.3769"""
    lla = _lla(log)
    lla[:, :2] = _ddmm(lla[:, :2])
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, lla))
    return ["log.mcap"]


@kind(said=("1e-7",))
def navsatfix_in_1e7(log: SyntheticLog, folder: Path) -> list[str]:
    """LocationFix in JSON with the receiver's integers of 1e-7 degrees"""
    lla = _lla(log) * [1e7, 1e7, 1]
    fixes = []
    for topic, _, t_ns, message in _fixes(log, lla):
        content = {"timestamp": {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}, "frame_id": "gps"}
        content |= {name: message[name] for name in ("latitude", "longitude", "altitude")}
        content |= {"position_covariance": message["position_covariance"].tolist(), "position_covariance_type": 2}
        fixes.append((topic, "foxglove.LocationFix", t_ns, content))
    imu = [(topic, "sensor_msgs/Imu", t_ns, _plain(message)) for topic, _, t_ns, message in _imu(log)]
    write_json(folder / "log.mcap", imu + fixes)
    return ["log.mcap"]


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


@kind(said=("exchanged",), refused=True)
def bag_swapped(log: SyntheticLog, folder: Path) -> list[str]:
    """ROS 1 bag whose latitude and longitude are exchanged"""
    write_bag(folder / "log.bag", _ros1(_imu(log) + _fixes(log, _lla(log)[:, [1, 0, 2]])))
    return ["log.bag"]


@kind(said=("sign",), refused=True)
def lost_south(log: SyntheticLog, folder: Path) -> list[str]:
    """A driver that lost the sign of the latitude"""
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, _lla(log) * [-1, 1, 1]))
    return ["log.mcap"]


def _ros1(messages: list[Message]) -> list[Message]:
    return [(topic, kind, t_ns, content) for topic, kind, t_ns, content in messages]


@kind("flight", said=("feet",))
def height_in_feet(log: SyntheticLog, folder: Path) -> list[str]:
    """A flight whose altitude is told in feet, beside velocities in metres per second"""
    assert log.fixes is not None
    vel = log.fixes.vel_n[:, [1, 0, 2]] * [1, 1, -1]
    twists = [
        ("/vel", _TWIST, int(t), twist_message(int(t), row, "enu")) for t, row in zip(utc(log.fixes.t_ns), vel, strict=True)
    ]
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, _lla(log) / [1, 1, _FT]) + twists)
    return ["log.mcap"]


@kind("town-rtk")
def square_millimetres(log: SyntheticLog, folder: Path) -> list[str]:
    """Covariances in square millimetres: 225 for 1.5 cm"""
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, _lla(log), (225.0, 225.0, 900.0)))
    return ["log.mcap"]


@kind("town-rtk", said=("hold standard deviations",))
def deviations_in_the_covariance(log: SyntheticLog, folder: Path) -> list[str]:
    """Standard deviations where variances belong: 0.015 for 1.5 cm"""
    write_ros(folder / "log.mcap", _imu(log) + _fixes(log, _lla(log), (0.015, 0.015, 0.03)))
    return ["log.mcap"]


@kind("town-positions")
def body_twist_in_a_bag(log: SyntheticLog, folder: Path) -> list[str]:
    """ROS 1 bag with a commanded TwistStamped in the vehicle's frame"""
    assert log.fixes is not None
    speed = np.einsum("kji,kj->ki", matrix_from_quat(truth_at(log.scenario.journey, log.fixes.t_ns).q_nb), _true_vel(log))
    twists = [
        ("/cmd_vel", _TWIST, int(t), twist_message(int(t), (1.1 * row[0], 0.0, 0.0), "base_link"))
        for t, row in zip(utc(log.fixes.t_ns), speed, strict=True)
    ]
    write_bag(folder / "log.bag", _ros1(_imu(log) + _fixes(log, _lla(log)) + twists))
    return ["log.bag"]


def _true_vel(log: SyntheticLog) -> Floats:
    assert log.fixes is not None
    return np.asarray(truth_at(log.scenario.journey, log.fixes.t_ns).vel_n)


@kind()
def imu_in_ned(log: SyntheticLog, folder: Path) -> list[str]:
    """Imu messages of a driver that left forward-right-down, in degrees and g"""
    write_ros(folder / "log.mcap", _imu(log, "frd", np.degrees(1), 1 / _G) + _fixes(log, _lla(log)))
    return ["log.mcap"]


@kind()
def imu_sideways(log: SyntheticLog, folder: Path) -> list[str]:
    """Imu messages whose y axis points up and whose x axis points to the right"""
    write_ros(folder / "log.mcap", _imu(log, "rub") + _fixes(log, _lla(log)))
    return ["log.mcap"]


@kind(said=("clock of its stamps was set",))
def clock_steps_back(log: SyntheticLog, folder: Path) -> list[str]:
    """Header stamps 2.5 s back from the middle on: the computer's clock was set, the recorder's went on"""
    assert log.fixes is not None
    when = utc(log.imu.t_ns[len(log.imu.t_ns) // 2 :][:1])[0]
    moved = [np.where(utc(t_ns) >= when, -2_500_000_000, 0) for t_ns in (log.imu.t_ns, log.fixes.t_ns)]
    write_ros(folder / "log.mcap", _imu(log, moved=moved[0]) + _fixes(log, _lla(log), moved=moved[1]))
    return ["log.mcap"]


@kind("town-rtk", late=0.25)
def late_and_jittering(log: SyntheticLog, folder: Path) -> list[str]:
    """Fixes at 5 Hz stamped on arrival, 0.2 to 0.3 s late"""
    assert log.fixes is not None
    rng = np.random.default_rng(4)
    late = rng.integers(200_000_000, 300_000_000, len(log.fixes.t_ns))
    write_bag(folder / "log.bag", _imu(log) + _fixes(log, _lla(log), moved=late))
    return ["log.bag"]


@kind(said=("2 channels can serve as fix: /front/fix", "--set input.fix.channel=/front/fix"), refused=True)
def two_receivers(log: SyntheticLog, folder: Path) -> list[str]:
    """Two receivers, of which one lost its fix after 40 s and tells NaN"""
    lla = _lla(log)
    worse = lla + np.random.default_rng(5).normal(0, 1, lla.shape) * [3 / 111e3, 3 / 75e3, 5]
    worse[40:] = np.nan
    write_ros(
        folder / "log.mcap",
        _imu(log) + _fixes(log, lla, topic="/front/fix") + _fixes(log, worse, (9.0, 9.0, 25.0), topic="/rear/fix"),
    )
    return ["log.mcap"]


@kind("town-rtk", alone=((30.0, 36.0),))
def nan_rows_and_gaps(log: SyntheticLog, folder: Path) -> list[str]:
    """NaN in single gyro samples, positions NaN for 6 s, covariance NaN throughout"""
    lla = _lla(log)
    assert log.fixes is not None
    at = (log.fixes.t_ns - log.fixes.t_ns[0]) / 1e9
    lla[(at >= 30) & (at < 36)] = np.nan
    imu = _imu(log)
    for i in range(500, len(imu), 997):
        imu[i][3]["angular_velocity"]["y"] = float("nan")
    write_ros(folder / "log.mcap", imu + _fixes(log, lla, (np.nan, np.nan, np.nan)))
    return ["log.mcap"]


@kind()
def bursts_over_wifi(log: SyntheticLog, folder: Path) -> list[str]:
    """IMU stamps at arrival in bursts of 8 to 12 samples, a millisecond apart within each"""
    rng = np.random.default_rng(6)
    ends = np.cumsum(rng.integers(8, 13, len(log.imu.t_ns)))
    last = np.minimum(ends[np.searchsorted(ends, np.arange(len(log.imu.t_ns)))], len(log.imu.t_ns) - 1)
    t_ns = utc(log.imu.t_ns)
    place = np.arange(len(t_ns)) - last
    stamps = t_ns[last] + place * 1_000_000
    imu = [
        (topic, kind, int(stamp), m) for (topic, kind, _, m), stamp in zip(_imu(log, moved=stamps - t_ns), stamps, strict=True)
    ]
    write_ros(folder / "log.mcap", imu + _fixes(log, _lla(log)))
    return ["log.mcap"]
