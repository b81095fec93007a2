"""The trajectory of a finished run in the formats of other programs (what each holds: docs/export.md)."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import (
    enu_from_ned,
    frd_ned_from_flu_enu,
    matrix_from_quat,
    quat_from_euler,
    scalar_last_from_first,
)
from navreplay.geodesy.time_scales import utc_from_gps, week_tow_from_gps
from navreplay.timeline import Floats, LogError
from pipelines.files.whole_file import write_whole
from pipelines.trajectory.sentences import write_gpx, write_nmea, write_smrmsg
from pipelines.trajectory.solution_csv import SolutionTable, find_solution, read_solution_csv, utc_text

__all__ = ["EXPORT_FORMATS", "export"]

Writer = Callable[[Path, SolutionTable], None]
_POS_HEADER = (
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,7:dead reckoning,ns=# of satellites)\n"
    "%  GPST              latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)"
    "  sdun(m) age(s)  ratio   vn(m/s)   ve(m/s)   vu(m/s)     sdvn     sdve     sdvu    sdvne    sdveu    sdvun\n"
)
_KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Document><name>{name}</name>
<Style id="track"><LineStyle><color>ffeb6325</color><width>3</width></LineStyle></Style>
<Placemark><name>{name}</name><styleUrl>#track</styleUrl><gx:Track><altitudeMode>clampToGround</altitudeMode>
{whens}
{coordinates}
</gx:Track></Placemark></Document></kml>
"""


def export(out_dir: Path, format: str, path: Path) -> None:
    """Writes the trajectory of the run in out_dir to path in one of `EXPORT_FORMATS`.

    Raises LogError for an unknown format, a folder without a readable solution, or a path that cannot be written.
    """
    if format not in EXPORT_FORMATS:
        raise LogError(f"--format {format}: not an export format; there are {', '.join(EXPORT_FORMATS)}")
    solution = find_solution(out_dir)
    table = read_solution_csv(solution)
    try:
        if f".{format}" == solution.suffix:
            write_whole(path, lambda part: shutil.copyfile(solution, part))
        elif format == "csv":
            write_whole(path, lambda part: _write_csv(part, solution))
        elif format == "parquet":
            write_whole(path, lambda part: _write_parquet(part, solution))
        else:
            write_whole(path, lambda part: _WRITERS[format](part, table))
    except OSError as error:
        raise LogError(f"{path}: cannot write the export: {error.strerror or error}; choose another -o") from error


def _poses(table: SolutionTable) -> tuple[Floats, Floats]:
    """Position (k, 3) east, north, up of the first row [m] and quaternion (k, 4) of the forward-left-up body in that frame."""
    position = enu_from_ned(ned_between(table.lla[0], table.lla))
    return position, frd_ned_from_flu_enu(quat_from_euler(*table.rpy.T))


def _write_tum(path: Path, table: SolutionTable) -> None:
    position, q = _poses(table)
    seconds, nanoseconds = np.divmod(utc_from_gps(table.t_ns), 1_000_000_000)
    rows = np.concatenate([position, scalar_last_from_first(q)], axis=1).tolist()
    line = "%d.%09d" + " %.5f" * 3 + " %.9f" * 4 + "\n"
    times = zip(seconds.tolist(), nanoseconds.tolist(), strict=True)
    _write_lines(path, [line % (*time, *row) for time, row in zip(times, rows, strict=True)])


def _write_kitti(path: Path, table: SolutionTable) -> None:
    position, q = _poses(table)
    rows = np.concatenate([matrix_from_quat(q), position[:, :, None]], axis=2).reshape(-1, 12).tolist()
    line = " ".join(["%.9f"] * 12) + "\n"
    _write_lines(path, [line % tuple(row) for row in rows])


