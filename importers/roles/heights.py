"""Positions whose height is unknown: they still tell where the antenna is over ground."""

from dataclasses import replace

import numpy as np

from importers.rows.tables import Rows
from navreplay.options import FilterOptions
from navreplay.timeline import FixStatus

__all__ = ["fill_unknown_heights"]

_STD_BETWEEN_KNOWN = 100.0
_STD_WITHOUT_ANY = 1000.0


def fill_unknown_heights(rows: Rows) -> tuple[Rows, str]:
    """The rows with heights in place of unknown ones, too uncertain to count, and a sentence on it (empty where all are known).

    A height between known ones is interpolated, to 100 m; where none is known it is 0, to 1000 m. The horizontal accuracy stays
    as told, or is the default of the status.
    """
    if rows.lla is None:
        return rows, ""
    over_ground = np.isfinite(rows.lla[:, :2]).all(axis=1)
    missing = over_ground & ~np.isfinite(rows.lla[:, 2])
    if not missing.any():
        return rows, ""
    known = np.flatnonzero(np.isfinite(rows.lla).all(axis=1))
    lla = rows.lla.copy()
    lla[missing, 2] = np.interp(np.flatnonzero(missing), known, lla[known, 2]) if len(known) else 0.0
    cov = np.full((len(lla), 3, 3), np.nan) if rows.cov_pos is None else rows.cov_pos.copy()
    cov[missing] = _horizontal_only(rows, missing, _STD_BETWEEN_KNOWN if len(known) else _STD_WITHOUT_ANY)
    text = f"{int(missing.sum())} of {len(lla)} positions have no height; they count over ground only"
    return replace(rows, lla=lla, cov_pos=cov), text


def _horizontal_only(rows: Rows, missing: np.ndarray, height_std: float) -> np.ndarray:
    """Covariances (k, 3, 3) of the rows without height: their horizontal part, and a height of no weight."""
    default = FilterOptions().default_position_std
    status = np.zeros(int(missing.sum()), dtype=int) if rows.status is None else np.maximum(rows.status[missing], 0)
    std = np.array([default[kind.name][0] for kind in FixStatus])[status]
    cov = np.zeros((len(std), 3, 3))
    cov[:, 0, 0] = cov[:, 1, 1] = std**2
    if rows.cov_pos is not None:
        told = rows.cov_pos[missing][:, :2, :2]
        usable = np.isfinite(told).all(axis=(1, 2)) & (told[:, 0, 0] > 0) & (told[:, 1, 1] > 0)
        cov[usable, :2, :2] = told[usable]
    cov[:, 2, 2] = height_std**2
    return cov
