"""SBF: blocks that pysbf2 writes, others packed by hand, and whole drives."""

import binascii
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pysbf2 import SBFMessage

from importers import LogError, load_timeline, open_log
from importers.rows.log import Table
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import FixStatus
from synthetic_logs import SCENARIOS, simulate, with_duration, write

WEEK, TOW_MS = 2288, 252_818_000
START_NS = int(gps_from_week_tow(WEEK, np.array([TOW_MS / 1000]))[0])


def stamp(t: float) -> dict[str, int]:
    return {"TOW": TOW_MS + round(1000 * t), "WNc": WEEK}


def pvt(t: float, **other: object) -> bytes:
    fields = {"Type": 4, "Latitude": np.radians(50.9), "Longitude": np.radians(4.7), "Height": 121.5, "Vn": 1.5, "Ve": -2.5}
    accuracies = {"Vu": 0.25, "HAccuracy": 0.08, "VAccuracy": 0.1}
    return SBFMessage("PVTGeodetic", **(stamp(t) | fields | accuracies | other)).serialize()


def covariances(t: float) -> bytes:
    position = {
        "Cov_latlat": 4e-4,
        "Cov_lonlon": 9e-4,
        "Cov_hgthgt": 16e-4,
        "Cov_latlon": 1e-4,
        "Cov_lathgt": 2e-4,
        "Cov_lonhgt": 3e-4,
    }
    velocity = {"Cov_VnVn": 0.01, "Cov_VeVe": 0.02, "Cov_VuVu": 0.03, "Cov_VnVu": 0.001}
    both = SBFMessage("PosCovGeodetic", **stamp(t), **position), SBFMessage("VelCovGeodetic", **stamp(t), **velocity)
    return b"".join(block.serialize() for block in both)


def block(number: int, content: bytes, t: float) -> bytes:
    return block_at(number, content, WEEK, TOW_MS + round(1000 * t))


def block_at(number: int, content: bytes, week: int, tow_ms: int) -> bytes:
    body = struct.pack("<IH", tow_ms, week) + content
    body += bytes(-(len(body)) % 4)
    rest = struct.pack("<HH", number, len(body) + 8) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(rest, 0)) + rest


def sensor(t: float) -> bytes:
    """1, 2, -9.8 m/s^2 and 5, 6, 7 deg/s, with the temperature between them."""
    parts = struct.pack("<BBBB3d", 0, 1, 0, 0, 1.0, 2.0, -9.8) + struct.pack("<BBBBh22x", 0, 1, 3, 0, 4000)
    return block(4050, b"\x03\x1c" + parts + struct.pack("<BBBB3d", 0, 1, 1, 0, 5.0, 6.0, 7.0), t)


def inertial(t: float) -> bytes:
    head = struct.pack("<BBHHdddfHHBBH", 4, 0, 0, 0, np.radians(50.9), np.radians(4.7), 121.5, 43.0, 10, 0, 0, 0, 0b1011)
    return block(4226, head + struct.pack("<3f3f3f", 0.02, 0.03, 0.04, 80.0, -2.0, 1.0, -2.5, 1.5, 0.25), t)


def main_signal(svid: int, kind: int, code: int, others: int = 0, info: int = 0) -> bytes:
    values = (0, kind, svid, code >> 32, code & 0xFFFFFFFF, -10_000_000, 0, 0, 140, 10, info, others)
    return struct.pack("<BBBBIiHbBHBB", *values) + bytes(12 * others)


def measurements(t: float) -> bytes:
    signals = [
        main_signal(5, 0, 21_000_000_123),
        main_signal(40, 8, 22_000_000_000, 2, 12 << 3),
        main_signal(81, 17, 23_000_000_000, 1),
    ]
    signals += [main_signal(151, 28, 36_000_000_000), main_signal(182, 31, 37_000_000_000, 0, 0)]
    return block(4027, struct.pack("<BBBBBB", len(signals), 20, 12, 0, 0, 0) + b"".join(signals), t)


def read(path: Path, stream: bytes, name: str) -> Table:
    path.write_bytes(stream)
    return open_log(path).read((name,))[name]


