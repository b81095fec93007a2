"""The receiver's own fixes, attitudes and inertial sensor in a UBX stream, against messages that pyubx2 writes."""

from pathlib import Path

import numpy as np
import pytest
from pyubx2 import GET, UBXMessage, UBXReader

from importers import LogError, load_timeline, open_log
from importers.rows.log import Table
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import FixStatus
from tests.helpers.paths import DATA

START_UTC_S = 1_700_000_000  # 2023-11-14 22:13:20
START_TOW_MS = 252_818_000
START_NS = int(gps_from_utc(np.array([START_UTC_S * 10**9]))[0])


def pvt(t: float, **other: object) -> bytes:
    """NAV-PVT of a vehicle that drives north-east with 3, 4, -0.5 m/s, RTK fixed."""
    whole = int(t)
    date = {"year": 2023, "month": 11, "day": 14, "hour": 22, "min": 13 + (20 + whole) // 60, "second": (20 + whole) % 60}
    fields = {
        "iTOW": START_TOW_MS + round(1000 * t),
        "validDate": 1,
        "validTime": 1,
        "nano": round((t - whole) * 1e9),
        "fixType": 3,
        "gnssFixOk": 1,
        "diffSoln": 1,
        "carrSoln": 2,
        "lat": 48.2 + 3 * t / 111_200,
        "lon": 11.6 + 4 * t / 74_200,
        "height": 545_123,
        "hMSL": 499_000,
        "hAcc": 20,
        "vAcc": 30,
        "velN": 3000,
        "velE": 4000,
        "velD": -500,
        "sAcc": 100,
    }
    return UBXMessage("NAV", "NAV-PVT", GET, **(date | fields | other)).serialize()


def read(path: Path, stream: bytes, name: str) -> Table:
    path.write_bytes(stream)
    return open_log(path).read((name,))[name]


def test_a_solution_has_position_velocity_accuracies_and_status(tmp_path: Path) -> None:
    table = read(tmp_path / "a.ubx", pvt(0.0) + pvt(0.25), "NAV-PVT")
    columns = table.columns
    assert columns["t_gps_ns"].tolist() == [START_NS, START_NS + 250_000_000]
    np.testing.assert_allclose(np.degrees(columns["lla"][0, :2]), [48.2, 11.6], atol=1e-9)
    assert columns["lla"][0, 2] == pytest.approx(545.123)
    assert columns["vel_n"][0].tolist() == [3.0, 4.0, -0.5]
    np.testing.assert_allclose(np.sqrt(np.diagonal(columns["cov_pos"][0])), [0.02, 0.02, 0.03])
    np.testing.assert_allclose(np.sqrt(np.diagonal(columns["cov_vel"][0])), 0.1)
    assert columns["status"].tolist() == [FixStatus.FIXED] * 2


@pytest.mark.parametrize(
    ("fields", "status"),
    [
        ({"carrSoln": 1}, FixStatus.FLOAT),
        ({"carrSoln": 0}, FixStatus.DIFFERENTIAL),
        ({"carrSoln": 0, "diffSoln": 0}, FixStatus.SINGLE),
        ({"fixType": 1}, FixStatus.DEAD_RECKONING),
        ({"fixType": 4}, FixStatus.FIXED),
        ({"fixType": 5}, -1),
        ({"gnssFixOk": 0}, -1),
    ],
)
def test_kinds_of_fix(tmp_path: Path, fields: dict[str, object], status: int) -> None:
    assert read(tmp_path / "a.ubx", pvt(0.0, **fields), "NAV-PVT").columns["status"].tolist() == [status]


def test_solutions_without_a_date_are_counted(tmp_path: Path) -> None:
    table = read(tmp_path / "a.ubx", pvt(0.0, validDate=0) + pvt(1.0, invalidLlh=1), "NAV-PVT")
    assert (table.read, dict(table.rejected)) == (2, {"no date yet": 1})
    assert np.isnan(table.columns["lla"]).all()


def test_leap_seconds_that_the_receiver_does_not_know_yet_move_nothing(tmp_path: Path) -> None:
    """Before it is told, a receiver's UTC is off by whole seconds; its time of week is not."""
    table = read(tmp_path / "a.ubx", pvt(0.0, second=22) + pvt(1.0), "NAV-PVT")
    assert table.columns["t_gps_ns"].tolist() == [START_NS, START_NS + 10**9]


def test_precise_positions_and_covariances_of_the_epoch_take_precedence(tmp_path: Path) -> None:
    place = {"lat": 48.2000001, "lon": 11.6, "height": 545_123, "_HPlat": 3.1e-8, "_HPheight": 0.4}
    precise = UBXMessage("NAV", "NAV-HPPOSLLH", GET, iTOW=START_TOW_MS, hAcc=12.0, vAcc=15.0, **place)
    of_velocity = {"velCovNN": 0.04, "velCovNE": 0.01, "velCovEE": 0.09, "velCovDD": 0.16}
    covariance = UBXMessage("NAV", "NAV-COV", GET, iTOW=START_TOW_MS, posCovValid=0, velCovValid=1, **of_velocity)
    table = read(tmp_path / "a.ubx", pvt(0.0) + precise.serialize() + covariance.serialize() + pvt(1.0), "NAV-PVT")
    stated = UBXReader.parse(precise.serialize())
    assert np.degrees(table.columns["lla"][0, 0]) == pytest.approx(stated.lat, abs=1e-10)
    assert table.columns["lla"][0, 2] == pytest.approx(stated.height / 1e3, abs=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diagonal(table.columns["cov_pos"][0])), [0.012, 0.012, 0.015])
    np.testing.assert_allclose(table.columns["cov_vel"][0], [[0.04, 0.01, 0], [0.01, 0.09, 0], [0, 0, 0.16]], rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diagonal(table.columns["cov_pos"][1])), [0.02, 0.02, 0.03])


