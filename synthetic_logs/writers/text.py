"""Writes a log, and the truth of any log, as CSV: GPS time in nanoseconds, degrees and SI units, an empty field for unknown.

Numbers have the fewest digits that read back to the same double.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from navreplay.timeline import FixStatus, Floats
from synthetic_logs.simulation import SyntheticLog

__all__ = ["write_csv", "write_truth"]


def write_csv(log: SyntheticLog, path: Path) -> None:
    """NAME.imu.csv and NAME.fix.csv for the path NAME.csv. IMU columns have the prefix ``mean_`` where samples are means."""
    imu, fixes = log.imu, log.fixes
    prefix = "mean_" if imu.increments else ""
    imu_columns = {
        "t_gps_ns": imu.t_ns,
        **_columns([f"{prefix}gyro_{axis}_radps" for axis in "xyz"], imu.gyro),
        **_columns([f"{prefix}accel_{axis}_mps2" for axis in "xyz"], imu.accel),
    }
    _write_table(path.with_suffix(".imu.csv"), imu_columns)
    fix_columns = {
        "t_gps_ns": fixes.t_ns,
        **_position_and_velocity(fixes.lla, fixes.vel_n),
        **_columns(["std_n_m", "std_e_m", "std_d_m"], _std(fixes.cov_pos)),
        **_columns(["std_vn_mps", "std_ve_mps", "std_vd_mps"], _std(fixes.cov_vel)),
        "status": np.array([FixStatus(status).name for status in fixes.status.tolist()]),
    }
    _write_table(path.with_suffix(".fix.csv"), fix_columns)


def write_truth(log: SyntheticLog, path: Path) -> None:
    """The true motion of the IMU; its standard deviations stay empty."""
    truth = log.truth
    columns = {
        "t_gps_ns": truth.t_ns,
        **_position_and_velocity(truth.lla, truth.vel_n),
        **_columns([f"q_nb_{part}" for part in "wxyz"], truth.q_nb),
        **_columns(["std_n_m", "std_e_m", "std_d_m"], _std(truth.cov_pos)),
    }
    _write_table(path, columns)


def _position_and_velocity(lla: Floats, vel_n: Floats) -> dict[str, np.ndarray]:
    return {
        "lat_deg": np.degrees(lla[:, 0]),
        "lon_deg": np.degrees(lla[:, 1]),
        "height_m": lla[:, 2],
        **_columns(["vel_n_mps", "vel_e_mps", "vel_d_mps"], vel_n),
    }


def _columns(names: list[str], values: Floats) -> dict[str, np.ndarray]:
    return dict(zip(names, values.T, strict=True))


def _std(cov: Floats) -> Floats:
    return np.sqrt(np.diagonal(cov, axis1=1, axis2=2))


def _write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    table = pa.table({name: pa.array(np.ascontiguousarray(column), from_pandas=True) for name, column in columns.items()})
    with path.open("wb") as stream:
        stream.write((",".join(columns) + "\n").encode())
        csv.write_csv(table, stream, csv.WriteOptions(include_header=False, quoting_style="none"))
