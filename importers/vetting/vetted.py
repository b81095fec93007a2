"""What a comparison makes of fixes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.findings import Finding
from navreplay.timeline import GnssFixSeries, LogError

__all__ = ["Vetted", "drop"]


@dataclass(frozen=True, eq=False, slots=True)
class Vetted:
    """fixes: to use. findings: what was wrong. reason: in the accounting, of what was left out: rows_out whole rows of fixes
    with their velocity, positions_out and velocities_out of either part."""

    fixes: GnssFixSeries
    findings: tuple[Finding, ...] = ()
    reason: str = ""
    rows_out: int = 0
    positions_out: int = 0
    velocities_out: int = 0


def drop(fixes: GnssFixSeries, position: NDArray[np.bool_], velocity: NDArray[np.bool_]) -> GnssFixSeries:
    """fixes without the positions and velocities of the rows marked (n,); rows that hold nothing more go. Raises LogError where
    nothing is left."""
    lla, vel_n, cov_pos, cov_vel = (part.copy() for part in (fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel))
    lla[position], cov_pos[position] = np.nan, np.nan
    vel_n[velocity], cov_vel[velocity] = np.nan, np.nan
    kept = np.isfinite(lla).all(axis=1) | np.isfinite(vel_n).all(axis=1)
    if not kept.any():
        raise LogError(
            "fixes: none is left of those that repeat others or contradict them; look at them with `navreplay inspect`"
        )
    return GnssFixSeries(fixes.t_ns[kept], lla[kept], vel_n[kept], cov_pos[kept], cov_vel[kept], fixes.status[kept])
