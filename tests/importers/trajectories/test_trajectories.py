"""SBET and GPX as references and fixes, and documents that cannot be used say why."""

from pathlib import Path

import numpy as np
import pytest

from importers import InputSettings, LogError, load_timeline, open_log
from importers.rows.log import Table
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_utc, gps_from_week_tow
from navreplay.timeline import FixStatus


def records(wander: float = 0.0, seconds: float = 252_818.0, n: int = 50) -> np.ndarray:
    """A vehicle that drives with 3 m/s along azimuth 60 deg, heading along."""
    rows = np.zeros((n, 17))
    t = np.arange(n) / 10
    north, east = 3 * np.cos(np.radians(60.0)), 3 * np.sin(np.radians(60.0))
    rows[:, 0] = seconds + t
    rows[:, 1:4] = np.column_stack([0.84 + north * t / 6.37e6, 0.2 + east * t / 6.37e6 / np.cos(0.84), 500 + 0 * t])
    # axes turned from north by minus the wander angle
    rows[:, 4], rows[:, 5] = north * np.cos(wander) - east * np.sin(wander), north * np.sin(wander) + east * np.cos(wander)
    rows[:, 6] = -0.25
    rows[:, 7:10] = [0.01, -0.02, np.radians(60.0) + wander]
    rows[:, 10] = wander
    return rows


@pytest.mark.parametrize("wander", [0.0, 0.7, -2.0])
def test_an_sbet_is_a_reference_whatever_its_wander_angle(tmp_path: Path, wander: float) -> None:
    (tmp_path / "a.out").write_bytes(records(wander).tobytes())
    (tmp_path / "imu.csv").write_text(
        "t_gps_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
        + "".join(f"{1384035218000000000 + i * 10**7},0,0,0,0,0,-9.8\n" for i in range(100))
    )
    timeline = load_timeline([tmp_path / "imu.csv"], InputSettings(gps_week=2288), tmp_path / "a.out")
    reference = timeline.reference
    assert reference is not None
    assert int(reference.t_ns[0]) == int(gps_from_week_tow(2288, np.array([252_818.0]))[0])
    np.testing.assert_allclose(reference.vel_n[0], [1.5, 3 * np.sin(np.radians(60.0)), -0.25], atol=1e-12)
    np.testing.assert_allclose(np.degrees(euler_from_quat(reference.q_nb[:1])[0]), np.degrees([0.01, -0.02, 0]) + [0, 0, 60])


def test_weeks_go_on_and_an_unknown_week_is_asked_for(tmp_path: Path) -> None:
    rows = records(seconds=604_798.0)
    rows[20:, 0] -= 604_800
    (tmp_path / "a.out").write_bytes(rows.tobytes())
    log = open_log(tmp_path / "a.out", InputSettings(gps_week=2288))
    times = log.read(("a.out",))["a.out"].columns["t_gps_ns"]
    np.testing.assert_allclose(np.diff(times), 1e8, atol=10)
    with pytest.raises(LogError, match=r"seconds of week without a week; set input\.gps_week"):
        open_log(tmp_path / "a.out").read(("a.out",))


@pytest.mark.parametrize("content", [b"\0" * 136 * 20, records().tobytes()[:-8], np.random.default_rng(2).bytes(136 * 20)])
def test_what_is_no_sbet_is_not_taken_for_one(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.out").write_bytes(content)
    with pytest.raises(LogError, match="unknown format"):
        open_log(tmp_path / "a.out")


GPX = """<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="logger" xmlns="http://www.topografix.com/GPX/1/1"><trk><name>ride &amp; rest</name><trkseg>
<trkpt lat="48.1" lon="11.5"><ele>500.5</ele><time>2023-11-14T22:13:20Z</time><fix>3d</fix></trkpt>
<trkpt lat="48.1001" lon="11.5"><ele>501.5</ele><geoidheight>46.0</geoidheight>
<time>2023-11-14T23:13:21.250+01:00</time><fix>dgps</fix></trkpt>
<trkpt lat="48.1002" lon="11.5"><ele>502.5</ele></trkpt>
<trkpt lat="x" lon="11.5"><ele>502.5</ele><time>2023-11-14T22:13:22Z</time></trkpt>
</trkseg></trk></gpx>
"""


def gpx(path: Path, text: str) -> Table:
    path.write_text(text)
    return open_log(path).read((path.name,))[path.name]


def test_track_points_are_fixes(tmp_path: Path) -> None:
    table = gpx(tmp_path / "a.gpx", GPX)
    start = int(gps_from_utc(np.array([1_700_000_000 * 10**9]))[0])
    assert table.columns["t_gps_ns"].tolist() == [start, start + 1_250_000_000]
    assert (table.read, dict(table.rejected)) == (4, {"without a time, or no position": 2})
    np.testing.assert_allclose(np.degrees(table.columns["lla"][:, 0]), [48.1, 48.1001])
    assert table.columns["lla"][:, 2].tolist() == [500.5, 547.5]
    assert table.columns["status"].tolist() == [FixStatus.SINGLE, FixStatus.DIFFERENTIAL]


def test_a_cut_document_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    table = gpx(tmp_path / "a.gpx", GPX[: GPX.index('<trkpt lat="48.1002"') + 30])
    assert len(table.columns["t_gps_ns"]) == 2
    assert list(table.rejected) == ["damaged from line 6 on"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<?xml version='1.0'?><gpx><rte/></gpx>", "no track point with a time"),
        ("<?xml version='1.0'?><gpx><trk", "no readable GPX document"),
        ("<?xml version='1.0'?><!DOCTYPE gpx [<!ENTITY a 'aaaa'>]><gpx>&a;</gpx>", "declares a document type"),
    ],
)
def test_documents_that_cannot_be_used_say_why(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(LogError, match=words):
        gpx(tmp_path / "a.gpx", text)
