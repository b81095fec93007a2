"""What a receiver saw along a solution: directions of satellites, what became of their ranges, dilution of precision."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy import earth
from navreplay.measurements.atmosphere import look_angles
from navreplay.measurements.range_epochs import clock_groups
from navreplay.solution import Solution
from navreplay.timeline import Floats, RangeSeries, Times

__all__ = ["Sky", "view_sky"]


@dataclass(frozen=True, eq=False, slots=True)
class Sky:
    """Rows (n,), one per satellite and epoch, in the order of time; and epochs (e,).

    t_ns, sat, elevation and azimuth [rad], cn0 [dB-Hz] (n,). judged: (n,) pseudoranges that came to the filter, which masks
    its rows before. used: (n,) and that it used. epoch_ns: (e,). used_count: (e,). dop: (e, 4) geometric, position, horizontal
    and vertical dilution of the satellites used (Groves 2013, 9.4.3), with a clock offset per constellation; NaN where they
    are too few for a position.
    """

    t_ns: Times
    sat: NDArray[np.str_]
    elevation: Floats
    azimuth: Floats
    cn0: Floats
    judged: NDArray[np.bool_]
    used: NDArray[np.bool_]
    epoch_ns: Times
    used_count: NDArray[np.intp]
    dop: Floats


def view_sky(ranges: RangeSeries, solution: Solution) -> Sky | None:
    """The sky over a solution that ranges aided; None where none of them did."""
    series = next((series for series in solution.innovations if series.kind == "range"), None)
    if series is None or not len(series.t_ns):
        return None
    names, satellite = np.unique(np.concatenate([ranges.sat, series.sources]), return_inverse=True)
    within = (ranges.t_ns > solution.t_ns[0]) & (ranges.t_ns <= solution.t_ns[-1])
    keys = _keys(ranges.t_ns, satellite[: len(ranges)], len(names), int(solution.t_ns[0]))
    rows = np.flatnonzero(within)
    rows = np.sort(rows[np.unique(keys[rows], return_index=True)[1]])
    judged_keys = _keys(series.t_ns, satellite[len(ranges) :], len(names), int(solution.t_ns[0]))
    elevation, azimuth = look_angles(_interpolate_lla(solution, ranges.t_ns[rows]), ranges.sat_pos_e[rows])
    used = np.isin(keys[rows], judged_keys[series.used])
    epoch_ns, epoch = np.unique(ranges.t_ns[rows], return_inverse=True)
    return Sky(
        t_ns=ranges.t_ns[rows],
        sat=ranges.sat[rows],
        elevation=elevation,
        azimuth=azimuth,
        cn0=ranges.cn0[rows],
        judged=np.isin(keys[rows], judged_keys),
        used=used,
        epoch_ns=epoch_ns,
        used_count=np.bincount(epoch[used], minlength=len(epoch_ns)),
        dop=_dilution(epoch[used], len(epoch_ns), ranges.sat[rows][used], elevation[used], azimuth[used]),
    )


def _keys(t_ns: Times, satellite: NDArray[np.intp], satellites: int, origin_ns: int) -> Times:
    """(k,) a number for each pair of time and satellite."""
    return np.asarray((t_ns - origin_ns) * satellites + satellite)


def _interpolate_lla(solution: Solution, t_ns: Times) -> Floats:
    """(k, 3) positions at t_ns (k,)."""
    pos_e = earth.ecef_from_lla(solution.lla)
    at, known = (t_ns - solution.t_ns[0]) / 1e9, (solution.t_ns - solution.t_ns[0]) / 1e9
    return earth.lla_from_ecef(np.stack([np.interp(at, known, pos_e[:, axis]) for axis in range(3)], axis=1))


def _dilution(epoch: NDArray[np.intp], epochs: int, sat: NDArray[np.str_], elevation: Floats, azimuth: Floats) -> Floats:
    """(epochs, 4) of rows (n,) that belong to epochs as counted by epoch (n,)."""
    groups, group = np.unique(clock_groups(sat), return_inverse=True)
    flat = np.cos(elevation)
    towards_n = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), -np.sin(elevation)], axis=1)
    design = np.concatenate([-towards_n, (group[:, None] == np.arange(len(groups))).astype(np.float64)], axis=1)
    size = design.shape[1]
    normal = np.empty((epochs, size, size))
    for i in range(size):
        for j in range(i, size):
            normal[:, i, j] = normal[:, j, i] = np.bincount(epoch, design[:, i] * design[:, j], minlength=epochs)
    seen = normal[:, range(3, size), range(3, size)]
    enough = seen.sum(axis=1) >= 3 + (seen > 0).sum(axis=1)
    normal[:, range(3, size), range(3, size)] += seen == 0
    variances = np.full((epochs, size), np.nan)
    regular = enough & (np.linalg.cond(normal) < 1e8)
    variances[regular] = np.diagonal(np.linalg.inv(normal[regular]), axis1=1, axis2=2)
    position = variances[:, :3].sum(axis=1)
    clocks = np.where(seen > 0, variances[:, 3:], 0.0).sum(axis=1)
    return np.sqrt(np.stack([position + clocks, position, variances[:, :2].sum(axis=1), variances[:, 2]], axis=1))