def _write_pos(path: Path, table: SolutionTable) -> None:
    week, tow = week_tow_from_gps(table.t_ns)
    degrees, std = np.degrees(table.lla[:, :2]), table.std
    quality = [7 if status in ("predicted", "rejected") else 5 for status in table.status]
    line = "%4d %13.6f %15.10f %15.10f %11.5f %3d %3d" + " %8.4f" * 6 + " %6.2f %6.1f" + " %9.5f" * 3 + " %8.5f" * 6 + "\n"
    columns = (week, tow, degrees[:, 0], degrees[:, 1], table.lla[:, 2], *std[:, :6].T, *(table.vel_n * [1, 1, -1]).T)
    lines = [_POS_HEADER]
    for values, q in zip(zip(*[column.tolist() for column in columns], strict=True), quality, strict=True):
        where, spread, velocity = values[:5], values[5:11], values[11:]
        lines.append(line % (*where, q, 0, *spread[:3], 0, 0, 0, 0, 0, *velocity, *spread[3:], 0, 0, 0))
    _write_lines(path, lines)


def _write_sbet(path: Path, table: SolutionTable) -> None:
    _, tow = week_tow_from_gps(table.t_ns)
    records = np.zeros((len(table), 17), dtype="<f8")
    records[:, 0], records[:, 1:4], records[:, 4:7], records[:, 7:10] = tow, table.lla, table.vel_n, table.rpy
    path.write_bytes(records.tobytes())


def _write_kml(path: Path, table: SolutionTable) -> None:
    whens = "\n".join([f"<when>{text}</when>" for text in utc_text(table.t_ns)])
    rows = np.concatenate([np.degrees(table.lla[:, 1::-1]), table.lla[:, 2:]], axis=1).tolist()
    coordinates = "\n".join([f"<gx:coord>{lon:.9f} {lat:.9f} {height:.4f}</gx:coord>" for lon, lat, height in rows])
    path.write_text(_KML.format(name="navreplay trajectory", whens=whens, coordinates=coordinates), encoding="utf-8")


def _write_geojson(path: Path, table: SolutionTable) -> None:
    coordinates = np.concatenate([np.degrees(table.lla[:, 1::-1]), table.lla[:, 2:]], axis=1)
    feature = {
        "type": "Feature",
        "properties": {"name": "navreplay trajectory", "coordTimes": utc_text(table.t_ns)},
        "geometry": {"type": "LineString", "coordinates": [[round(x, 9) for x in row] for row in coordinates.tolist()]},
    }
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}), encoding="utf-8")


def _write_parquet(path: Path, solution: Path) -> None:
    types = {"utc": pa.timestamp("us", tz="UTC"), "gps_week": pa.int32()}
    parquet.write_table(csv.read_csv(solution, convert_options=csv.ConvertOptions(column_types=types)), path)


def _write_csv(path: Path, solution: Path) -> None:
    """Of a solution.parquet, with all its digits."""
    table = parquet.read_table(solution)
    utc = pa.array(np.char.add(np.datetime_as_string(table["utc"].to_numpy().astype("datetime64[us]")), "Z"))
    table = table.set_column(table.column_names.index("utc"), "utc", utc)
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        csv.write_csv(table, file, csv.WriteOptions(include_header=False, quoting_style="none"))


def _write_lines(path: Path, lines: list[str]) -> None:
    with path.open("w", encoding="ascii", newline="") as file:
        file.writelines(lines)


_WRITERS: dict[str, Writer] = {
    "tum": _write_tum,
    "kitti": _write_kitti,
    "kml": _write_kml,
    "geojson": _write_geojson,
    "pos": _write_pos,
    "sbet": _write_sbet,
    "smrmsg": write_smrmsg,
    "nmea": write_nmea,
    "gpx": write_gpx,
}
EXPORT_FORMATS = {
    "csv": "solution.csv as it is, or the same columns from solution.parquet",
    "parquet": "the columns of solution.csv in Apache Parquet",
    "tum": "TUM trajectory: UTC seconds, east, north, up of the first row, quaternion of the forward-left-up body",
    "kitti": "KITTI odometry poses, 3 x 4 matrices in the frame of tum, without times",
    "kml": "KML track with times for Google Earth",
    "geojson": "GeoJSON line with times",
    "pos": "RTKLIB .pos with velocities",
    "sbet": "Applanix SBET, smoothed best estimate of trajectory",
    "smrmsg": "the standard deviations that belong to an SBET",
    "nmea": "NMEA 0183, GGA and RMC per row",
    "gpx": "GPX 1.1 track with times",
}
"""Export formats, a line each."""
