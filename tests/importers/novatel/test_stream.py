"""NovAtel streams: the examples of the manual, binary against ASCII, and whole drives."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from importers import LogError, load_timeline, open_log
from importers.rows.log import Table
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import FixStatus

WEEK, TOW = 2288, 252_818.0
MANUAL = {
    "RAWIMUSX": b"%RAWIMUSXA,1692,484620.664;00,11,1692,484620.664389000,00801503,43110635,-817242,-202184,-215194,-41188,"
    b"-9895*a5db8c7b",
    "INSPVAS": b"%INSPVASA,1264,144059.000;1264,144059.002135700,51.116680071,-114.037929194,515.286704183,277.896368884,"
    b"84.915188605,-8.488207941,0.759619515,-2.892414901,6.179554750,INS_ALIGNMENT_COMPLETE*855d6f76",
    "BESTVEL": b"#BESTVELA,COM1,0,61.0,FINESTEERING,1337,334167.000,00000000,827b,1984;SOL_COMPUTED,PSRDIFF,0.250,4.000,"
    b"0.0206,227.712486,0.0493,0.0*0e68bf05",
}
"""Messages that the manual prints, with the checksums that it prints."""


def crc(content: bytes) -> int:
    return zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF


def binary(number: int, content: bytes, t: float, short: bool = False) -> bytes:
    milliseconds = round((TOW + t) * 1000)
    if short:
        head = b"\xaa\x44\x13" + struct.pack("<BHHI", len(content), number, WEEK, milliseconds)
    else:
        head = b"\xaa\x44\x12\x1c" + struct.pack(
            "<HBBHHBBHIIHH", number, 0, 32, len(content), 0, 0, 180, WEEK, milliseconds, 0, 0, 0
        )
    return head + content + struct.pack("<I", crc(head + content))


def ascii_of(name: str, fields: str, t: float) -> bytes:
    content = f"{name}A,COM1,0,50.0,FINESTEERING,{WEEK},{TOW + t:.3f},02000000,b1f6,16809;{fields}".encode()
    return b"#" + content + b"*%08x\r\n" % crc(content)


def bestpos(t: float, type: int = 50, status: int = 0, number: int = 42) -> bytes:
    values = (status, type, 51.0 + 3e-5 * t, -114.0, 1064.5, -16.9, 61, 0.012, 0.013, 0.025, b"", 0.0, 0.0, *[24] * 4, *[0] * 4)
    return binary(number, struct.pack("<IIdddfIfff4sffBBBBBBBB", *values), t)


def bestvel(t: float) -> bytes:
    return binary(99, struct.pack("<IIffdddf", 0, 50, 0.15, 0.0, 3.3, 30.0, 0.2, 0.0), t)


def rawimusx(t: float, rate: int = 100, kind: int = 32) -> bytes:
    """STIM300: 1, 2, 3 m/s^2 and 0.1, 0.2, 0.3 rad/s along x, y, z of the case."""
    force = [round(value / rate * 2**22) for value in (3.0, -2.0, 1.0)]
    turn = [round(np.degrees(value) / rate * 2**21) for value in (0.3, -0.2, 0.1)]
    return binary(1462, struct.pack("<BBHdI6i", 0, kind, WEEK, TOW + t, 0, *force, *turn), t, short=True)


def inspvax(t: float) -> bytes:
    values = (3, 56, 51.0, -114.0, 1064.5, -16.9, 1.0, 2.0, 0.5, 1.5, -2.5, 30.0, *[0.1] * 9, 0, 0)
    return binary(1465, struct.pack("<IIdddf3d3d9fIH", *values), t)


def read(path: Path, stream: bytes, name: str) -> Table:
    path.write_bytes(stream)
    return open_log(path).read((name,))[name]


@pytest.mark.parametrize("name", list(MANUAL))
def test_the_messages_of_the_manual_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.gps").write_bytes(b"".join(message + b"\r\n" for message in MANUAL.values()))
    table = open_log(tmp_path / "a.gps").read((name,))[name] if name != "RAWIMUSX" else None
    if name == "BESTVEL":
        assert table is not None
        assert table.columns["t_gps_ns"].tolist() == gps_from_week_tow(1337, np.array([334_166.75])).tolist()
        assert np.hypot(*table.columns["vel_n"][0, :2]) == pytest.approx(0.0206)
        assert table.columns["vel_n"][0, 2] == -0.0493
    if name == "INSPVAS":
        assert table is not None
        np.testing.assert_allclose(np.degrees(table.columns["lla"][0, :2]), [51.116680071, -114.037929194])
        np.testing.assert_allclose(table.columns["vel_n"][0], [277.896368884, 84.915188605, 8.488207941])
        angles = np.degrees(euler_from_quat(table.columns["q_nb"])[0])
        np.testing.assert_allclose(angles, [0.759619515, -2.892414901, 6.179554750])
    assert [channel.name for channel in open_log(tmp_path / "a.gps").channels()] == ["BESTVEL", "RAWIMUSX", "INSPVAS"]


def test_binary_and_ascii_say_the_same(tmp_path: Path) -> None:
    text = 'SOL_COMPUTED,NARROW_INT,51.0,-114.0,1064.5,-16.9,WGS84,0.012,0.013,0.025,"",0.0,0.0,24,24,24,24,00,00,00,00'
    table = read(tmp_path / "a.gps", bestpos(0.0) + ascii_of("BESTPOS", text, 0.0), "BESTPOS")
    assert len(table.columns["status"]) == 2
    for name, values in table.columns.items():
        np.testing.assert_allclose(values[0], values[1], err_msg=name)
    assert table.columns["lla"][0, 2] == pytest.approx(1047.6, abs=1e-5)
    assert table.columns["status"].tolist() == [FixStatus.FIXED] * 2


@pytest.mark.parametrize(
    ("type", "status", "kind"),
    [(16, 0, FixStatus.SINGLE), (17, 0, FixStatus.DIFFERENTIAL), (34, 0, FixStatus.FLOAT), (56, 0, FixStatus.FIXED),
     (50, 1, -1), (0, 0, -1), (19, 0, FixStatus.DEAD_RECKONING)],
)  # fmt: skip
def test_kinds_of_fix(tmp_path: Path, type: int, status: int, kind: int) -> None:
    assert read(tmp_path / "a.gps", bestpos(0.0, type, status), "BESTPOS").columns["status"].tolist() == [kind]


def drive(seconds: int = 10) -> bytes:
    parts = [(t, rawimusx(t)) for t in np.arange(seconds * 100) / 100]
    for t in np.arange(seconds * 5) / 5:
        parts += [(t, bestpos(t)), (t, bestpos(t, 16, number=1429)), (t, bestvel(t)), (t, inspvax(t))]
    return b"".join(message for _, message in sorted(parts, key=lambda part: part[0]))


def test_a_stream_of_span_is_a_whole_drive(tmp_path: Path) -> None:
    (tmp_path / "a.gps").write_bytes(b"\r\n<OK\r\n[COM1]" + drive())
    timeline = load_timeline([tmp_path / "a.gps"])
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert timeline.reference is not None
    assert timeline.imu.increments
    np.testing.assert_allclose(timeline.imu.accel[5], [2.0, 1.0, -3.0], atol=1e-4)  # forward, right, down
    np.testing.assert_allclose(timeline.imu.gyro[5], [0.2, 0.1, -0.3], atol=1e-4)
    # The fixes without the IMU's help are taken before those with it; velocities are of 0.15 s before.
    assert set(timeline.fixes.status[timeline.fixes.has_position].tolist()) == {FixStatus.SINGLE}
    assert [use.name for use in timeline.provenance.channels if use.role == "fix"] == ["BESTGNSSPOS"]
    moving = np.isfinite(timeline.fixes.vel_n).all(axis=1)
    start = int(gps_from_week_tow(WEEK, np.array([TOW]))[0])
    assert int(timeline.fixes.t_ns[moving][0]) == start - 150_000_000
    np.testing.assert_allclose(timeline.reference.vel_n[0], [1.0, 2.0, -0.5])
    np.testing.assert_allclose(np.degrees(euler_from_quat(timeline.reference.q_nb[:1])[0]), [1.5, -2.5, 30.0])


def observation(prn: int, system: int, signal: int, psr: float, channel: int = 0, lock: int = 1) -> bytes:
    tracking = lock << 12 | system << 16 | signal << 21
    return struct.pack("<HHdfdffffI", prn, channel, psr, 0.4, 0.0, 0.01, -1000.0, 45.0, 100.0, tracking)


def test_ranges_have_satellites_signals_and_rates(tmp_path: Path) -> None:
    rows = [observation(5, 0, 0, 2.1e7), observation(40, 1, 0, 2.2e7, 11), observation(11, 3, 2, 2.3e7)]
    rows += [observation(19, 4, 0, 2.4e7), observation(194, 5, 14, 3.5e7), observation(7, 0, 0, 2.5e7, lock=0)]
    table = read(tmp_path / "a.gps", binary(43, struct.pack("<I", len(rows)) + b"".join(rows), 0.0), "RANGE")
    columns = table.columns
    assert columns["sat"].tolist() == ["G05", "R03", "E11", "C19", "J02", "G07"]
    assert columns["signal"].tolist() == ["1C", "1C", "1C", "2I", "5Q", "1C"]
    assert columns["pseudorange"][:5].tolist() == [2.1e7, 2.2e7, 2.3e7, 2.4e7, 3.5e7]
    assert np.isnan(columns["pseudorange"][5])
    assert columns["range_rate"][0] == pytest.approx(1000 * 299_792_458.0 / 1575.42e6)
    assert columns["range_rate"][1] == pytest.approx(1000 * 299_792_458.0 / (1602.0e6 + 4 * 562_500))


def test_wrong_checksums_are_told(tmp_path: Path) -> None:
    spoilt = bytearray(drive(2))
    spoilt[spoilt.index(bestvel(0.2)) + 40] ^= 1
    (tmp_path / "a.gps").write_bytes(bytes(spoilt))
    timeline = load_timeline([tmp_path / "a.gps"])
    assert any("1 messages have a wrong checksum" in note for note in timeline.provenance.damage)


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        (b"".join(rawimusx(t / 100, kind=16) for t in range(100)), "IMU type 16, whose scale is not known"),
        (binary(325, bytes(40), 0.0, short=True) * 3, "do not tell which IMU made them"),
    ],
)
def test_raw_samples_of_unknown_scale_are_refused(tmp_path: Path, stream: bytes, words: str) -> None:
    (tmp_path / "a.gps").write_bytes(stream)
    with pytest.raises(LogError, match=words):
        load_timeline([tmp_path / "a.gps"])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 2500), cut=st.integers(0, 60), put=st.binary(max_size=20))
def test_no_damage_raises_anything_but_one_line(tmp_path: Path, place: int, cut: int, put: bytes) -> None:
    content, said = drive(1) + b"".join(message + b"\r\n" for message in MANUAL.values()), ""
    (tmp_path / "a.gps").write_bytes(content[:place] + put + content[place + cut :])
    try:
        load_timeline([tmp_path / "a.gps"])
    except LogError as error:
        said = str(error)
    assert "\n" not in said
