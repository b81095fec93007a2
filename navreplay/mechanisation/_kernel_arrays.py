"""What the kernels take and fill, as tuples of arrays with names."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["Driving", "StepRows", "Sums"]


class StepRows(NamedTuple):
    """Steps: dt (s,) [s], dtheta (s, 3) [rad], dvel (s, 3) [m/s], and whether a gap of the IMU was bridged (s,)."""

    dt: Floats
    dtheta: Floats
    dvel: Floats
    bridged: NDArray[np.bool_]


class Driving(NamedTuple):
    """density (n,): of the driving white noise, in state units squared per second. tau (n - 9,): correlation times [s] of the
    sensor errors, inf for random walks."""

    density: Floats
    tau: Floats


class Sums(NamedTuple):
    """Integrals over a covariance step: of C_nb (3, 3), of specific force in n (3,), and of C_nb times the body's rate and
    specific force, axis by axis (3, 3)."""

    c_dt: Floats
    f_dt: Floats
    c_theta: Floats
    c_dvel: Floats