def test_fixes_carry_the_covariances_of_their_epoch(tmp_path: Path) -> None:
    table = read(tmp_path / "a.sbf", pvt(0.0) + covariances(0.0) + pvt(0.5), "PVTGeodetic")
    columns = table.columns
    assert columns["t_gps_ns"].tolist() == [START_NS, START_NS + 500_000_000]
    np.testing.assert_allclose(np.degrees(columns["lla"][0, :2]), [50.9, 4.7])
    np.testing.assert_allclose(columns["vel_n"][0], [1.5, -2.5, -0.25])
    assert columns["status"].tolist() == [FixStatus.FIXED] * 2
    expected = [[4e-4, 1e-4, -2e-4], [1e-4, 9e-4, -3e-4], [-2e-4, -3e-4, 16e-4]]
    np.testing.assert_allclose(columns["cov_pos"][0], expected, rtol=1e-6)
    np.testing.assert_allclose(columns["cov_vel"][0], [[0.01, 0, -0.001], [0, 0.02, 0], [-0.001, 0, 0.03]], rtol=1e-6)
    # without them: twice the RMS distance is 8 cm, 95 % of heights are within 10 cm
    np.testing.assert_allclose(np.sqrt(np.diagonal(columns["cov_pos"][1])), [0.08 / np.sqrt(8), 0.08 / np.sqrt(8), 0.05])


@pytest.mark.parametrize(
    ("fields", "status"),
    [({"Type": 1}, FixStatus.SINGLE), ({"Type": 5}, FixStatus.FLOAT), ({"Type": 0}, -1), ({"Error": 3}, -1)],
)
def test_kinds_of_fix(tmp_path: Path, fields: dict[str, object], status: int) -> None:
    table = read(tmp_path / "a.sbf", pvt(0.0, **fields), "PVTGeodetic")
    assert table.columns["status"].tolist() == [status]


def test_what_the_receiver_does_not_know_is_unknown(tmp_path: Path) -> None:
    unknown = {"Latitude": -2e10, "Longitude": -2e10, "Height": -2e10, "Vn": -2e10, "HAccuracy": 655.35}
    table = read(tmp_path / "a.sbf", pvt(0.0, **unknown) + pvt(1.0, TOW=2**32 - 1), "PVTGeodetic")
    assert dict(table.rejected) == {"no time yet": 1}
    assert np.isnan(table.columns["lla"]).all()
    assert np.isnan(table.columns["vel_n"][0, 0])
    assert np.isnan(table.columns["cov_pos"]).all()


def test_a_stream_with_a_sensor_is_a_whole_drive(tmp_path: Path) -> None:
    parts = [(t, sensor(t)) for t in np.arange(500) / 100]
    parts += [(t, pvt(t) + covariances(t) + inertial(t) + measurements(t)) for t in np.arange(25) / 5]
    (tmp_path / "a.sbf").write_bytes(b"$R: hello\r\n" + b"".join(part for _, part in sorted(parts, key=lambda part: part[0])))
    timeline = load_timeline([tmp_path / "a.sbf"])
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert timeline.reference is not None
    assert len(timeline.imu) == 500
    np.testing.assert_allclose(timeline.imu.accel[0], [1.0, 2.0, -9.8])
    np.testing.assert_allclose(np.degrees(timeline.imu.gyro[0]), [5.0, 6.0, 7.0])
    np.testing.assert_allclose(timeline.reference.vel_n[0], [1.5, -2.5, -0.25])
    np.testing.assert_allclose(np.degrees(euler_from_quat(timeline.reference.q_nb[:1])[0]), [1.0, -2.0, 80.0])
    np.testing.assert_allclose(np.sqrt(np.diagonal(timeline.reference.cov_pos[0])), [0.02, 0.03, 0.04], rtol=1e-6)