def test_receivers_before_nav_pvt_are_read(tmp_path: Path) -> None:
    def epoch(t: int) -> bytes:
        tow = {"iTOW": START_TOW_MS + 1000 * t}
        place = {"lat": 48.2, "lon": 11.6, "height": 545_123, "hAcc": 900, "vAcc": 1500}
        state = {"week": 2288, "gpsFix": 3, "gpsfixOK": 1, "wknSet": 1, "towSet": 1, "diffSoln": t}
        messages = [UBXMessage("NAV", "NAV-POSLLH", GET, **tow, **place), UBXMessage("NAV", "NAV-SOL", GET, **tow, **state)]
        messages.append(UBXMessage("NAV", "NAV-VELNED", GET, **tow, velN=300, velE=400, velD=-50, sAcc=20))
        return b"".join(message.serialize() for message in messages)

    columns = read(tmp_path / "a.ubx", epoch(0) + epoch(1), "NAV-POSLLH").columns
    assert columns["t_gps_ns"].tolist() == [START_NS, START_NS + 10**9]
    np.testing.assert_allclose(columns["vel_n"], [[3.0, 4.0, -0.5]] * 2)
    np.testing.assert_allclose(np.sqrt(np.diagonal(columns["cov_pos"][0])), [0.9, 0.9, 1.5])
    np.testing.assert_allclose(np.sqrt(np.diagonal(columns["cov_vel"][0])), 0.2)
    assert columns["lla"][0, 2] == pytest.approx(545.123)
    assert columns["status"].tolist() == [FixStatus.SINGLE, FixStatus.DIFFERENTIAL]


def esf(ticks: np.ndarray, gyro_dps: np.ndarray, accel: np.ndarray, raw: bool) -> list[bytes]:
    """Messages of the inertial sensor as they stand in the stream, hand-packed: three gyro and three accelerometer data."""
    messages = []
    for tick, turn, force in zip(ticks.tolist(), gyro_dps, accel, strict=True):
        pairs = [*zip((14, 13, 5), np.rint(turn * 2**12), strict=True), *zip((16, 17, 18), np.rint(force * 2**10), strict=True)]
        words = [(int(value) & 0xFFFFFF) | kind << 24 for kind, value in pairs]
        stamp = (int(tick) % 2**32).to_bytes(4, "little")
        if raw:
            payload = b"\0" * 4 + b"".join(word.to_bytes(4, "little") + stamp for word in words)
        else:
            payload = stamp + bytes([0, len(words) << 3, 0, 0]) + b"".join(word.to_bytes(4, "little") for word in words)
        body = bytes([0x10, 3 if raw else 2]) + len(payload).to_bytes(2, "little") + payload
        first = second = 0
        for byte in body:
            first = (first + byte) % 256
            second = (second + first) % 256
        messages.append(b"\xb5\x62" + body + bytes([first, second]))
    return messages


def stream(raw: bool, tick_s: float, seconds: int = 60, rate: int = 50) -> tuple[bytes, np.ndarray, np.ndarray, np.ndarray]:
    """A minute of sensor and fixes; each fix stands 60 ms late in the stream. Times of the samples [s], rates, forces."""
    t = np.arange(seconds * rate) / rate + 0.003
    gyro = np.column_stack([0.1 * np.sin(t), 0.2 * np.cos(t), -3 + t / 50])
    accel = np.column_stack([np.sin(t / 3), 0 * t + 0.2, 9.81 + 0 * t])
    ticks = np.rint(t / tick_s).astype(np.int64) + 2**32 - round(20 / tick_s)
    parts = [(time, message) for time, message in zip(t, esf(ticks, gyro, accel, raw), strict=True)]
    parts += [(second + 0.06, pvt(second)) for second in range(seconds)]
    return b"".join(message for _, message in sorted(parts, key=lambda part: part[0])), t, gyro, accel


