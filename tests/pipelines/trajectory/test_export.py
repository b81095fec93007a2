"""solution.csv and every export format, read back."""

import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import gpxpy
import numpy as np
import pynmeagps
import pytest
from pyarrow import parquet

from importers import InputSettings, open_log
from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import euler_from_quat, quat_from_euler, quat_from_rotvec, quat_multiply
from navreplay.geodesy.time_scales import utc_from_gps, week_tow_from_gps
from navreplay.solution import Solution
from navreplay.timeline import LogError
from pipelines.trajectory.export import EXPORT_FORMATS, export
from pipelines.trajectory.solution_csv import (
    COLUMNS,
    euler_std,
    read_solution_csv,
    write_plain,
    write_solution_csv,
    write_solution_parquet,
)
from tests.helpers.sample_drive import make_solution


@pytest.fixture
def solution() -> Solution:
    return make_solution(duration_s=20)


@pytest.fixture
def run_folder(tmp_path: Path, solution: Solution) -> Path:
    write_solution_csv(tmp_path / "solution.csv", solution)
    return tmp_path


def test_csv_keeps_what_can_be_measured(run_folder: Path, solution: Solution) -> None:
    table = read_solution_csv(run_folder / "solution.csv")
    assert np.array_equal(table.t_ns, solution.t_ns)
    assert np.abs(ned_between(solution.lla, table.lla)).max() < 1e-5
    assert np.abs(table.vel_n - solution.vel_n).max() <= 0.5e-6
    assert np.abs(table.rpy - euler_from_quat(solution.q_nb)).max() < 1e-8
    assert np.allclose(table.std[:, :6], solution.std[:, :6], rtol=1e-5)
    assert np.allclose(table.gyro_bias, solution.gyro_bias, atol=1e-11)
    assert np.allclose(table.accel_bias, solution.accel_bias, atol=1e-8)
    assert table.status[0] == "updated"
    assert set(table.status) == {"updated", "predicted", "rejected"}


def test_csv_has_the_documented_columns_and_the_same_bytes_again(run_folder: Path, solution: Solution, tmp_path: Path) -> None:
    header, first = (run_folder / "solution.csv").read_text().splitlines()[:2]
    assert header.split(",") == list(COLUMNS)
    assert header.startswith("gps_week,gps_tow_s,utc,lat_deg,lon_deg,height_m,vel_n_mps")
    assert header.endswith("gyro_bias_z_dph,accel_bias_x_mg,accel_bias_y_mg,accel_bias_z_mg,status")
    assert first.startswith("2374,243300.500000000,2025-07-08T19:34:42.500000Z,40.09")
    write_solution_csv(tmp_path / "again.csv", solution)
    assert (tmp_path / "again.csv").read_bytes() == (run_folder / "solution.csv").read_bytes()


def test_standard_deviations_of_angles_match_small_turns() -> None:
    rng = np.random.default_rng(3)
    q = quat_from_euler(np.array([0.2]), np.array([-0.7]), np.array([2.1]))
    root = rng.standard_normal((3, 3)) * 1e-4
    cov = (root @ root.T)[None]
    turned = euler_from_quat(quat_multiply(quat_from_rotvec(rng.standard_normal((40000, 3)) @ root.T), q))
    assert np.allclose(turned.std(axis=0), euler_std(q, cov)[0], rtol=0.02)


def test_unreadable_solution_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="what `navreplay run -o` wrote"):
        export(tmp_path, "tum", tmp_path / "x.tum")
    (tmp_path / "solution.csv").write_text("a,b\n1,2\n")
    with pytest.raises(LogError, match=r"not a solution\.csv of navreplay") as caught:
        export(tmp_path, "tum", tmp_path / "x.tum")
    assert "\n" not in str(caught.value)
    (tmp_path / "solution.csv").write_text(",".join(COLUMNS) + "\n")
    with pytest.raises(LogError, match="holds no rows"):
        export(tmp_path, "tum", tmp_path / "x.tum")


