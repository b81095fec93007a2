"""launch.csv: the trajectory in the launch-inertial frame, beside the usual columns of solution.csv."""

from pathlib import Path

import numpy as np

from navreplay.error_models.launch_inertial import exchange_errors
from navreplay.geodesy.launch_frame import LaunchFrame
from navreplay.options import LaunchOptions
from navreplay.solution import Solution
from navreplay.timeline import ImuSeries

__all__ = ["LAUNCH_COLUMNS", "write_launch_csv"]

LAUNCH_COLUMNS = {
    "since_launch_s": "%.9f",
    **{f"{axis}_m": "%.5f" for axis in "xyz"},
    **{f"v{axis}_mps": "%.6f" for axis in "xyz"},
    **{f"q_lb_{part}": "%.12f" for part in "wxyz"},
    **{f"std_{axis}_m": "%.6g" for axis in "xyz"},
    **{f"std_v{axis}_mps": "%.6g" for axis in "xyz"},
    **{f"std_phi_{axis}_arcsec": "%.6g" for axis in "xyz"},
}
"""Column names in order, with their formats: x downrange, y up, z to the right; phi is the rotation vector about these axes."""

_ARCSEC = np.degrees(3600)


def write_launch_csv(path: Path, solution: Solution, imu: ImuSeries, launch: LaunchOptions) -> None:
    """Writes a row per row of the solution; launch counts from the first sample of imu."""
    frame = LaunchFrame(launch.position, launch.azimuth)
    elapsed = (solution.t_ns - imu.t_ns[0]) / 1e9 - launch.after
    state = frame.from_earth(elapsed, solution.lla, solution.vel_n, solution.q_nb)
    there = exchange_errors(frame, elapsed, solution.lla, solution.vel_n)[0][:, :9, :9]
    std = np.sqrt(np.einsum("kij,kjl,kil->ki", there, solution.cov[:, :9, :9], there))
    std[:, 6:] *= _ARCSEC
    rows = np.hstack([elapsed[:, None], state.position, state.velocity, state.q_lb, std])
    np.savetxt(path, rows, ",".join(LAUNCH_COLUMNS.values()), header=",".join(LAUNCH_COLUMNS), comments="", encoding="ascii")
