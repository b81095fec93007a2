"""PVTGeodetic, PosCovGeodetic and VelCovGeodetic as fixes."""

import numpy as np
from numpy.typing import NDArray

from importers.rows.tables import NO_FIX, diagonal_covariance
from navreplay.timeline import FixStatus, Floats, Times

__all__ = ["POSITION_COVARIANCE", "SOLUTION", "VELOCITY_COVARIANCE", "known", "solutions", "status_of"]

SOLUTION = np.dtype(
    [("mode", "u1"), ("error", "u1"), ("lat", "<f8"), ("lon", "<f8"), ("height", "<f8"), ("undulation", "<f4")]
    + [("vel", "<f4", 3), ("course", "<f4"), ("clock", "<f8"), ("drift", "<f4"), ("time_system", "u1"), ("datum", "u1")]
    + [("satellites", "u1"), ("corrections", "u1"), ("reference", "<u2"), ("age", "<u2"), ("signals", "<u4"), ("alert", "u1")]
    + [("bases", "u1"), ("ppp", "<u2"), ("latency", "<u2"), ("accuracy", "<u2", 2)]
)
"""vel: north, east, up [m/s]. accuracy: horizontal (twice the RMS distance) and vertical (95 %) [cm]."""
_COVARIANCE = [("mode", "u1"), ("error", "u1"), ("variance", "<f4", 4), ("covariance", "<f4", 6)]
POSITION_COVARIANCE = np.dtype(_COVARIANCE)
VELOCITY_COVARIANCE = np.dtype(_COVARIANCE)
"""variance: of latitude, longitude, height and clock. covariance: lat-lon, lat-height, lat-clock, lon-height, lon-clock,
height-clock; of velocity north, east, up and drift likewise."""
_UNKNOWN, _UNKNOWN_U2 = -2e10, 65_535
_MODES = {
    1: int(FixStatus.SINGLE), 2: int(FixStatus.DIFFERENTIAL), 3: int(FixStatus.FIXED), 4: int(FixStatus.FIXED),
    5: int(FixStatus.FLOAT), 6: int(FixStatus.DIFFERENTIAL), 7: int(FixStatus.FIXED), 8: int(FixStatus.FLOAT),
    10: int(FixStatus.FLOAT),
}  # fmt: skip
"""Kind of fix of each mode; precise point positioning counts as float."""
_UP_TO_DOWN = np.array([1.0, 1.0, -1.0])


def known(values: np.ndarray) -> Floats:
    """Values (...) with NaN where the receiver does not tell them."""
    values = values.astype(np.float64)
    return np.where(values > _UNKNOWN / 2, values, np.nan)


def status_of(mode: NDArray[np.uint8], error: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Kinds of fix (n,) of modes and errors (n,)."""
    status = np.array([_MODES.get(code, NO_FIX) for code in range(16)], dtype=np.int8)[mode & 15]
    return np.where(error == 0, status, NO_FIX).astype(np.int8)


def solutions(
    own: tuple[NDArray[np.void], Times], position: tuple[NDArray[np.void], Times], velocity: tuple[NDArray[np.void], Times]
) -> dict[str, np.ndarray]:
    """Columns of PVTGeodetic (n,) with the covariances of the blocks of the same epochs."""
    rows, t_ns = own
    accuracy = np.where(rows["accuracy"] == _UNKNOWN_U2, np.nan, rows["accuracy"] * 0.01)
    horizontal, vertical = accuracy[:, 0] / np.sqrt(8), accuracy[:, 1] / 2
    cov_pos = diagonal_covariance(np.column_stack([horizontal, horizontal, vertical]))
    cov_vel = np.full((len(rows), 3, 3), np.nan)
    for into, (other, other_ns) in ((cov_pos, position), (cov_vel, velocity)):
        _, here, there = np.intersect1d(t_ns, other_ns, return_indices=True)
        into[here] = _matrices(other[there])
    return {
        "t_gps_ns": t_ns,
        "lla": np.column_stack([known(rows[name]) for name in ("lat", "lon", "height")]),
        "vel_n": known(rows["vel"]) * _UP_TO_DOWN,
        "cov_pos": cov_pos,
        "cov_vel": cov_vel,
        "status": status_of(rows["mode"], rows["error"]),
    }


def _matrices(rows: NDArray[np.void]) -> Floats:
    """Covariances (n, 3, 3) north, east, down."""
    variance, covariance = known(rows["variance"]), known(rows["covariance"])
    cov = np.zeros((len(rows), 3, 3))
    cov[:, range(3), range(3)] = variance[:, :3]
    for (i, j), place in (((0, 1), 0), ((0, 2), 1), ((1, 2), 3)):
        cov[:, i, j] = cov[:, j, i] = covariance[:, place]
    return cov * np.outer(_UP_TO_DOWN, _UP_TO_DOWN)