def test_unknown_format_names_those_there_are(run_folder: Path) -> None:
    with pytest.raises(LogError, match=r"shapefile.*tum"):
        export(run_folder, "shapefile", run_folder / "x.shp")


@pytest.mark.parametrize("format", EXPORT_FORMATS)
def test_every_format_is_written_whole_and_alike(run_folder: Path, format: str) -> None:
    path, again = run_folder / "new" / f"a.{format}", run_folder / f"b.{format}"
    export(run_folder, format, path)
    export(run_folder, format, again)
    assert path.read_bytes() == again.read_bytes()
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_path_that_cannot_be_written_is_told(run_folder: Path) -> None:
    (run_folder / "file").write_text("")
    with pytest.raises(LogError, match="cannot write the export"):
        export(run_folder, "tum", run_folder / "file" / "x.tum")


def test_tum_and_kitti_hold_local_poses(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "tum", run_folder / "x.tum")
    export(run_folder, "kitti", run_folder / "x.kitti")
    tum, kitti = np.loadtxt(run_folder / "x.tum"), np.loadtxt(run_folder / "x.kitti").reshape(-1, 3, 4)
    assert np.allclose(tum[:, 0], utc_from_gps(solution.t_ns) / 1e9, atol=1e-6)
    enu = ned_between(solution.lla[0], solution.lla)[:, [1, 0, 2]] * [1, 1, -1]
    assert np.allclose(tum[:, 1:4], enu, atol=2e-5)
    assert np.allclose(kitti[:, :, 3], enu, atol=2e-5)
    assert np.allclose(np.linalg.norm(tum[:, 4:], axis=1), 1)
    yaw = euler_from_quat(solution.q_nb)[:, 2]
    assert np.allclose(np.arctan2(kitti[:, 1, 0], kitti[:, 0, 0]), np.pi / 2 - yaw, atol=1e-3)
    x, y, z, w = tum[:, 4:].T
    assert np.allclose(1 - 2 * (y * y + z * z), kitti[:, 0, 0], atol=1e-6)
    assert np.allclose(2 * (x * y + z * w), kitti[:, 1, 0], atol=1e-6)


def test_parquet_has_typed_columns(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "parquet", run_folder / "x.parquet")
    table = parquet.read_table(run_folder / "x.parquet")
    assert table.column_names == list(COLUMNS)
    assert str(table.schema.field("utc").type) == "timestamp[us, tz=UTC]"
    assert np.allclose(table["lat_deg"].to_numpy(), np.degrees(solution.lla[:, 0]), atol=1e-10)


def test_kml_and_geojson_parse_and_agree(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "kml", run_folder / "x.kml")
    export(run_folder, "geojson", run_folder / "x.geojson")
    root = ElementTree.parse(run_folder / "x.kml").getroot()
    coords = [[float(x) for x in (e.text or "").split()] for e in root.iter("{http://www.google.com/kml/ext/2.2}coord")]
    feature = json.loads((run_folder / "x.geojson").read_text())["features"][0]
    assert np.allclose(coords, feature["geometry"]["coordinates"], atol=1e-4)
    assert np.allclose(np.array(coords)[:, 1], np.degrees(solution.lla[:, 0]), atol=1e-8)
    assert len(feature["properties"]["coordTimes"]) == len(coords) == len(solution)


def test_pos_reads_as_rtklib_writes_it(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "pos", run_folder / "x.pos")
    lines = (run_folder / "x.pos").read_text().splitlines()
    assert lines[0].startswith("%")
    assert re.match(r"%\s+GPST", lines[1])
    rows = np.array([[float(x) for x in line.split()] for line in lines if not line.startswith("%")])
    assert rows.shape == (len(solution), 24)
    assert np.allclose(rows[:, 2:4], np.degrees(solution.lla[:, :2]), atol=1e-9)
    assert np.allclose(rows[:, 15:18], solution.vel_n * [1, 1, -1], atol=1e-5)
    assert set(rows[:, 5]) == {5.0, 7.0}


