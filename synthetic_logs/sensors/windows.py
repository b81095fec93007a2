"""Stretches of a log in which a figure is scaled."""

import numpy as np

from navreplay.timeline import Floats

__all__ = ["ScaledWindow", "scale_in"]

ScaledWindow = tuple[float, float, float]
"""Start and end [s from the start of the log, the end excluded], and the factor."""


def scale_in(windows: tuple[ScaledWindow, ...], t_s: Floats) -> Floats:
    """The factors (n,) at times t_s (n,) [s]; where windows overlap their product, outside 1."""
    scale = np.ones(len(t_s))
    for start, end, factor in windows:
        scale[(t_s >= start) & (t_s < end)] *= factor
    return scale
