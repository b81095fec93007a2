"""Rows: the messages of a channel in terms of navigation, before time bases, units and axes are settled."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["NO_FIX", "Frame", "Rows", "diagonal_covariance", "drop_absurd", "status_codes"]

NO_FIX = -1
"""Status of a row without a fix; others are of FixStatus."""

_ABSURD = 1e9

Frame = Literal["auto", "ned", "enu", "ecef"]


@dataclass(frozen=True, eq=False, slots=True)
class Rows:
    """What the messages of one channel say, each field (n, ...) or None where the type has no such field.

    gyro, accel: (n, 3) in the sensor's axes and units; sensor_axes: where those axes point unless told otherwise;
    units_known: they are rad/s and m/s^2 for certain; means: each sample is the mean over its interval. lla: (n, 3) [rad,
    rad, m], or local: (n, 3) east, north, up of a local origin [m]. vel: (n, 3) [m/s] in vel_frame. cov_pos: (n, 3, 3) NED.
    cov_vel: (n, 3, 3) in vel_frame. status: (n,) int8 of FixStatus or NO_FIX. q: (n, 4) scalar first, body to navigation
    or, where the type says so, q_frame; ros_attitude: of an FLU body in ENU instead of FRD in NED. cov_att: (n, 3, 3) of the
    rotation about the axes that q leads to [rad^2]. q_missing: (n,) rows that say that they have no orientation. wheels: (n, 3)
    speeds of all, left and right wheels [m/s], or ticks: (n, 3) their counts, NaN where there is none. turn: (n,) to the right
    [rad/s]. baro: (n,) height by pressure [m].
    """

    gyro: Floats | None = None
    accel: Floats | None = None
    sensor_axes: str = "frd"
    units_known: bool = True
    means: bool = False
    lla: Floats | None = None
    local: Floats | None = None
    vel: Floats | None = None
    vel_frame: Frame = "ned"
    cov_pos: Floats | None = None
    cov_vel: Floats | None = None
    status: NDArray[np.int8] | None = None
    q: Floats | None = None
    ros_attitude: bool = False
    q_frame: Literal["earth"] | None = None
    cov_att: Floats | None = None
    q_missing: NDArray[np.bool_] | None = None
    wheels: Floats | None = None
    ticks: Floats | None = None
    turn: Floats | None = None
    baro: Floats | None = None


def drop_absurd(values: Floats) -> Floats:
    """Values (...) with NaN in place of those beyond 1e9, which no position, velocity or accuracy reaches and whose squares
    overflow."""
    return np.where(np.abs(values) < _ABSURD, values, np.nan)


def diagonal_covariance(std: Floats) -> Floats:
    """Covariances (n, 3, 3) of standard deviations (n, 3); all NaN where one of them is NaN or zero (zero means unknown)."""
    std = drop_absurd(std)
    known = (std > 0).all(axis=1)
    cov = np.zeros((len(std), 3, 3))
    cov[:, range(3), range(3)] = std**2
    cov[~known] = np.nan
    return cov


def status_codes(values: np.ndarray, meaning: Mapping[str, int]) -> NDArray[np.int8]:
    """Status codes (n,) of texts or numbers (n,), by the text of each; 0 (unknown) where the text has no meaning."""
    if values.dtype.kind in "fiu":
        texts, inverse = np.unique(values, return_inverse=True)
        names = [f"{value:g}" for value in texts]
    else:
        texts, inverse = np.unique(values.astype(str), return_inverse=True)
        names = [str(value).strip() for value in texts]
    return np.array([meaning.get(name, 0) for name in names], dtype=np.int8)[inverse]
