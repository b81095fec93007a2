"""One drive in the stream of every receiver and autopilot with an IMU: the same samples and fixes, without any setting."""

import struct
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from pysbf2 import SBFMessage
from pyubx2 import GET, UBXMessage

from importers import load_timeline
from navreplay.geodesy.time_scales import utc_from_gps, week_tow_from_gps
from navreplay.timeline import Floats, GnssFixSeries
from synthetic_logs import SCENARIOS, simulate, with_duration
from tests.importers.autopilots import test_ardupilot as ardupilot
from tests.importers.autopilots import test_px4 as px4
from tests.importers.novatel import test_stream as novatel
from tests.importers.septentrio import test_stream as sbf
from tests.importers.ublox import test_navigation as ublox

LOG = simulate(with_duration(SCENARIOS["car-outages"], 20.0), 3)
assert LOG.fixes is not None
FIXES: GnssFixSeries = LOG.fixes
START_NS = int(min(LOG.imu.t_ns[0], FIXES.t_ns[0]))
_WEEKS, _TOWS = week_tow_from_gps(np.array([START_NS]))
WEEK, TOW_S = int(_WEEKS[0]), float(_TOWS[0])
UTC_US = int(utc_from_gps(np.array([START_NS]))[0]) // 1000
IMU_S, FIX_S = (LOG.imu.t_ns - START_NS) / 1e9, (FIXES.t_ns - START_NS) / 1e9
STD_M = np.sqrt(np.diagonal(FIXES.cov_pos, axis1=1, axis2=2))
STD_MPS = np.sqrt(np.diagonal(FIXES.cov_vel, axis1=1, axis2=2))
DEGREES = np.degrees(FIXES.lla[:, :2])
SAMPLES = list(zip(IMU_S, LOG.imu.gyro, LOG.imu.accel, strict=True))
ROWS = list(zip(FIX_S, DEGREES, FIXES.lla[:, 2], FIXES.vel_n, STD_M, STD_MPS, strict=True))
SPEED, COURSE = np.hypot(*FIXES.vel_n[:, :2].T), np.degrees(np.arctan2(*FIXES.vel_n[:, 1::-1].T)) % 360


def in_turn(parts: Iterable[tuple[float, object]]) -> list[object]:
    return [part for _, part in sorted(parts, key=lambda part: part[0])]


def joined(parts: Iterable[tuple[float, bytes]]) -> bytes:
    return b"".join(part for part in in_turn(parts) if isinstance(part, bytes))


def boot(t: float) -> int:
    return 5_000_000 + round(t * 1e6)


def as_ulog() -> bytes:
    parts = [(t, ("sensor_combined", (boot(t), *gyro, 10_000, 0, *accel, 0))) for t, gyro, accel in SAMPLES]
    for t, place, height, vel, std, std_v in ROWS:
        stamps = (boot(t), UTC_US + round(t * 1e6), *np.rint(place * 1e7).astype(int), *[round(height * 1e3)] * 2)
        parts.append((t, ("vehicle_gps_position", (*stamps, std_v[0], std[0], std[2], *vel, 0, 3, True))))
    return px4.ulog(in_turn(parts), ("sensor_combined", "vehicle_gps_position"))


def as_dataflash() -> bytes:
    parts = [(t, ("IMU", (boot(t), 0, *gyro, *accel, 0, 0, 40.0, 1, 1, 1000, 1000))) for t, gyro, accel in SAMPLES]
    for (t, place, height, vel, std, std_v), speed, course in zip(ROWS, SPEED, COURSE, strict=True):
        where = (*np.rint(place * 1e7).astype(int), round(height * 100))
        fix = (boot(t), 0, 3, round((TOW_S + t) * 1000), WEEK, 17, 80, *where, speed, course, vel[2], 0.0, 1)
        accuracies = (round(std[0] * 100), round(std[2] * 100), round(std_v[0] * 100))
        parts += [(t, ("GPS", fix)), (t, ("GPA", (boot(t), 0, 120, *accuracies, 0.0, 1, 0, 0)))]
    return ardupilot.dataflash(in_turn(parts))


def as_novatel() -> bytes:
    """Increments of an STIM300 at its rate, along right, forward, up."""
    rate = 1 / np.median(np.diff(IMU_S))
    to_case = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    parts = []
    for t, gyro, accel in SAMPLES:
        turn, force = np.degrees(to_case @ gyro) / rate * 2**21, to_case @ accel / rate * 2**22
        counts = np.rint([force[2], -force[1], force[0], turn[2], -turn[1], turn[0]]).astype(int)
        parts.append((t, novatel.binary(1462, struct.pack("<BBHdI6i", 0, 32, WEEK, TOW_S + t, 0, *counts), t, short=True)))
    for (t, place, height, vel, std, _), speed, course in zip(ROWS, SPEED, COURSE, strict=True):
        position = (0, 16, *place, height, 0.0, 61, *std, b"", 0.0, 0.0, *[24] * 4, *[0] * 4)
        parts.append((t, novatel.binary(42, struct.pack("<IIdddfIfff4sffBBBBBBBB", *position), t)))
        parts.append((t, novatel.binary(99, struct.pack("<IIffdddf", 0, 16, 0.0, 0.0, speed, course, -vel[2], 0.0), t)))
    return joined(parts)


