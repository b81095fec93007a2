"""Positions of messages in another unit than their type promises, told by their values: radians, degrees and minutes, 1e-7
degrees.

What is no place on Earth in degrees has one other meaning at most. Radians have: read as degrees they all lie in the Gulf of
Guinea, where ships sail; but there they would move and scatter 57 times less than any receiver's positions do.
"""

import numpy as np

from importers.quantities import unit_factor
from importers.rows.field_names import guess_angle_unit
from navreplay.geodesy.earth import ned_between
from navreplay.timeline import Floats, Times

__all__ = ["mend_angles"]

_LEAST_ROWS = 10
_FASTEST = 350.0
_ROUGHEST = 30.0
"""Scatter of single fixes [m] beyond which they are no radians: those of a receiver scatter by metres."""


def mend_angles(name: str, t_ns: Times, lla: Floats) -> tuple[Floats, str]:
    """Positions (n, 3) [rad, rad, m] that were taken as degrees, in the unit that they are in, and a sentence on it."""
    known = np.isfinite(lla[:, :2]).all(axis=1) & lla[:, :2].any(axis=1)
    if known.sum() < _LEAST_ROWS:
        return lla, ""
    told = np.degrees(lla[:, :2])
    unit, reason = guess_angle_unit(*told[known].T)
    if unit == "deg":
        return lla, ""
    if unit == "ddmm":
        angles = np.copysign(np.radians(np.abs(told) // 100 + np.abs(told) % 100 / 60), told)
    else:
        angles = told * unit_factor(unit)
    mended = np.column_stack([angles, lla[:, 2]])
    if unit == "rad" and not _as_radians(t_ns[known], mended[known]):
        return lla, ""
    words = {"rad": "radians", "ddmm": "degrees and minutes written together", "1e-7 deg": "units of 1e-7 degrees"}[unit]
    example = told[np.flatnonzero(known)[0]]
    return mended, (
        f"{name}: latitude and longitude ({example[0]:.9g}, {example[1]:.9g} in the first row) are taken as {words}: {reason}"
    )


def _as_radians(t_ns: Times, lla: Floats) -> bool:
    """Whether positions read as radians move and scatter as those of a receiver."""
    order = np.argsort(t_ns, kind="stable")
    dt = np.diff(t_ns[order]) / 1e9
    steps = ned_between(lla[order][:-1], lla[order][1:])[:, :2][dt > 0] / dt[dt > 0, None]
    if len(steps) < _LEAST_ROWS or np.ptp(lla[:, 0]) == 0:
        return False
    place = np.cumsum(np.nan_to_num(steps * dt[dt > 0, None]), axis=0)
    rough = 1.4826 * float(np.median(np.abs(np.diff(place, 3, axis=0)))) / np.sqrt(20.0)
    return bool(np.quantile(np.linalg.norm(steps, axis=1), 0.95) < _FASTEST and rough < _ROUGHEST)