def test_sbet_is_seventeen_doubles_a_row(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "sbet", run_folder / "x.out")
    records = np.fromfile(run_folder / "x.out", dtype="<f8").reshape(-1, 17)
    assert records[0, 0] == 243300.5
    assert np.abs(ned_between(solution.lla, records[:, 1:4])).max() < 1e-5
    assert np.allclose(records[:, 7:10], euler_from_quat(solution.q_nb), atol=1e-8)
    assert not records[:, 10:].any()


def test_an_exported_sbet_can_be_read_again(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "sbet", run_folder / "x.out")
    week, _ = week_tow_from_gps(solution.t_ns)
    log = open_log(run_folder / "x.out", InputSettings(gps_week=int(week[0])))
    columns = log.read(("x.out",))["x.out"].columns
    assert np.abs(columns["t_gps_ns"] - solution.t_ns).max() < 100
    assert np.abs(ned_between(solution.lla, columns["lla"])).max() < 1e-5
    assert np.allclose(columns["vel_n"], solution.vel_n, atol=1e-4)
    assert np.allclose(euler_from_quat(columns["q_nb"]), euler_from_quat(solution.q_nb), atol=1e-8)


def test_the_compiled_writer_writes_what_the_plain_one_does(tmp_path: Path, solution: Solution) -> None:
    rng = np.random.default_rng(5)
    count = 20_000
    cov = np.zeros((count, 15, 15))
    cov[:, range(9), range(9)] = 10.0 ** rng.uniform(-18, 14, (count, 9))
    cov[:3, 0, 0] = 0.0, 1e-10, 1e12
    many = replace(
        solution,
        t_ns=solution.t_ns[0] + np.sort(rng.integers(0, 3 * 86_400 * 10**9, count)),
        lla=np.stack([rng.uniform(-1.5, 1.5, count), rng.uniform(-3.1, 3.1, count), rng.uniform(-400, 9e5, count)], axis=1),
        vel_n=rng.standard_normal((count, 3)) * 10.0 ** rng.integers(-9, 4, (count, 1)),
        q_nb=quat_from_rotvec(rng.standard_normal((count, 3))),
        gyro_bias=rng.standard_normal((count, 3)) * 1e-3,
        accel_bias=rng.standard_normal((count, 3)) * 0.1,
        cov=cov,
        status=rng.integers(0, 4, count).astype(np.int8),
    )
    write_solution_csv(tmp_path / "fast.csv", many)
    write_plain(tmp_path / "plain.csv", many)
    fast, plain = ((tmp_path / name).read_text().splitlines() for name in ("fast.csv", "plain.csv"))
    assert len(fast) == len(plain) == count + 1
    different = [
        (name, a, b)
        for one, other in zip(fast, plain, strict=True)
        if one != other
        for name, a, b in zip(COLUMNS, one.split(","), other.split(","), strict=True)
        if a != b
    ]
    # where a digit is on the edge, a product may round to its other side
    assert len(different) < 1e-4 * count * len(COLUMNS)
    for name, a, b in different:
        step = 2e-5 * abs(float(b)) if COLUMNS[name] == "%.6g" else 1.01 * 10.0 ** -int(COLUMNS[name][2:-1])
        assert abs(float(a) - float(b)) <= step


def test_a_solution_with_what_is_no_number_is_written_too(tmp_path: Path, solution: Solution) -> None:
    accel_bias = solution.accel_bias.copy()
    accel_bias[1, 0], accel_bias[2, 1] = np.nan, 1e9
    write_solution_csv(tmp_path / "solution.csv", replace(solution, accel_bias=accel_bias))
    table = read_solution_csv(tmp_path / "solution.csv")
    assert np.isnan(table.accel_bias[1, 0])
    assert table.accel_bias[2, 1] == pytest.approx(1e9)


