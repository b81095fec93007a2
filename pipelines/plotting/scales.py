"""Axes of plots: round ticks; linear, logarithmic and signed-logarithmic scales; lines thinned to what a screen can show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["Scale", "find_breaks", "log_ticks", "nice_ticks", "thin_band", "thin_line", "time_label", "time_ticks"]

_TIME_STEPS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400)


@dataclass(frozen=True, slots=True)
class Scale:
    """Values from low to high on a length of pixels. linear_to: None for a linear scale; else values are shown in proportion
    up to about this magnitude and by their logarithm beyond it (inverse hyperbolic sine); 0 for a logarithmic scale of values
    above zero."""

    low: float
    high: float
    pixels: float
    linear_to: float | None = None

    def place(self, values: Floats) -> Floats:
        """Pixels (n,) from the low end of values (n,)."""
        low, high = self._bend(np.array([self.low, self.high]))
        return np.asarray((self._bend(values) - low) / (high - low) * self.pixels)

    def _bend(self, values: Floats) -> Floats:
        if self.linear_to is None:
            return values
        return np.arcsinh(values / self.linear_to) if self.linear_to else np.log(values)

    def ticks(self, count: int) -> list[float]:
        """About count round values within the scale."""
        if self.linear_to is None:
            return nice_ticks(self.low, self.high, count)
        if not self.linear_to:
            return log_ticks(self.low, self.high, count)
        first, last = np.floor(np.log10(self.linear_to)) + 1, np.floor(np.log10(max(-self.low, self.high)))
        decades = 10.0 ** np.arange(last, first - 1, -max(1, np.ceil((last - first + 1) / max(count // 2, 1))))
        ticks = sorted([*-decades, 0.0, *decades])
        within = [tick for tick in ticks if self.low <= tick <= self.high]
        return within if len(within) > 2 else nice_ticks(self.low, self.high, count)


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten within low and high, about count of them."""
    raw = (high - low) / max(count, 1)
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw * 0.999)
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def log_ticks(low: float, high: float, count: int) -> list[float]:
    """Powers of ten within low and high, about count of them; with their double and fivefold where those are few."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    step = max(1, round((last - first) / max(count, 1)))
    for factors in ((1,), (1, 3), (1, 2, 5)):
        ticks = [float(f"{f}e{power}") for power in range(first, last + 1, step) for f in factors]
        within = [tick for tick in ticks if low <= tick <= high]
        if len(within) >= min(count, 3):
            return within
    return within if len(within) > 1 else nice_ticks(low, high, count)


def time_ticks(low: float, high: float, count: int) -> list[float]:
    """Round times [s] within low and high."""
    if high - low < count:
        return nice_ticks(low, high, count)
    step = next((s for s in _TIME_STEPS if (high - low) / s <= count), _TIME_STEPS[-1])
    return [float(k * step) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def time_label(seconds: float) -> str:
    """m:ss, or h:mm:ss from an hour on; plain seconds with decimals where there are any."""
    if seconds != int(seconds):
        return f"{seconds:g} s"
    minutes, second = divmod(int(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minutes}:{second:02d}"


def find_breaks(x: Floats) -> NDArray[np.intp]:
    """Indices of what begins behind a gap in rising x (n,): ten usual spacings and a hundredth of the whole. No line should
    lead across it."""
    steps = np.diff(x)
    if len(steps) < 2:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(steps > max(10 * float(np.median(steps)), float(x[-1] - x[0]) / 100)) + 1


def thin_line(x: Floats, y: Floats, bins: int = 700) -> tuple[Floats, Floats]:
    """At most two points per bin, the lowest and the highest in their order, so that no peak is lost; NaN rows left out."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) <= 2 * bins:
        return x, y
    starts = np.unique(np.searchsorted(x, np.linspace(x[0], x[-1], bins, endpoint=False)))
    group = np.repeat(np.arange(len(starts)), np.diff([*starts, len(x)]))
    order = np.lexsort((y, group))
    last = np.append(starts[1:], len(x)) - 1
    keep = np.unique(np.concatenate([order[starts], order[last], [0, len(x) - 1]]))
    return x[keep], y[keep]


def thin_band(x: Floats, low: Floats, high: Floats, bins: int = 350) -> tuple[Floats, Floats, Floats]:
    """The widest extent per bin; NaN rows left out."""
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    x, low, high = x[known], low[known], high[known]
    if len(x) <= 2 * bins:
        return x, low, high
    starts = np.unique(np.searchsorted(x, np.linspace(x[0], x[-1], bins, endpoint=False)))
    middle = (x[starts] + x[np.append(starts[1:], len(x)) - 1]) / 2
    middle[0], middle[-1] = x[0], x[-1]
    return middle, np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
