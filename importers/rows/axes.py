"""Axes of a sensor against those of the vehicle."""

import numpy as np

from navreplay.geodesy.rotation import matrix_from_euler
from navreplay.timeline import Floats

__all__ = ["axes_matrix"]

_UNIT_VECTORS = {"f": (1, 0, 0), "b": (-1, 0, 0), "r": (0, 1, 0), "l": (0, -1, 0), "d": (0, 0, 1), "u": (0, 0, -1)}


def axes_matrix(axes: str, mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Floats:
    """Matrix (3, 3) from sensor axes to vehicle axes (forward, right, down): relabelling by letters, then the mounting
    angles."""
    relabelled = np.array([_UNIT_VECTORS[letter] for letter in axes], dtype=np.float64).T
    return np.asarray(matrix_from_euler(*np.radians(mounting_deg)) @ relabelled)
