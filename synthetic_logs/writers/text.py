"""Writes a log, and the truth of any log, as CSV: GPS time in nanoseconds, degrees and SI units, an empty field for unknown.

Numbers have the fewest digits that read back to the same double.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from navreplay.timeline import AttitudeSeries, FixStatus, Floats, GnssFixSeries, ImuSeries, RangeSeries
from synthetic_logs.simulation import SyntheticLog

__all__ = ["write_csv", "write_imu", "write_truth"]


def write_csv(log: SyntheticLog, path: Path) -> None:
    """NAME.imu.csv, and NAME.fix.csv, NAME.attitude.csv and NAME.ranges.csv where the log has these, for the path NAME.csv."""
    write_imu(log.imu, path.with_suffix(".imu.csv"))
    if log.fixes is not None:
        _write_fixes(log.fixes, path.with_suffix(".fix.csv"))
    if log.attitude is not None:
        _write_attitudes(log.attitude, path.with_suffix(".attitude.csv"))
    if log.ranges is not None:
        _write_ranges(log.ranges, path.with_suffix(".ranges.csv"))


def write_imu(imu: ImuSeries, path: Path) -> None:
    """The samples of an IMU; columns have the prefix ``mean_`` where samples are means."""
    prefix = "mean_" if imu.increments else ""
    columns = {
        "t_gps_ns": imu.t_ns,
        **_columns([f"{prefix}gyro_{axis}_radps" for axis in "xyz"], imu.gyro),
        **_columns([f"{prefix}accel_{axis}_mps2" for axis in "xyz"], imu.accel),
    }
    _write_table(path, columns)


def _write_fixes(fixes: GnssFixSeries, path: Path) -> None:
    columns = {
        "t_gps_ns": fixes.t_ns,
        **_position_and_velocity(fixes.lla, fixes.vel_n),
        **_columns(["std_n_m", "std_e_m", "std_d_m"], _std(fixes.cov_pos)),
        **_columns(["std_vn_mps", "std_ve_mps", "std_vd_mps"], _std(fixes.cov_vel)),
        "status": np.array([FixStatus(status).name for status in fixes.status.tolist()]),
    }
    _write_table(path, columns)


def _write_attitudes(attitude: AttitudeSeries, path: Path) -> None:
    columns = {
        "t_gps_ns": attitude.t_ns,
        **_columns([f"q_eb_{part}" for part in "wxyz"], attitude.q),
        **_columns([f"std_{axis}_rad" for axis in "xyz"], _std(attitude.cov)),
    }
    _write_table(path, columns)


def _write_ranges(ranges: RangeSeries, path: Path) -> None:
    columns = {
        "t_gps_ns": ranges.t_ns,
        "sat": ranges.sat,
        "signal": ranges.signal,
        "pseudorange_m": ranges.pseudorange,
        "range_rate_mps": ranges.range_rate,
        "pseudorange_std_m": ranges.pseudorange_std,
        "range_rate_std_mps": ranges.range_rate_std,
        "cn0_dbhz": ranges.cn0,
        **_columns(["sat_x_m", "sat_y_m", "sat_z_m"], ranges.sat_pos_e),
        **_columns(["sat_vx_mps", "sat_vy_mps", "sat_vz_mps"], ranges.sat_vel_e),
    }
    _write_table(path, columns)


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
