"""solution.csv: the trajectory as other programs read it (columns and digits in docs/report.md)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_week_tow, utc_from_gps, week_tow_from_gps
from navreplay.solution import RowStatus, Solution
from navreplay.timeline import Floats, LogError, Times
from pipelines.trajectory import _text_kernel

__all__ = [
    "COLUMNS",
    "SolutionTable",
    "euler_std",
    "find_solution",
    "read_columns",
    "read_solution_csv",
    "solution_columns",
    "utc_text",
    "write_plain",
    "write_solution_csv",
    "write_solution_parquet",
]

_DPH = np.degrees(3600)
_MG = 1 / 9.80665e-3

COLUMNS = {
    "gps_week": "%d",
    "gps_tow_s": "%d.%09d",
    "utc": "%s",
    "lat_deg": "%.11f",
    "lon_deg": "%.11f",
    "height_m": "%.5f",
    "vel_n_mps": "%.6f",
    "vel_e_mps": "%.6f",
    "vel_d_mps": "%.6f",
    "roll_deg": "%.7f",
    "pitch_deg": "%.7f",
    "yaw_deg": "%.7f",
    "std_n_m": "%.6g",
    "std_e_m": "%.6g",
    "std_d_m": "%.6g",
    "std_vn_mps": "%.6g",
    "std_ve_mps": "%.6g",
    "std_vd_mps": "%.6g",
    "std_roll_deg": "%.6g",
    "std_pitch_deg": "%.6g",
    "std_yaw_deg": "%.6g",
    "gyro_bias_x_dph": "%.6f",
    "gyro_bias_y_dph": "%.6f",
    "gyro_bias_z_dph": "%.6f",
    "accel_bias_x_mg": "%.6f",
    "accel_bias_y_mg": "%.6f",
    "accel_bias_z_mg": "%.6f",
    "status": "%s",
}
"""Column names in order, with their formats: a latitude to a micrometre, a time of week to a nanosecond."""

_STATUS_NAMES = {int(status): status.name.lower() for status in sorted(RowStatus)}
_LARGEST = 1e8
"""Of any number: beyond it a double has not all the decimals that are written."""
_LINES, _LONGEST_LINE = 8192, 1024
_DAY_US = 86_400_000_000
_NUMBERS = tuple(name for name in COLUMNS if name not in ("gps_week", "gps_tow_s", "utc", "status"))

_DECIMALS = np.array([-6 if COLUMNS[name] == "%.6g" else int(COLUMNS[name][2:-1]) for name in _NUMBERS])
"""After the point, or significant digits below zero."""


@dataclass(frozen=True, eq=False, slots=True)
class SolutionTable:
    """A solution.csv read back. t_ns: (k,) GPS time. lla: (k, 3) [rad, rad, m]. vel_n: (k, 3) [m/s]. rpy: (k, 3) roll, pitch,
    yaw [rad]. std: (k, 9) position [m], velocity [m/s], roll, pitch, yaw [rad]. gyro_bias: (k, 3) [rad/s]. accel_bias:
    (k, 3) [m/s^2]. status: k names."""

    t_ns: Times
    lla: Floats
    vel_n: Floats
    rpy: Floats
    std: Floats
    gyro_bias: Floats
    accel_bias: Floats
    status: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t_ns)


def utc_text(t_ns: Times) -> list[str]:
    """GPS times (k,) as ISO 8601 in UTC, to the microsecond."""
    utc = np.asarray(utc_from_gps(t_ns)).astype("datetime64[ns]").astype("datetime64[us]")
    return [f"{text}Z" for text in np.datetime_as_string(utc).tolist()]


def euler_std(q_nb: Floats, cov: Floats) -> Floats:
    """Standard deviations (k, 3) of roll, pitch, yaw [rad] from the covariance (k, 3, 3) of the rotation vector in n.

    First order; next to a pitch of 90 degrees, where roll and yaw lose their meaning, they are held finite.
    """
    _, pitch, yaw = np.moveaxis(euler_from_quat(q_nb), -1, 0)
    cosine = np.maximum(np.cos(pitch), 1e-3)
    zero = np.zeros_like(yaw)
    along = np.stack([np.cos(yaw), np.sin(yaw), zero], axis=1) / cosine[:, None]
    across = np.stack([-np.sin(yaw), np.cos(yaw), zero], axis=1)
    down = np.sin(pitch)[:, None] * along + np.array([0.0, 0.0, 1.0])
    jacobian = np.stack([along, across, down], axis=1)
    return np.asarray(np.sqrt(np.einsum("kij,kjl,kil->ki", jacobian, cov, jacobian)))


def _number_columns(solution: Solution) -> Floats:
    return np.concatenate(
        [
            np.degrees(solution.lla[:, :2]),
            solution.lla[:, 2:],
            solution.vel_n,
            np.degrees(euler_from_quat(solution.q_nb)),
            solution.std[:, :6],
            np.degrees(euler_std(solution.q_nb, solution.cov[:, 6:9, 6:9])),
            solution.gyro_bias * _DPH,
            solution.accel_bias * _MG,
        ],
        axis=1,
    )


def solution_columns(solution: Solution) -> dict[str, np.ndarray]:
    """The columns of solution.csv but utc, each (k,), as numbers and names."""
    week, tow = week_tow_from_gps(solution.t_ns)
    status = np.array(list(_STATUS_NAMES.values()), dtype=object)[np.searchsorted(list(_STATUS_NAMES), solution.status)]
    numbers = dict(zip(_NUMBERS, _number_columns(solution).T, strict=True))
    return {"gps_week": np.asarray(week), "gps_tow_s": np.asarray(tow), **numbers, "status": status}


def write_solution_csv(path: Path, solution: Solution) -> None:
    """Writes the solution, the same bytes for the same solution."""
    numbers = _number_columns(solution)
    # NaN and what has more digits than a double are rare, and the plain way knows them
    if not (np.abs(numbers) < _LARGEST).all():
        write_plain(path, solution)
        return
    week, tow, status = _whole_columns(solution)
    names = np.array([name.encode() for name in _STATUS_NAMES.values()])
    codes = np.searchsorted(list(_STATUS_NAMES), status)
    microseconds = np.asarray(utc_from_gps(solution.t_ns)) // 1000
    day, time = np.divmod(microseconds, _DAY_US)
    each, days = np.unique(day, return_inverse=True)
    dates = np.datetime_as_string(each.astype("datetime64[D]")).astype("S10")
    letters = [part.view(np.uint8).reshape(len(part), -1) for part in (dates, names)]
    text = np.empty(_LINES * _LONGEST_LINE, dtype=np.uint8)
    with path.open("wb") as file:
        file.write((",".join(COLUMNS) + "\n").encode())
        for first in range(0, len(solution), _LINES):
            rows = slice(first, first + _LINES)
            whole = week[rows], tow[rows], days[rows], letters[0], time[rows]
            length = _text_kernel.put_rows(*whole, numbers[rows], _DECIMALS, codes[rows], letters[1], text)
            file.write(text[:length].data)


def write_plain(path: Path, solution: Solution) -> None:
    """The same by the formats of `COLUMNS`, row by row."""
    week, tow, codes = _whole_columns(solution)
    second, nanosecond = np.divmod(tow, 1_000_000_000)
    status = [_STATUS_NAMES[code] for code in codes.tolist()]
    numbers = _number_columns(solution).T.tolist()
    columns = [week.tolist(), second.tolist(), nanosecond.tolist(), utc_text(solution.t_ns), *numbers, status]
    line = ",".join(COLUMNS.values()) + "\n"
    with path.open("w", encoding="ascii", newline="") as file:
        file.write(",".join(COLUMNS) + "\n")
        file.writelines(line % row for row in zip(*columns, strict=True))


def _whole_columns(solution: Solution) -> tuple[Times, Times, np.ndarray]:
    """Week, nanoseconds of the week and code of the status, (k,) each."""
    week = np.asarray(week_tow_from_gps(solution.t_ns)[0]).astype(np.int64)
    return week, solution.t_ns - gps_from_week_tow(week, np.zeros(len(week))), solution.status


def find_solution(folder: Path) -> Path:
    """Where the solution is that a run left in its folder, in either format."""
    other = folder / "solution.parquet"
    return other if other.exists() and not (folder / "solution.csv").exists() else folder / "solution.csv"


def write_solution_parquet(path: Path, solution: Solution) -> None:
    """Writes the columns of solution.csv with all their digits, utc as a timestamp."""
    columns = solution_columns(solution)
    utc = np.asarray(utc_from_gps(solution.t_ns)).astype("datetime64[ns]").astype("datetime64[us]")
    special = {"utc": pa.array(utc, pa.timestamp("us", tz="UTC"))}
    parquet.write_table(pa.table({name: special[name] if name in special else columns[name] for name in COLUMNS}), path)


def read_columns(path: Path) -> tuple[Times, dict[str, np.ndarray]]:
    """Times (k,) [GPS ns] and the columns but utc of a solution.csv. Raises LogError as `read_solution_csv`."""
    table = _read_table(path)
    columns = {name: table[name].to_numpy(zero_copy_only=False) for name in COLUMNS if name != "utc"}
    return gps_from_week_tow(columns["gps_week"], columns["gps_tow_s"]), columns


def read_solution_csv(path: Path) -> SolutionTable:
    """Reads what `write_solution_csv` wrote. Raises LogError when the file is missing, empty or of another layout."""
    table = _read_table(path)
    values = np.stack([table[name].to_numpy() for name in _NUMBERS], axis=1)
    degrees = np.radians(values)
    return SolutionTable(
        t_ns=gps_from_week_tow(table["gps_week"].to_numpy(), table["gps_tow_s"].to_numpy()),
        lla=np.concatenate([degrees[:, :2], values[:, 2:3]], axis=1),
        vel_n=values[:, 3:6],
        rpy=degrees[:, 6:9],
        std=np.concatenate([values[:, 9:15], degrees[:, 15:18]], axis=1),
        gyro_bias=values[:, 18:21] / _DPH,
        accel_bias=values[:, 21:24] / _MG,
        status=tuple(table["status"].to_pylist()),
    )


def _read_table(path: Path) -> pa.Table:
    types = {name: pa.float64() for name in (*_NUMBERS, "gps_tow_s")} | {"gps_week": pa.int64(), "status": pa.string()}
    options = csv.ConvertOptions(column_types=types, include_columns=[name for name in COLUMNS if name != "utc"])
    try:
        if path.suffix == ".parquet":
            table = parquet.read_table(path, columns=list(types)).cast(pa.schema(types))
        else:
            table = csv.read_csv(path, convert_options=options)
    except OSError as error:
        raise LogError(f"{path}: cannot read the solution; is this folder what `navreplay run -o` wrote? ({error})") from error
    except (pa.ArrowInvalid, KeyError) as error:
        raise LogError(f"{path}: not a solution.csv of navreplay: {' '.join(str(error).split())}") from error
    if len(table) == 0:
        raise LogError(f"{path}: the solution holds no rows")
    return table
