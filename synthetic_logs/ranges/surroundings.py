"""What stands around a road: streets between buildings and foliage, as they act on satellite signals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["Surroundings", "figure_at", "is_blocked", "visit_at"]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """A stretch from start to end [s since the start of the log, the end excluded] that is not open sky.

    roof_elevation [rad]: of the roofs straight across the street; towards its ends they sink (see `is_blocked`). attenuation
    [dB]: mean loss, exponentially distributed and correlated in time. multipath_std [m], rate_multipath_std [m/s]: Gauss-Markov
    errors of each satellite. reflected_share: of the blocked satellites, how many are still received by reflection, with
    reflected_attenuation [dB], a range too long by reflected_bias [m] on average (exponentially distributed, correlated in
    time) and an additional correlated rate error of reflected_rate_std [m/s]. outlier_probability: share of observations with
    an additional independent error of outlier_std [m] and outlier_rate_std [m/s].
    """

    start: float
    end: float
    roof_elevation: float = 0.0
    attenuation: float = 0.0
    multipath_std: float = 0.0
    rate_multipath_std: float = 0.0
    reflected_share: float = 0.0
    reflected_attenuation: float = 0.0
    reflected_bias: float = 0.0
    reflected_rate_std: float = 0.0
    outlier_probability: float = 0.0
    outlier_std: float = 0.0
    outlier_rate_std: float = 0.0


def visit_at(surroundings: tuple[Surroundings, ...], t_s: Floats) -> NDArray[np.intp]:
    """Which of the surroundings, counted from 1, holds at times t_s (n,) [s]; 0 is open sky."""
    visits = np.zeros(len(t_s), dtype=np.intp)
    for number, place in enumerate(surroundings, start=1):
        visits[(t_s >= place.start) & (t_s < place.end)] = number
    return visits


def figure_at(surroundings: tuple[Surroundings, ...], name: str, t_s: Floats) -> Floats:
    """One figure of the surroundings at times t_s (n,) [s], zero under open sky."""
    figures = np.array([0.0, *(getattr(place, name) for place in surroundings)])
    return figures[visit_at(surroundings, t_s)]


def is_blocked(azimuth: Floats, elevation: Floats, course: Floats, roof_elevation: Floats) -> NDArray[np.bool_]:
    """Whether a line of sight at azimuth, elevation (k,) [rad] ends in the walls of a straight street along course (k,) [rad],
    whose roofs stand at roof_elevation (k,) [rad] straight across; zero is no wall."""
    return np.tan(elevation) < np.tan(roof_elevation) * np.abs(np.sin(azimuth - course))
