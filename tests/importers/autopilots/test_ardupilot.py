"""DataFlash: as pymavlink reads it, whole drives out of it, and damage that costs itself only."""

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.DFReader import DFReader_binary

from importers import LogError, load_timeline, open_log
from importers.autopilots.dataflash import open_dataflash
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import FixStatus, Timeline

WEEK, TOW_MS = 2288, 252_818_000
FORMATS = {
    "FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "IMU": (10, "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "GPS": (11, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "GPA": (12, "QBCCCCfBIH", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta"),
    "XKF1": (13, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "POS": (14, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
}
PACKED = {
    "b": "b", "B": "B", "c": "h", "C": "H", "d": "d", "e": "i", "E": "I", "f": "f", "h": "h", "H": "H", "i": "i", "I": "I",
    "L": "i", "M": "B", "n": "4s", "N": "16s", "q": "q", "Q": "Q", "Z": "64s",
}  # fmt: skip


def packet(name: str, values: Sequence[object]) -> bytes:
    number, characters, _ = FORMATS[name]
    return b"\xa3\x95" + bytes([number]) + struct.pack("<" + "".join(PACKED[c] for c in characters), *values)


def definition(name: str) -> bytes:
    number, characters, columns = FORMATS[name]
    length = 3 + struct.calcsize("<" + "".join(PACKED[c] for c in characters))
    return packet("FMT", (number, length, name.encode(), characters.encode(), columns.encode()))


def dataflash(messages: Iterable[tuple[str, Sequence[object]]]) -> bytes:
    return b"".join(definition(name) for name in FORMATS) + b"".join(packet(name, values) for name, values in messages)


def drive(seconds: int = 20) -> list[tuple[str, Sequence[object]]]:
    """Two IMUs at 50 Hz, fixes with accuracies at 5 Hz that arrive 0.12 s late, the filter's own solution at 10 Hz."""
    messages: list[tuple[float, str, Sequence[object]]] = []
    for t in np.arange(seconds * 50) / 50:
        for number in (0, 1):
            values = (round(t * 1e6) + 9_000_000, number, 0.01, 0.02, 0.03, 0.1, 0.2, -9.8, 0, 0, 40.0, 1, 1, 1000, 1000)
            messages.append((t, "IMU", values))
    for t in np.arange(seconds * 5) / 5:
        stamp, lat = round((t + 0.12) * 1e6) + 9_000_000, 47.0 + 3 * t / 111_200
        fix = (stamp, 0, 6, TOW_MS + round(t * 1000), WEEK, 17, 80, round(lat * 1e7), 80_000_000, 45_012, 3.0, 0.0, 0.5, 0.0, 1)
        messages.append((t + 0.12, "GPS", fix))
        messages.append((t + 0.12, "GPA", (stamp, 0, 120, 4, 6, 25, 0.0, 1, round(t * 1000), 200)))
    for t in np.arange(seconds * 10) / 10 + 0.011:
        stamp, lat = round(t * 1e6) + 9_000_000, 47.0 + 3 * t / 111_200
        for core, yaw in ((0, 9000), (1, 4500)):
            messages.append((t, "XKF1", (stamp, core, 100, -200, yaw, 3.0, 0.1, 0.5, 0, 0, 0, 0, 0, 0, 0, 0)))
        messages.append((t, "POS", (stamp + 10_000, round(lat * 1e7), 80_000_000, 450.12, 0.0, 0.0)))
    return [(name, values) for _, name, values in sorted(messages, key=lambda part: part[0])]


def load(path: Path, content: bytes) -> Timeline:
    path.write_bytes(content)
    return load_timeline([path])


def test_every_message_is_what_pymavlink_reads(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(dataflash(drive(2)))
    own, judge = open_dataflash(str(path)), DFReader_binary(str(path))
    assert own.lost == 0
    found: dict[str, list[dict[str, object]]] = {}
    while (message := judge.recv_msg()) is not None:
        found.setdefault(message.get_type(), []).append(message.to_dict())
    judge.data_map.close()
    judge.filehandle.close()
    for name in ("IMU", "GPS", "GPA", "XKF1", "POS"):
        columns = own.columns(name)
        assert len(found[name]) == len(columns["TimeUS"])
        for column, values in columns.items():
            np.testing.assert_allclose(values.astype(float), [float(str(row[column])) for row in found[name]], rtol=1e-9)


def test_a_flight_is_a_whole_drive(tmp_path: Path) -> None:
    timeline = load(tmp_path / "a.bin", dataflash(drive()))
    assert timeline.imu is not None
    assert timeline.fixes is not None
    assert timeline.reference is not None
    start = int(gps_from_week_tow(WEEK, np.array([TOW_MS / 1e3]))[0])
    assert timeline.fixes.t_ns.tolist() == (start + np.arange(100) * 200_000_000).tolist()
    late = (timeline.imu.t_ns - start) / 1e9 - np.arange(1000) / 50
    assert np.abs(late + 0.12).max() < 1e-5
    np.testing.assert_allclose(timeline.imu.accel[0], [0.1, 0.2, -9.8], rtol=1e-6)
    np.testing.assert_allclose(np.degrees(timeline.fixes.lla[0, :2]), [47.0, 8.0], atol=1e-7)
    np.testing.assert_allclose(timeline.fixes.vel_n[0], [3.0, 0.0, 0.5], atol=1e-7)
    np.testing.assert_allclose(np.sqrt(np.diagonal(timeline.fixes.cov_pos[0])), [0.04, 0.04, 0.06])
    np.testing.assert_allclose(np.sqrt(np.diagonal(timeline.fixes.cov_vel[0])), 0.25)
    assert set(timeline.fixes.status.tolist()) == {FixStatus.FIXED}
    np.testing.assert_allclose(timeline.reference.vel_n[0], [3.0, 0.1, 0.5], rtol=1e-6)
    np.testing.assert_allclose(np.degrees(euler_from_quat(timeline.reference.q_nb[:1])[0]), [1.0, -2.0, 90.0])


def test_further_instances_serve_where_they_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(dataflash(drive(2)))
    channels = {channel.name: channel.type for channel in open_log(tmp_path / "a.bin").channels()}
    assert channels == {
        "IMU": "dataflash/IMU",
        "IMU[1]": "dataflash/IMU/spare",
        "GPS": "dataflash/GPS",
        "POS": "dataflash/POS",
    }


def test_damage_costs_itself_only(tmp_path: Path) -> None:
    content = dataflash(drive())
    place = len(content) // 2
    timeline = load(tmp_path / "a.bin", content[:place] + b"\xa3\x95\xff" + bytes(50) + content[place + 5 :])
    assert timeline.imu is not None
    assert 990 <= len(timeline.imu) <= 1000
    assert any("bytes are no messages" in note for note in timeline.provenance.damage)


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([], r"none of the messages that are read \(IMU, GPS, POS\); it has FMT"),
        ([part for part in drive(2) if part[0] == "IMU"], "no fix of the log tells the date"),
    ],
)
def test_logs_that_cannot_be_used_say_why(tmp_path: Path, messages: list[tuple[str, Sequence[object]]], words: str) -> None:
    with pytest.raises(LogError, match=words):
        load(tmp_path / "a.bin", dataflash(messages))


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 3000), cut=st.integers(0, 60), put=st.binary(max_size=20))
def test_no_damage_raises_anything_but_one_line(tmp_path: Path, place: int, cut: int, put: bytes) -> None:
    content, said = dataflash(drive(2)), ""
    try:
        load(tmp_path / "a.bin", content[:place] + put + content[place + cut :])
    except LogError as error:
        said = str(error)
    assert "\n" not in said
