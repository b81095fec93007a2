"""Angles in the unit that suits their size: degrees, or arcseconds where these are the scale."""

from dataclasses import replace
from math import degrees

import numpy as np

from navreplay.evaluation.metrics import ErrorSeries
from navreplay.solution import InnovationSeries
from navreplay.timeline import Floats

__all__ = ["suit_errors", "suit_innovations", "suit_unit"]

_SMALL_DEG = 0.01


def suit_unit(unit: str, size: float) -> tuple[float, str]:
    """Factor and name of the unit in which to show values of a usual size in unit: angles in degrees, small ones in arcseconds;
    others as they are."""
    if unit not in ("rad", "deg"):
        return 1.0, unit
    factor = degrees(1.0) if unit == "rad" else 1.0
    return (3600 * factor, "arcsec") if size * factor < _SMALL_DEG else (factor, "deg")


def suit_errors(series: ErrorSeries) -> ErrorSeries:
    """The errors in the unit that suits them."""
    factor, unit = suit_unit(series.unit, _middle(series.error))
    return replace(series, unit=unit, error=series.error * factor, std=series.std * factor)


def suit_innovations(series: InnovationSeries) -> InnovationSeries:
    """The innovations and their noise in the unit that suits them."""
    factor, unit = suit_unit(series.unit, _middle(series.residual))
    scaled = {name: getattr(series, name) * factor for name in ("residual", "std", "noise_std", "nominal_std")}
    return replace(series, unit=unit, **scaled)


def _middle(values: Floats) -> float:
    return float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else np.inf
