"""Kinds of tables and sentences: headers, units, marks, times and axes as loggers, spreadsheets and receivers write them."""

from pathlib import Path

import numpy as np

from navreplay.timeline import Floats
from synthetic_logs import SyntheticLog
from tests.field.promise import DRIVES
from tests.field.strangers.files import nmea, utc, write_table
from tests.field.strangers.judge import kind

__all__ = ["imu_columns"]

_G = 9.80665
_FT = 0.3048
_UNIX_EPOCH = np.datetime64("1970-01-01", "ns")


def _degrees(log: SyntheticLog) -> tuple[Floats, Floats, Floats]:
    assert log.fixes is not None
    lla = log.fixes.lla
    return np.degrees(lla[:, 0]), np.degrees(lla[:, 1]), lla[:, 2]


def _fixes(log: SyntheticLog) -> np.ndarray:
    """Unix nanoseconds of the fixes."""
    assert log.fixes is not None
    return utc(log.fixes.t_ns)


def _dates(t_ns: np.ndarray) -> np.ndarray:
    return _UNIX_EPOCH + t_ns.astype("timedelta64[ns]")


def imu_columns(log: SyntheticLog, turn: tuple[str, str, str], rate: float = 1.0, force: float = 1.0) -> list[Floats]:
    """Angular rates, then specific forces, in axes named by letters (f, b, r, l, u, d), multiplied."""
    places = {"f": (0, 1), "b": (0, -1), "r": (1, 1), "l": (1, -1), "d": (2, 1), "u": (2, -1)}
    return [
        series[:, places[letter][0]] * places[letter][1] * factor
        for series, factor in ((log.imu.gyro, rate), (log.imu.accel, force))
        for letter in turn
    ]


def _imu_table(log: SyntheticLog, path: Path) -> str:
    """An IMU as this program writes it, with Unix seconds."""
    names = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    values = np.round(np.column_stack(imu_columns(log, ("f", "r", "d"))), 7).T
    write_table(path, {"unix_ns": utc(log.imu.t_ns), **dict(zip(names, values, strict=True))})
    return path.name


def _repeated(log: SyntheticLog) -> np.ndarray:
    """For every IMU row the fix that is the latest then; -1 before the first."""
    assert log.fixes is not None
    return np.searchsorted(log.fixes.t_ns, log.imu.t_ns, side="right") - 1