def test_parquet_holds_the_solution_with_all_its_digits(tmp_path: Path, solution: Solution) -> None:
    write_solution_parquet(tmp_path / "solution.parquet", solution)
    table = parquet.read_table(tmp_path / "solution.parquet")
    assert table.column_names == list(COLUMNS)
    assert np.array_equal(table["vel_n_mps"].to_numpy(), solution.vel_n[:, 0])
    read = read_solution_csv(tmp_path / "solution.parquet")
    assert np.array_equal(read.t_ns, solution.t_ns)
    assert set(read.status) == {"updated", "predicted", "rejected"}


def test_a_folder_with_parquet_exports_like_one_with_csv(run_folder: Path, tmp_path: Path, solution: Solution) -> None:
    other = tmp_path / "other"
    other.mkdir()
    write_solution_parquet(other / "solution.parquet", solution)
    export(other, "csv", tmp_path / "back.csv")
    first, again = read_solution_csv(run_folder / "solution.csv"), read_solution_csv(tmp_path / "back.csv")
    assert np.array_equal(first.t_ns, again.t_ns)
    assert np.allclose(first.lla, again.lla, rtol=0, atol=1e-5)
    first_line = (run_folder / "solution.csv").read_text().splitlines()[1].split(",")
    assert (tmp_path / "back.csv").read_text().splitlines()[1].split(",")[2] == first_line[2]
    export(other, "parquet", tmp_path / "same.parquet")
    assert (tmp_path / "same.parquet").read_bytes() == (other / "solution.parquet").read_bytes()


def test_nmea_is_read_by_pynmeagps(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "nmea", run_folder / "out.nmea")
    with (run_folder / "out.nmea").open("rb") as file:
        sentences = [parsed for _, parsed in pynmeagps.NMEAReader(file, quitonerror=2)]
    fixes = [one for one in sentences if one.msgID == "GGA"]
    courses = [one for one in sentences if one.msgID == "RMC"]
    assert len(fixes) == len(courses) == len(solution)
    lla = np.array([[np.radians(one.lat), np.radians(one.lon), one.alt + float(one.sep)] for one in fixes])
    assert np.abs(ned_between(solution.lla, lla)).max() < 2e-3
    speed = np.array([float(one.spd) for one in courses]) * 1852 / 3600
    assert np.allclose(speed, np.hypot(*solution.vel_n[:, :2].T), atol=1e-3)
    utc = np.array([f"{one.date}T{one.time}" for one in courses], dtype="datetime64[ns]").astype(np.int64)
    assert np.abs(utc - utc_from_gps(solution.t_ns)).max() <= 1_000_000


def test_gpx_is_read_by_gpxpy(run_folder: Path, solution: Solution) -> None:
    export(run_folder, "gpx", run_folder / "out.gpx")
    (segment,) = gpxpy.parse((run_folder / "out.gpx").read_text()).tracks[0].segments
    lla = np.array([[np.radians(p.latitude), np.radians(p.longitude), p.elevation] for p in segment.points])
    assert np.abs(ned_between(solution.lla, lla)).max() < 1e-3
    seconds = np.array([p.time.timestamp() for p in segment.points])
    assert np.abs(seconds - utc_from_gps(solution.t_ns) / 1e9).max() < 1e-5


def test_smrmsg_stands_beside_the_sbet_row_by_row(run_folder: Path, solution: Solution) -> None:
    for format in ("sbet", "smrmsg"):
        export(run_folder, format, run_folder / format)
    sbet = np.fromfile(run_folder / "sbet", dtype="<f8").reshape(-1, 17)
    records = np.fromfile(run_folder / "smrmsg", dtype="<f8").reshape(-1, 10)
    assert np.array_equal(records[:, 0], sbet[:, 0])
    assert np.allclose(records[:, 1:7], solution.std[:, :6], rtol=1e-5)
    assert np.allclose(records[:, 9] / 60, np.degrees(euler_std(solution.q_nb, solution.cov[:, 6:9, 6:9]))[:, 2], rtol=1e-4)