@pytest.mark.parametrize(("raw", "tick_s"), [(True, 39e-6), (False, 1e-3)])
def test_the_sensor_is_tied_to_gps_time_by_the_order_of_messages(tmp_path: Path, raw: bool, tick_s: float) -> None:
    data, t, gyro, accel = stream(raw, tick_s)
    table = read(tmp_path / "a.ubx", data, "ESF-RAW" if raw else "ESF-MEAS")
    np.testing.assert_allclose(np.degrees(table.columns["gyro"]), gyro, atol=2**-12)
    np.testing.assert_allclose(table.columns["accel"], accel, atol=2**-10)
    off_s = (table.columns["t_gps_ns"] - START_NS) / 1e9 - t
    assert np.abs(off_s + 0.06).max() < 0.05  # the delay of the fixes remains
    assert np.ptp(off_s) < 0.02


def test_a_stream_with_a_sensor_is_a_whole_drive(tmp_path: Path) -> None:
    (tmp_path / "a.ubx").write_bytes(stream(True, 39e-6)[0])
    timeline = load_timeline([tmp_path / "a.ubx"])
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert len(timeline.fixes) == 60
    assert any("ties to GPS time to about 0.1 s" in note for note in timeline.provenance.assumptions)


def test_a_sensor_without_fixes_says_what_it_lacks(tmp_path: Path) -> None:
    t = np.arange(100.0)
    (tmp_path / "a.ubx").write_bytes(b"".join(esf(t, np.zeros((100, 3)), np.zeros((100, 3)), True)))
    with pytest.raises(LogError, match="ESF-RAW has ticks but no time"):
        load_timeline([tmp_path / "a.ubx"])


@pytest.mark.parametrize("group", ["NAV", "HNR"])
def test_attitudes_are_dated_by_the_fixes(tmp_path: Path, group: str) -> None:
    angles = {"roll": 1.5, "pitch": -2.5, "heading": 123.4, "accRoll": 0.5, "accPitch": 0.6, "accHeading": 2.0}
    known = UBXMessage(group, f"{group}-ATT", GET, iTOW=START_TOW_MS + 500, **angles)
    unknown = UBXMessage(group, f"{group}-ATT", GET, iTOW=START_TOW_MS + 1500, roll=0.0, pitch=0.0, heading=10.0)
    table = read(tmp_path / "a.ubx", pvt(0.0) + known.serialize() + pvt(1.0) + unknown.serialize(), f"{group}-ATT")
    assert table.columns["t_gps_ns"].tolist() == [START_NS + 500_000_000, START_NS + 1_500_000_000]
    np.testing.assert_allclose(np.degrees(euler_from_quat(table.columns["q_nb"][:1])[0]), [1.5, -2.5, 123.4], atol=2e-5)
    np.testing.assert_allclose(np.degrees(np.sqrt(np.diagonal(table.columns["cov_att"][0]))), [0.6, 0.6, 2.0], atol=2e-5)
    assert np.isnan(table.columns["q_nb"][1]).all()


def test_nmea_and_late_measurements_of_a_stream_are_both_there(tmp_path: Path) -> None:
    gga = b"$GNGGA,221321.00,4812.00000,N,01136.00000,E,1,12,0.9,499.0,M,46.0,M,,*"
    rmc = b"$GNRMC,221321.00,A,4812.00000,N,01136.00000,E,0.0,,141123,,,A*"
    sentences = []
    for body in (gga, rmc):
        parity = 0
        for byte in body[1:-1]:
            parity ^= byte
        sentences.append(body + b"%02X\r\n" % parity)
    sample = (DATA / "walk_0827.ubx").read_bytes()
    (tmp_path / "a.ubx").write_bytes(b"".join(sentences) * 200 + b"\xb5\x62\x05" + sample)
    log = open_log(tmp_path / "a.ubx")
    assert log.format == "ubx"
    assert [channel.name for channel in log.channels()][-1] == "NMEA"
    assert len(log.read(("NMEA",))["NMEA"].columns["t_gps_ns"]) == 200
    timeline = load_timeline([tmp_path / "a.ubx"])
    assert timeline.ranges is not None
