"""Vertical velocity by a barometer: the slope of its height over two seconds, whose zero and slow drift do not matter.

A barometer's bias moves with weather, by a few metres in an hour, and its noise is white beside that. Slopes of windows that do
not overlap carry the height on from where fixes left it, and the error of their sum grows no faster than a filter that takes
them for independent believes.
"""

from typing import NamedTuple

import numpy as np

from navreplay.error_models.ned import VELOCITY
from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import BaroSeries, Floats, GnssFixSeries, Times
from navreplay.update.measurement import Measurement

__all__ = ["Climb", "climb_measurement", "find_climbs"]

_HALF_NS = 1_000_000_000
_FEWEST_SAMPLES = 4
_FEWEST_FIXES = 30
_LEAST_STD = 0.02
_MARGIN = 1.5
"""Over white noise, for what of it is not."""
_MOST_STD = 1.0
_SCALE_STD = 0.05
"""Of a height by the standard atmosphere, on a day that is not standard."""


class Climb(NamedTuple):
    """t_ns (e,): middles of windows. rate (e,): [m/s] upward. std (e,). text: how they were judged, or why there are none."""

    t_ns: Times
    rate: Floats
    std: Floats
    text: str


def find_climbs(baro: BaroSeries, fixes: GnssFixSeries) -> Climb:
    """Slopes of the barometer's height, with the deviation that the fixes' vertical velocity shows."""
    t_ns = np.arange(baro.t_ns[0] + _HALF_NS, baro.t_ns[-1] - _HALF_NS + 1, 2 * _HALF_NS, dtype=np.int64)
    rate = _slopes(baro, t_ns)
    t_ns, rate = t_ns[np.isfinite(rate)], rate[np.isfinite(rate)]
    known = fixes.has_velocity
    beside = _slopes(baro, fixes.t_ns[known]) + fixes.vel_n[known, 2]
    beside = beside[np.isfinite(beside)]
    none = np.empty(0)
    if len(beside) < _FEWEST_FIXES:
        text = f"the barometer is not used: {len(beside)} fixes with velocity beside it are too few to tell its noise"
        return Climb(np.empty(0, np.int64), none, none, text)
    scatter = 1.4826 * float(np.median(np.abs(beside - np.median(beside))))
    if scatter > _MOST_STD:
        text = f"the barometer is not used: it climbs {scatter:.2g} m/s otherwise than the fixes"
        return Climb(np.empty(0, np.int64), none, none, text)
    told = float(np.nanmedian(np.nan_to_num(fixes.cov_vel[known, 2, 2])))
    noise = max(np.sqrt(max(scatter**2 - told, 0.0)), _MARGIN * _slope_std(baro), _LEAST_STD)
    text = f"the barometer climbs as the fixes do within {scatter:.2g} m/s, of which {noise:.2g} are taken for its own"
    return Climb(t_ns, rate, np.hypot(noise, _SCALE_STD * rate), text)


def _slope_std(baro: BaroSeries) -> float:
    """Of a slope, by the white noise that second differences of height show."""
    if len(baro) < _FEWEST_SAMPLES:
        return 0.0
    white = 1.4826 * float(np.median(np.abs(np.diff(baro.height, 2)))) / np.sqrt(6)
    step = float(np.median(np.diff(baro.t_ns))) / 1e9
    samples = max(2 * _HALF_NS / 1e9 / step, _FEWEST_SAMPLES)
    return float(white * np.sqrt(12 / samples) / (2 * _HALF_NS / 1e9))


def _slopes(baro: BaroSeries, t_ns: Times) -> Floats:
    """(e,) [m/s] by least squares over a second on either side of each time; NaN where there are too few samples."""
    starts = np.searchsorted(baro.t_ns, t_ns - _HALF_NS)
    ends = np.searchsorted(baro.t_ns, t_ns + _HALF_NS, side="right")
    slopes = np.full(len(t_ns), np.nan)
    for i, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        arms = (baro.t_ns[start:end] - t_ns[i]) / 1e9
        if end - start >= _FEWEST_SAMPLES and arms[0] < 0 < arms[-1]:
            arms = arms - arms.mean()
            slopes[i] = arms @ baro.height[start:end] / (arms @ arms)
    return slopes


def climb_measurement(state: NavState, rate: float, std: float, size: int, kind: str) -> Measurement:
    """Vertical velocity rate [m/s] upward."""
    jacobian = np.zeros((1, size))
    jacobian[0, VELOCITY.start + 2] = 1.0
    return Measurement(np.array([-rate - state.vel_n[2]]), jacobian, np.array([[std**2]]), (kind,), ("down",))