@kind()
def phone_logger_semicolons(log: SyntheticLog, folder: Path) -> list[str]:
    """One table of a phone: g, deg/s, axes right-forward-up, the fix repeated in every row, decimal commas, milliseconds"""
    row = np.maximum(_repeated(log), 0)
    lat, lon, height = (values[row] for values in _degrees(log))
    names = ("Gyro X (deg/s)", "Gyro Y (deg/s)", "Gyro Z (deg/s)", "Accel X (g)", "Accel Y (g)", "Accel Z (g)")
    values = imu_columns(log, ("r", "f", "u"), np.degrees(1), 1 / _G)
    columns = {"timestamp (ms)": utc(log.imu.t_ns) // 10**6}
    columns |= {name: np.round(value, 6) for name, value in zip(names, values, strict=True)}
    columns |= {"Latitude": np.round(lat, 8), "Longitude": np.round(lon, 8), "Altitude (m)": np.round(height, 2)}
    write_table(folder / "phone.csv", columns, ";", comma=True)
    return ["phone.csv"]


@kind("town-rtk")
def headerless_board(log: SyntheticLog, folder: Path) -> list[str]:
    """A board's IMU without header (accelerations in g, deg/s, milliseconds of Unix), axes forward-left-up; fixes in a table"""
    values = [np.round(value, 5) for value in imu_columns(log, ("f", "l", "u"), np.degrees(1), 1 / _G)]
    order = [*values[3:], *values[:3], utc(log.imu.t_ns) // 10**6]
    write_table(folder / "imu.csv", {str(i): value for i, value in enumerate(order)}, header=False)
    lat, lon, height = _degrees(log)
    write_table(folder / "fix.csv", {"time_unix": _fixes(log) / 1e9, "lat": lat, "lon": lon, "alt": height})
    return ["imu.csv", "fix.csv"]


@kind()
def receiver_integers(log: SyntheticLog, folder: Path) -> list[str]:
    """u-blox integers as they come: 1e-7 degrees, millimetres, mm/s, hAcc in mm, week and iTOW"""
    assert log.fixes is not None
    lat, lon, height = _degrees(log)
    vel = np.rint(log.fixes.vel_n * 1000).astype(np.int64)
    ms = log.fixes.t_ns // 10**6
    columns = {"week": ms // 604_800_000, "iTOW": ms % 604_800_000}
    columns |= {"lat": np.rint(lat * 1e7).astype(np.int64), "lon": np.rint(lon * 1e7).astype(np.int64)}
    columns |= {
        "height": np.rint(height * 1000).astype(np.int64),
        "hAcc": np.full(len(ms), 2100),
        "vAcc": np.full(len(ms), 2500),
    }
    columns |= {"velN": vel[:, 0], "velE": vel[:, 1], "velD": vel[:, 2]}
    write_table(folder / "pvt.csv", columns)
    return [_imu_table(log, folder / "imu.csv"), "pvt.csv"]


@kind(said=("day first or month first", "time.day_first"), refused=True)
def american_am_pm(log: SyntheticLog, folder: Path) -> list[str]:
    """A spreadsheet: 3/5/2024 10:33:20.250 AM, height in feet by its header, speed in mph and heading"""
    assert log.fixes is not None
    lat, lon, height = _degrees(log)
    stamps = [str(value) for value in _dates(_fixes(log)).astype("datetime64[ms]")]
    cells = []
    for stamp in stamps:
        day, clock = stamp.split("T")
        year, month, date = day.split("-")
        hour = int(clock[:2])
        half = "AM" if hour < 12 else "PM"
        cells.append(f"{int(month)}/{int(date)}/{year} {(hour - 1) % 12 + 1}:{clock[3:]} {half}")
    vel = log.fixes.vel_n
    columns = {"Date Time (UTC)": cells, "Latitude (deg)": lat, "Longitude (deg)": lon, "Altitude (ft)": height / _FT}
    columns |= {
        "Speed (mph)": np.hypot(vel[:, 0], vel[:, 1]) * 2.2369363,
        "Heading (deg)": np.degrees(np.arctan2(vel[:, 1], vel[:, 0])) % 360,
    }
    write_table(folder / "track.csv", columns)
    return [_imu_table(log, folder / "imu.csv"), "track.csv"]


@kind("town-rtk", said=("hold variances",))
def variances_named_std(log: SyntheticLog, folder: Path) -> list[str]:
    """A table whose std columns hold variances: 2e-4 for 1.5 cm"""
    lat, lon, height = _degrees(log)
    n = len(lat)
    columns = {"unix_ns": _fixes(log), "lat": lat, "lon": lon, "height": height}
    columns |= {"std_n": np.full(n, 2.25e-4), "std_e": np.full(n, 2.25e-4), "std_d": np.full(n, 9e-4)}
    write_table(folder / "fix.csv", columns)
    return [_imu_table(log, folder / "imu.csv"), "fix.csv"]


_POWER_ON = 2**32 - 50_000_000
"""First count [us] of a board's counter that turns over 50 s later."""


@kind(shift=DRIVES["town"].journey.start_ns - 2087 * 604_800 * 10**9 - _POWER_ON * 1000)
def microseconds_that_roll_over(log: SyntheticLog, folder: Path) -> list[str]:
    """One table of a board: a 32-bit counter of microseconds from power-on rolls over in mid-log"""
    row = _repeated(log)
    lat, lon, height = (values[np.maximum(row, 0)] for values in _degrees(log))
    count = (utc(log.imu.t_ns) - utc(log.imu.t_ns[:1])[0]) // 1000 + _POWER_ON
    names = ("gx", "gy", "gz", "ax", "ay", "az")
    columns = {"micros": count % 2**32}
    columns |= {name: np.round(value, 6) for name, value in zip(names, imu_columns(log, ("f", "r", "d")), strict=True)}
    columns |= {"lat": lat, "lng": lon, "alt": height}
    write_table(folder / "board.csv", columns)
    return ["board.csv"]


@kind()
def side_mounted_x_up(log: SyntheticLog, folder: Path) -> list[str]:
    """An IMU on its side: x up, y backwards, z to the left"""
    names = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    values = imu_columns(log, ("u", "b", "r"))
    write_table(folder / "imu.csv", {"unix_ns": utc(log.imu.t_ns), **dict(zip(names, values, strict=True))})
    lat, lon, height = _degrees(log)
    write_table(folder / "fix.csv", {"unix_ns": _fixes(log), "lat": lat, "lon": lon, "height": height})
    return ["imu.csv", "fix.csv"]


@kind(said=("gravity",), refused=True)
def linear_acceleration_of_a_phone(log: SyntheticLog, folder: Path) -> list[str]:
    """Accelerations from which the phone took gravity, axes forward-left-up"""
    names = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    values = imu_columns(log, ("f", "l", "u"))
    values[5] = values[5] - _G
    write_table(folder / "imu.csv", {"unix_ns": utc(log.imu.t_ns), **dict(zip(names, values, strict=True))})
    lat, lon, height = _degrees(log)
    write_table(folder / "fix.csv", {"unix_ns": _fixes(log), "lat": lat, "lon": lon, "height": height})
    return ["imu.csv", "fix.csv"]


@kind("town-rtk", late=-0.0037)
def whole_seconds(log: SyntheticLog, folder: Path) -> list[str]:
    """Fixes at 5 Hz whose stamps were cut to whole seconds: five with each"""
    lat, lon, height = _degrees(log)
    write_table(folder / "fix.csv", {"unix": _fixes(log) // 10**9, "lat": lat, "lon": lon, "height": height})
    return [_imu_table(log, folder / "imu.csv"), "fix.csv"]


@kind()
def gps_seconds(log: SyntheticLog, folder: Path) -> list[str]:
    """Fixes with seconds since 1980 (GPS), IMU in Unix time"""
    assert log.fixes is not None
    lat, lon, height = _degrees(log)
    write_table(folder / "fix.csv", {"gps_time": log.fixes.t_ns / 1e9, "lat": lat, "lon": lon, "height": height})
    return [_imu_table(log, folder / "imu.csv"), "fix.csv"]


@kind()
def local_time_zone(log: SyntheticLog, folder: Path) -> list[str]:
    """ISO times with the zone +01:00, tabs between the fields"""
    lat, lon, height = _degrees(log)
    stamps = [f"{value}+01:00" for value in (_dates(_fixes(log)) + np.timedelta64(1, "h")).astype("datetime64[ms]")]
    write_table(folder / "fix.txt", {"time": stamps, "latitude": lat, "longitude": lon, "elevation": height}, "\t")
    return [_imu_table(log, folder / "imu.csv"), "fix.txt"]


@kind()
def hemispheres_as_letters(log: SyntheticLog, folder: Path) -> list[str]:
    """Latitude and longitude as 47.3769N and 8.5416E"""
    lat, lon, height = _degrees(log)
    columns = {"unix_ns": _fixes(log), "lat": [f"{value:.8f}N" for value in lat], "lon": [f"{value:.8f}E" for value in lon]}
    write_table(folder / "fix.csv", columns | {"height": height})
    return [_imu_table(log, folder / "imu.csv"), "fix.csv"]


def _clock(t_ns: int) -> str:
    stamp = str(_dates(np.array([t_ns]))[0].astype("datetime64[ms]"))
    return stamp[11:13] + stamp[14:16] + stamp[17:]


def _minutes(value: float, width: int) -> str:
    whole = int(abs(value))
    return f"{whole:0{width}d}{(abs(value) - whole) * 60:010.7f}"


def _sentences(log: SyntheticLog, weeks: int = 0, froze: tuple[float, float] = (0.0, 0.0)) -> list[str]:
    """RMC and GGA of every fix."""
    assert log.fixes is not None
    lat, lon, height = _degrees(log)
    t_ns, vel = _fixes(log), log.fixes.vel_n
    at = (t_ns - t_ns[0]) / 1e9
    held = int(np.searchsorted(at, froze[0])) - 1
    lines = []
    for i, now in enumerate(t_ns):
        k = held if froze[0] <= at[i] < froze[1] else i
        day = str(_dates(np.array([now - weeks * 604_800 * 10**9]))[0].astype("datetime64[D]"))
        place = f"{_minutes(lat[k], 2)},N,{_minutes(lon[k], 3)},E"
        speed, course = np.hypot(*vel[k, :2]) / 0.514444, np.degrees(np.arctan2(vel[k, 1], vel[k, 0])) % 360
        date = day[8:10] + day[5:7] + day[2:4]
        lines.append(nmea(f"GNRMC,{_clock(int(now))},A,{place},{speed:.3f},{course:.2f},{date},,,A"))
        lines.append(nmea(f"GNGGA,{_clock(int(now))},{place},1,12,0.8,{height[k] - 47:.2f},M,47.0,M,,"))
    return lines


@kind(said=("1024 weeks",))
def nmea_week_rollover(log: SyntheticLog, folder: Path) -> list[str]:
    """NMEA of a receiver whose date is 1024 weeks back, beside an IMU with the right one"""
    (folder / "log.nmea").write_text("\r\n".join(_sentences(log, 1024)) + "\r\n")
    return [_imu_table(log, folder / "imu.csv"), "log.nmea"]


@kind(said=("repeat",), alone=((50.0, 62.0),))
def nmea_frozen(log: SyntheticLog, folder: Path) -> list[str]:
    """NMEA whose position, speed and course stay for 12 s while the time goes on"""
    (folder / "log.nmea").write_text("\r\n".join(_sentences(log, 0, (50.0, 62.0))) + "\r\n")
    return [_imu_table(log, folder / "imu.csv"), "log.nmea"]
