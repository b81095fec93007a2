"""Mean errors of all arms of an experiment with their intervals, as papers show them in bars."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from pipelines.plotting.plot import Plot
from pipelines.plotting.scales import Scale

__all__ = ["draw_means"]

_WIDTH, _LEFT, _RIGHT = 520.0, 150.0, 10.0
_ROW, _HEAD, _FOOT = 15.0, 20.0, 22.0
_WIDE_RANGE = 20.0
"""Beyond this ratio of the largest to the smallest mean the axis is logarithmic."""
_QUANTITIES = ("position", "velocity", "attitude")


@dataclass(frozen=True, slots=True)
class _Row:
    """An arm's mean with half its interval, and what was published for it (NaN: nothing)."""

    label: str
    mean: float
    half_width: float
    published: float


def draw_means(report: Mapping[str, Any]) -> list[Plot]:
    """A plot for each stretch of an experiment: a block for each quantity, a row for each arm."""
    plots = []
    for stretch in report["stretches"]:
        blocks = {f"{quantity} [{report['units'][quantity]}]": _rows(report, stretch, quantity) for quantity in _QUANTITIES}
        published = any(np.isfinite(row.published) for rows in blocks.values() for row in rows)
        note = f"Root mean square of the 3-D error: mean over {len(report['seeds'])} seeds with its 95 % interval."
        legend = (("dots c1", "mean"), *([("crosses bad", "published")] if published else []))
        plots.append(Plot(f"Mean errors, {stretch}", note, legend, _draw(blocks)))
    return plots


def _rows(report: Mapping[str, Any], stretch: str, quantity: str) -> list[_Row]:
    published: dict[str, float] = {}
    for row in report["published"]:
        if row["stretch"] == stretch and row["quantity"] == quantity:
            published |= row["figures"]
    rows = []
    for label, arm in report["arms"].items():
        interval = arm["stretches"][stretch]["rmse"][quantity]
        if interval["mean"] is not None:
            rows.append(_Row(label, interval["mean"], interval["half_width"] or 0.0, published.get(label, np.nan)))
    return rows


def _draw(blocks: Mapping[str, Sequence[_Row]]) -> str:
    drawn, top = [], 0.0
    for title, rows in blocks.items():
        if rows:
            drawn.append(_draw_block(title, rows, top))
            top += _HEAD + _ROW * len(rows) + _FOOT
    return f'<svg class="plot" viewBox="0 0 {_WIDTH:g} {top:g}" role="img">{"".join(drawn)}</svg>'


def _draw_block(title: str, rows: Sequence[_Row], top: float) -> str:
    across = _axis(rows)
    upper, lower = top + _HEAD, top + _HEAD + _ROW * len(rows)
    parts = [f'<text class="label" x="{_LEFT + across.pixels / 2:.1f}" y="{top + 13:.1f}">{escape(title)}</text>']
    for tick in across.ticks(5):
        x = _LEFT + _place(across, tick)
        parts.append(f'<path class="grid" d="M{x:.1f} {upper:.1f}V{lower:.1f}"/>')
        parts.append(f'<text class="tick" x="{x:.1f}" y="{lower + 13:.1f}" text-anchor="middle">{tick:.6g}</text>')
    for index, row in enumerate(rows):
        y = upper + _ROW * (index + 0.5)
        low, mean, high = (
            _LEFT + _place(across, value) for value in (row.mean - row.half_width, row.mean, row.mean + row.half_width)
        )
        parts.append(f'<text class="tick" x="{_LEFT - 6}" y="{y + 3.5:.1f}" text-anchor="end">{escape(row.label)}</text>')
        parts.append(
            f'<path class="line c1" d="M{low:.1f} {y:.1f}H{high:.1f}M{low:.1f} {y - 3:.1f}v6M{high:.1f} {y - 3:.1f}v6"/>'
        )
        parts.append(f'<path class="dots c1" d="M{mean:.1f} {y:.1f}h0"/>')
        if np.isfinite(row.published):
            x = _LEFT + _place(across, row.published)
            parts.append(f'<path class="crosses bad" d="M{x - 3:.1f} {y - 3:.1f}l6 6m0-6l-6 6"/>')
    parts.append(f'<rect class="frame" x="{_LEFT}" y="{upper:.1f}" width="{across.pixels}" height="{lower - upper:.1f}"/>')
    return "".join(parts)


def _place(across: Scale, value: float) -> float:
    """Pixels from the left, at the edge for what lies beyond it."""
    return float(across.place(np.clip(np.array(value), across.low, across.high)))


def _axis(rows: Sequence[_Row]) -> Scale:
    """From zero, or logarithmic where means are far apart."""
    means = np.array([row.mean for row in rows])
    shown = np.concatenate([means, [row.mean + row.half_width for row in rows], [row.published for row in rows]])
    high = float(np.nanmax(shown))
    least = float(np.nanmin(np.concatenate([means, [row.published for row in rows]])))
    pixels = _WIDTH - _LEFT - _RIGHT
    if least > 0 and high > _WIDE_RANGE * least:
        return Scale(least / 1.5, high * 1.2, pixels, 0.0)
    return Scale(0.0, 1.06 * high or 1.0, pixels)