def test_the_main_signals_are_read_past_the_others(tmp_path: Path) -> None:
    columns = read(tmp_path / "a.sbf", measurements(0.0) * 2 + pvt(0.0), "MeasEpoch").columns
    assert columns["sat"].tolist() == ["G05", "R03", "E11", "C11", "J02"] * 2
    assert columns["signal"].tolist() == ["1C", "1C", "1C", "2I", "1L"] * 2
    np.testing.assert_allclose(columns["pseudorange"][:5], [21_000_000.123, 22e6, 23e6, 36e6, 37e6])
    assert columns["range_rate"][0] == pytest.approx(1000 * 299_792_458.0 / 1575.42e6)
    assert columns["range_rate"][1] == pytest.approx(1000 * 299_792_458.0 / (1602.0e6 + 4 * 562_500))
    assert columns["cn0"][0] == 45.0


def test_wrong_checksums_are_told(tmp_path: Path) -> None:
    spoilt = bytearray(pvt(0.0) + pvt(1.0))
    spoilt[30] ^= 1
    (tmp_path / "a.sbf").write_bytes(bytes(spoilt))
    log = open_log(tmp_path / "a.sbf")
    assert log.notes == ("1 blocks have a wrong checksum and were left out",)
    assert log.read(("PVTGeodetic",))["PVTGeodetic"].read == 1


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 900), cut=st.integers(0, 60), put=st.binary(max_size=20), second=st.integers(0, 900))
def test_no_damage_raises_anything_but_one_line(tmp_path: Path, place: int, cut: int, put: bytes, second: int) -> None:
    content, said = pvt(0.0) + covariances(0.0) + measurements(0.0) + sensor(0.0) + inertial(0.0) + pvt(1.0), ""
    content = content[:place] + put + content[place + cut :]
    (tmp_path / "a.sbf").write_bytes(content[:second] + content[second + 1 :])
    try:
        load_timeline([tmp_path / "a.sbf"])
    except LogError as error:
        said = str(error)
    assert "\n" not in said


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(number=st.sampled_from([4007, 4027, 4050, 4226, 5906, 5908]), content=st.binary(max_size=200))
def test_blocks_with_right_checksums_and_any_content_are_borne(tmp_path: Path, number: int, content: bytes) -> None:
    said = ""
    (tmp_path / "a.sbf").write_bytes(pvt(0.0) + block(number, content, 0.5) + pvt(1.0))
    try:
        for channel in (log := open_log(tmp_path / "a.sbf")).channels():
            table = log.read((channel.name,))[channel.name]
            assert table.read == len(table.log_time_ns) + sum(table.rejected.values())
    except LogError as error:
        said = str(error)
    assert "\n" not in said


def test_blocks_behind_a_long_beginning_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.sbf").write_bytes(b"$R: lstConfigFile, Current\r\n" * 2000 + pvt(0.0))
    assert open_log(tmp_path / "a.sbf").format == "sbf"


_NAMES = {
    "af0": "a_f0", "af1": "a_f1", "af2": "a_f2", "crs": "C_rs", "crc": "C_rc", "cuc": "C_uc", "cus": "C_us", "cic": "C_ic",
    "cis": "C_is", "e": "e", "sqrt_a": "SQRT_A",
}  # fmt: skip
_SEMICIRCLES = {"delta_n": "DEL_N", "m0": "M_0", "i0": "i_0", "omega": "omega", "omega0": "OMEGA_0", "omega_dot": "OMEGADOT",
                "idot": "IDOT"}  # fmt: skip
_BLOCKS = {"G": ("GPSNav", "PRN", 0), "E": ("GALNav", "SVID", 70), "C": ("BDSNav", "PRN", 140)}


def number_of(sat: str, more: int) -> int:
    """The receiver's number of a satellite; BeiDou's beyond C40 stand apart."""
    number = int(sat[1:])
    return number + (182 if sat[0] == "C" and number > 40 else more)