def as_sbf() -> bytes:
    parts = []
    for t, gyro, accel in SAMPLES:
        rates = struct.pack("<BBBB3d", 0, 1, 1, 0, *np.degrees(gyro))
        parts.append((t, sbf.block(4050, b"\x02\x1c" + struct.pack("<BBBB3d", 0, 1, 0, 0, *accel) + rates, t)))
    for (t, _, height, vel, std, std_v), lla in zip(ROWS, FIXES.lla, strict=True):
        told = {"Latitude": lla[0], "Longitude": lla[1], "Height": height, "Vn": vel[0], "Ve": vel[1], "Vu": -vel[2], "Type": 1}
        position = {f"Cov_{name}": value**2 for name, value in zip(("latlat", "lonlon", "hgthgt"), std, strict=True)}
        velocity = {f"Cov_{name}": value**2 for name, value in zip(("VnVn", "VeVe", "VuVu"), std_v, strict=True)}
        parts.append((t, sbf.pvt(t, **told)))
        parts.append((t, SBFMessage("PosCovGeodetic", **sbf.stamp(t), **position).serialize()))
        parts.append((t, SBFMessage("VelCovGeodetic", **sbf.stamp(t), **velocity).serialize()))
    return joined(parts)


def as_ubx() -> bytes:
    ticks, gyro, accel = np.rint(IMU_S / 39e-6).astype(np.int64), np.degrees(LOG.imu.gyro), LOG.imu.accel
    parts = list(zip(IMU_S, ublox.esf(ticks, gyro, accel, raw=True), strict=True))
    for t, place, height, vel, std, std_v in ROWS:
        date = datetime.fromtimestamp(UTC_US // 10**6, UTC) + timedelta(microseconds=UTC_US % 10**6 + round(t * 1e6))
        names = ("year", "month", "day", "hour", "min", "second")
        fields = dict(zip(names, date.timetuple()[:6], strict=True)) | {"validDate": 1, "validTime": 1, "fixType": 3}
        fields |= {"iTOW": round((TOW_S + t) * 1000), "nano": date.microsecond * 1000, "gnssFixOk": 1, "lat": place[0]}
        fields |= {"lon": place[1], "height": round(height * 1e3), "hAcc": round(std[0] * 1e3), "vAcc": round(std[2] * 1e3)}
        fields |= {name: round(value * 1e3) for name, value in zip(("velN", "velE", "velD"), vel, strict=True)}
        parts.append((t, UBXMessage("NAV", "NAV-PVT", GET, sAcc=round(std_v[0] * 1e3), **fields).serialize()))
    return joined(parts)


STREAMS = {
    "px4.ulg": (as_ulog, 1e-6, 0.0),
    "ardupilot.bin": (as_dataflash, 1e-6, 0.0),
    "span.gps": (as_novatel, 1e-4, 0.0),
    "asterx.sbf": (as_sbf, 1e-9, 0.0),
    "f9r.ubx": (as_ubx, 1e-3, 0.2),
}
"""Of each, its maker, the resolution of its samples, and how well its IMU is known to be timed [s]."""


@pytest.mark.parametrize("name", list(STREAMS))
def test_every_stream_is_the_same_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    for module, key, value in (
        (novatel, "WEEK", WEEK),
        (novatel, "TOW", TOW_S),
        (sbf, "WEEK", WEEK),
        (sbf, "TOW_MS", TOW_S * 1000),
    ):
        monkeypatch.setattr(module, key, round(value) if key == "TOW_MS" else value)
    make, resolution, timing_s = STREAMS[name]
    (tmp_path / name).write_bytes(make())
    timeline = load_timeline([tmp_path / name])
    imu, fixes = timeline.imu, timeline.fixes
    assert imu is not None
    assert fixes is not None
    n = len(LOG.imu)
    assert len(imu) == n
    assert np.abs(imu.t_ns - LOG.imu.t_ns).max() < 1e3 + timing_s * 1e9
    np.testing.assert_allclose(imu.gyro, LOG.imu.gyro, atol=resolution, rtol=1e-6)
    np.testing.assert_allclose(imu.accel, LOG.imu.accel, atol=resolution, rtol=1e-6)
    place = fixes.has_position
    assert np.abs(fixes.t_ns[place] - FIXES.t_ns).max() < 1e6
    assert np.abs(distances(fixes.lla[place], FIXES.lla)).max() < 0.02
    np.testing.assert_allclose(fixes.vel_n[np.isfinite(fixes.vel_n).all(axis=1)], FIXES.vel_n, atol=6e-3)
    std = np.sqrt(np.diagonal(fixes.cov_pos[place], axis1=1, axis2=2))
    np.testing.assert_allclose(std, STD_M, atol=6e-3)  # ArduPilot logs centimetres
    balanced = [use.read == use.used + sum(use.rejected.values()) for use in timeline.provenance.channels]
    assert all(balanced)


def distances(a: Floats, b: Floats) -> Floats:
    """North, east, down (n, 3) [m] between near positions."""
    return (a - b) * np.column_stack([np.full(len(a), 6.37e6), 6.37e6 * np.cos(a[:, 0]), np.ones(len(a))])