def ephemeris(row: np.void) -> bytes:
    """An ephemeris as its system's block, stamped at its reference time."""
    system = str(row["sat"])[0]
    name, key, more = _BLOCKS[system]
    fields = {theirs: float(row[own]) for own, theirs in _NAMES.items()}
    fields |= {theirs: float(row[own]) / np.pi for own, theirs in _SEMICIRCLES.items()}
    week, tow_s = divmod(int(row["toe_ns"]) // 10**9, 604_800)
    own_s = tow_s - 14 if system == "C" else tow_s
    fields |= {"TOW": tow_s * 1000, "WNc": week, "t_oe": own_s, "t_oc": own_s, key: number_of(str(row["sat"]), more)}
    delays = {"G": ("T_gd",), "E": ("BGD_L1E5a", "BGD_L1E5b"), "C": ("T_GD1", "T_GD2")}[system]
    fields |= {delay: float(value) for delay, value in zip(delays, row["tgd"], strict=False)} | (
        {"Source": 2} if system == "E" else {}
    )
    return SBFMessage(name, **fields).serialize()


def test_a_stream_of_measurements_and_ephemerides_gives_what_its_rinex_gives(tmp_path: Path) -> None:
    write(simulate(with_duration(SCENARIOS["ranges-open"], 3.0), 7), tmp_path / "log.obs")
    log = open_log(tmp_path / "log.nav")
    stream = b"".join(ephemeris(row) for row in log.read(("log.nav",))["log.nav"].columns["kepler"] if row["sat"])
    columns = open_log(tmp_path / "log.obs").read(("log.obs",))["log.obs"].columns
    first = {"G": (0, 0), "E": (70, 17), "C": (140, 28)}
    for t_ns in np.unique(columns["t_gps_ns"]):
        signals = []
        for row in np.flatnonzero(columns["t_gps_ns"] == t_ns):
            more, kind = first[columns["sat"][row][0]]
            doppler = -columns["range_rate"][row] / 299_792_458.0 * {0: 1575.42e6, 17: 1575.42e6, 28: 1561.098e6}[kind]
            code = round(columns["pseudorange"][row] * 1000)
            cn0 = round((columns["cn0"][row] - 10) / 0.25)
            values = (0, kind, number_of(columns["sat"][row], more), code >> 32, code & 0xFFFFFFFF, round(doppler * 1e4))
            signals.append(struct.pack("<BBBBIiHbBHBB", *values, 0, 0, cn0, 10, 0, 0))
        content = struct.pack("<BBBBBB", len(signals), 20, 12, 0, 0, 0) + b"".join(signals)
        week, tow_ms = divmod(int(t_ns) // 10**6, 604_800_000)
        stream += block_at(4027, content, week, tow_ms)
    (tmp_path / "a.sbf").write_bytes(stream)
    before = load_timeline([tmp_path / "log.obs", tmp_path / "log.nav"]).ranges
    after = load_timeline([tmp_path / "a.sbf"]).ranges
    assert before is not None
    assert after is not None
    assert np.array_equal(before.sat, after.sat)
    assert np.array_equal(before.t_ns, after.t_ns)
    np.testing.assert_allclose(after.sat_pos_e, before.sat_pos_e, atol=1.0)  # the receiver's floats are single
    np.testing.assert_allclose(after.pseudorange, before.pseudorange, atol=2.0)
    np.testing.assert_allclose(after.range_rate, before.range_rate, atol=1e-2)


def test_glonass_ephemerides_are_in_metres_and_gps_time(tmp_path: Path) -> None:
    place = {"X": 7003.008, "Y": -12206.626, "Z": 21280.765, "Dx": 0.7835, "Dy": 2.8042, "Dz": 1.3525, "Ddx": 0.0, "Ddz": -2e-9}
    told = {"SVID": 40, "FreqNr": 13, "tau": -1.5e-4, "gamma": 1e-12, "t_oe": 252_918, "B": 0}
    message = SBFMessage("GLONav", scaling=False, **stamp(0.0), **place, **told)
    (tmp_path / "a.sbf").write_bytes(message.serialize() + measurements(0.0))
    row = open_log(tmp_path / "a.sbf").read(("ephemerides",))["ephemerides"].columns["glonass"][0]
    assert (row["sat"], row["channel"], row["toe_ns"]) == ("R03", 5, START_NS + 100 * 10**9)
    np.testing.assert_allclose(row["pos"], [7_003_008.0, -12_206_626.0, 21_280_765.0])
    np.testing.assert_allclose(row["vel"], [783.5, 2804.2, 1352.5], rtol=1e-6)
    assert row["tau"] == pytest.approx(-1.5e-4)
