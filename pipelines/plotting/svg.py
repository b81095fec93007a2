"""Small inline SVG drawings: stacked panels over a common time axis, and a map with equal scales."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal

import numpy as np

from navreplay.timeline import Floats
from pipelines.plotting.scales import Scale, find_breaks, nice_ticks, thin_band, thin_line, time_label, time_ticks

__all__ = ["SKY_HEIGHT", "Layer", "Panel", "draw_map", "draw_sky", "draw_time_panels", "map_height"]

_WIDTH = 520.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 66.0, 8.0, 9.0, 10.0
_MAP_BOTTOM = 34.0
_PANEL_HEIGHT, _GAP = 104.0, 12.0
_MOST_DOTS = 4000
_SKY_RADIUS, _SKY_MARGIN = 190.0, 22.0
SKY_HEIGHT = 2 * (_SKY_RADIUS + _SKY_MARGIN)
"""Of the drawing that `draw_sky` makes [px]."""


@dataclass(frozen=True, eq=False, slots=True)
class Layer:
    """One thing drawn. x: (n,). y: (n,). high: (n,) upper edge of a band whose lower edge is y. style: class of the style
    sheet. name: in the legend and in the readout."""

    kind: Literal["line", "band", "dots", "crosses"]
    x: Floats
    y: Floats
    style: str
    name: str
    high: Floats | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Panel:
    """A plot of layers. label: of the vertical axis. linear_to: see `Scale`; None for a linear axis, 0 for a logarithmic
    one."""

    label: str
    layers: tuple[Layer, ...]
    linear_to: float | None = None


def _points(x: Floats, y: Floats) -> str:
    return " ".join([f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True)])


def _trace(px: Floats, py: Floats) -> str:
    """Path of a line on a map, interrupted at NaN, without points less than half a pixel from their predecessor."""
    known = np.isfinite(px) & np.isfinite(py)
    cell = np.floor(2 * np.where(known[:, None], np.stack([px, py], axis=1), -1e6))
    keep = known & np.concatenate([[True], (np.diff(cell, axis=0) != 0).any(axis=1)])
    keep[-1:] = known[-1:]
    pieces = np.split(np.flatnonzero(keep), np.flatnonzero(np.diff(np.cumsum(~known)[keep])) + 1)
    return "".join([f"M{_points(px[piece], py[piece])}" for piece in pieces if len(piece)])


def _draw_layer(layer: Layer, across: Scale, up: Scale, x_ordered: bool = True) -> str:
    def down(values: Floats) -> Floats:
        """Pixels from the top, kept near the panel: browsers stumble over huge coordinates."""
        return np.clip(up.pixels - up.place(values), -2e3, 2e4)

    title = f' data-name="{escape(layer.name)}"'
    if layer.kind == "band" and layer.high is not None:
        x, low, high = thin_band(layer.x, layer.y, layer.high)
        if len(x) == 0:
            return ""
        px = across.place(x)
        outline = _points(np.concatenate([px, px[::-1]]), np.concatenate([down(low), down(high)[::-1]]))
        return f'<path class="band {layer.style}" d="M{outline}Z"/>'
    if layer.kind == "line" and not x_ordered:
        return f'<path class="line {layer.style}" d="{_trace(across.place(layer.x), down(layer.y))}"/>'
    if layer.kind == "line":
        known = np.isfinite(layer.x) & np.isfinite(layer.y)
        pieces = np.split(np.flatnonzero(known), find_breaks(layer.x[known]))
        thinned = (thin_line(layer.x[piece], layer.y[piece]) for piece in pieces if len(piece))
        path = "".join([f"M{_points(across.place(x), down(y))}" for x, y in thinned])
        return f'<path class="line {layer.style}"{title} d="{path}"/>' if path else ""
    known = np.flatnonzero(np.isfinite(layer.x) & np.isfinite(layer.y))
    known = known[:: len(known) // _MOST_DOTS + 1]
    px, py = across.place(layer.x[known]).tolist(), down(layer.y[known]).tolist()
    if layer.kind == "dots":
        path = "".join([f"M{a:.1f} {b:.1f}h0" for a, b in zip(px, py, strict=True)])
    else:
        path = "".join([f"M{a - 3:.1f} {b - 3:.1f}l6 6m0-6l-6 6" for a, b in zip(px, py, strict=True)])
    return f'<path class="{layer.kind} {layer.style}"{title} d="{path}"/>' if path else ""


def _log_extent(layers: Iterable[Layer]) -> tuple[float, float]:
    """What a logarithmic axis must show: every point, and never less than a factor of four."""
    values = np.concatenate([np.zeros(0), *(layer.y for layer in layers)])
    known = values[np.isfinite(values) & (values > 0)]
    if not len(known):
        return 0.1, 10.0
    low, high = float(known.min()), float(known.max())
    margin = max((high / low) ** 0.06, 2 * (low / high) ** 0.5, 1.0)
    return low / margin, high * margin


def _extent(layers: Iterable[Layer]) -> tuple[float, float]:
    """What the vertical axis must show: every point, and of bands what 98 % of them need."""
    lows, highs = [], []
    for layer in layers:
        edges = layer.y if layer.high is None else np.concatenate([layer.y, layer.high])
        edges = edges[np.isfinite(edges)]
        if len(edges):
            share = (0.0, 100.0) if layer.high is None else (1.0, 99.0)
            low, high = np.percentile(edges, share)
            lows.append(float(low))
            highs.append(float(high))
    if not lows:
        return 0.0, 1.0
    low, high = min(lows), max(highs)
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _number(value: float) -> str:
    text = f"{value:.6g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")
    return text.replace("-", "\u2212")


def _draw_panel(panel: Panel, across: Scale, shades: Sequence[tuple[float, float]], top: float, tall: float) -> str:
    low, high = _extent(panel.layers) if panel.linear_to != 0 else _log_extent(panel.layers)
    up = Scale(low, high, tall, panel.linear_to)
    parts = []
    for tick in up.ticks(min(5, max(2, round(tall / 20)))):
        y = top + tall - float(up.place(np.array(tick)))
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}"/>')
        parts.append(f'<text class="tick" x="{_LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{_number(tick)}</text>')
    linear_to = "" if panel.linear_to is None else f' data-bend="{panel.linear_to:.6g}"'
    parts.append(
        f'<svg class="panel" x="{_LEFT}" y="{top}" width="{across.pixels}" height="{tall:.1f}"'
        f' data-low="{low:.6g}" data-high="{high:.6g}"{linear_to}>'
    )
    for start, end in shades:
        x0, x1 = across.place(np.array([start, end])).tolist()
        parts.append(f'<rect class="shade" x="{x0:.1f}" width="{max(x1 - x0, 1):.1f}" height="100%"/>')
    parts += [_draw_layer(layer, across, up) for layer in panel.layers]
    parts.append('<path class="cursor" d=""/></svg>')
    parts.append(f'<rect class="frame" x="{_LEFT}" y="{top}" width="{across.pixels}" height="{tall:.1f}"/>')
    middle = top + tall / 2
    parts.append(f'<text class="label" transform="translate(11 {middle:.1f}) rotate(-90)">{escape(panel.label)}</text>')
    return "".join(parts)


def draw_time_panels(
    panels: Sequence[Panel], duration_s: float, shades: Sequence[tuple[float, float]] = (), height: float | None = None
) -> str:
    """Panels one above the other over 0 to duration_s [s]; shades are stretches (start, end) [s] marked in all of them.
    height: of the whole drawing [px], where it has to match another one."""
    across = Scale(0.0, max(duration_s, 1e-3), _WIDTH - _LEFT - _RIGHT)
    tall = _PANEL_HEIGHT if height is None else (height - _TOP - _BOTTOM) / len(panels) - _GAP
    height = _TOP + len(panels) * (tall + _GAP) + _BOTTOM
    parts = [
        f'<svg class="plot time" viewBox="0 0 {_WIDTH:g} {height:g}" role="img"'
        f' data-left="{_LEFT}" data-span="{across.pixels}" data-duration="{across.high:.6g}">'
    ]
    foot = f"{height - _BOTTOM - _GAP:.1f}"
    for tick in time_ticks(0.0, across.high, 7):
        x = _LEFT + float(across.place(np.array(tick)))
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{foot}"/>')
        anchor = "end" if x > _WIDTH - 20 else "middle"
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{height - _BOTTOM + 4:.1f}" text-anchor="{anchor}">{time_label(tick)}</text>'
        )
    for row, panel in enumerate(panels):
        parts.append(_draw_panel(panel, across, shades, _TOP + row * (tall + _GAP), tall))
    return "".join([*parts, "</svg>"])


def map_height(layers: Sequence[Layer]) -> float:
    """Height of the drawing [px] that `draw_map` makes of layers."""
    return _TOP + _map_scales(layers)[1].pixels + _MAP_BOTTOM


def draw_map(layers: Sequence[Layer], unit: str = "m") -> str:
    """Layers over east (x) and north (y) with the same scale on both axes."""
    across, up = _map_scales(layers)
    inner, tall, height = across.pixels, up.pixels, map_height(layers)
    parts = [f'<svg class="plot map" viewBox="0 0 {_WIDTH:g} {height:.0f}" role="img">']
    for tick in nice_ticks(across.low, across.high, 6):
        x = _LEFT + float(across.place(np.array(tick)))
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{_TOP + tall:.1f}"/>')
        anchor = "end" if x > _WIDTH - 24 else "middle"
        parts.append(f'<text class="tick" x="{x:.1f}" y="{_TOP + tall + 14:.1f}" text-anchor="{anchor}">{_number(tick)}</text>')
    for tick in nice_ticks(up.low, up.high, 6):
        y = _TOP + tall - float(up.place(np.array(tick)))
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}"/>')
        parts.append(f'<text class="tick" x="{_LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{_number(tick)}</text>')
    parts.append(f'<svg class="panel" x="{_LEFT}" y="{_TOP}" width="{inner}" height="{tall:.1f}">')
    parts += [_draw_layer(layer, across, up, x_ordered=False) for layer in layers]
    parts.append(f'</svg><rect class="frame" x="{_LEFT}" y="{_TOP}" width="{inner}" height="{tall:.1f}"/>')
    parts.append(f'<text class="label" transform="translate(11 {_TOP + tall / 2:.1f}) rotate(-90)">north [{unit}]</text>')
    parts.append(f'<text class="label" x="{_LEFT + inner / 2}" y="{height - 3:.1f}">east [{unit}]</text></svg>')
    return "".join(parts)


def draw_sky(layers: Sequence[Layer], marks: Sequence[tuple[str, float, float]]) -> str:
    """Layers over the hemisphere, seen from below with east on the right: x towards east and y towards north, 1 at the horizon.
    marks: texts with their x and y."""
    across = Scale(-1.0, 1.0, 2 * _SKY_RADIUS)
    left = _WIDTH / 2 - _SKY_RADIUS
    parts = [f'<svg class="plot map sky" viewBox="0 0 {_WIDTH:g} {SKY_HEIGHT:g}" role="img">']
    centre = f'cx="{_WIDTH / 2}" cy="{_SKY_RADIUS + _SKY_MARGIN}"'
    parts += [f'<circle class="grid" {centre} r="{_SKY_RADIUS * share:.1f}"/>' for share in (1 / 3, 2 / 3, 1)]
    for name, east, north in (("N", 0, 1), ("E", 1, 0), ("S", 0, -1), ("W", -1, 0)):
        x, y = _WIDTH / 2 + east * _SKY_RADIUS, (1 - north) * _SKY_RADIUS + _SKY_MARGIN
        parts.append(f'<path class="grid" d="M{_WIDTH / 2} {_SKY_RADIUS + _SKY_MARGIN}L{x} {y}"/>')
        parts.append(f'<text class="label" x="{x + 10 * east}" y="{y - 8 * north + 4}">{name}</text>')
    parts.append(f'<svg x="{left}" y="{_SKY_MARGIN}" width="{across.pixels}" height="{across.pixels}" overflow="visible">')
    parts += [_draw_layer(layer, across, across, x_ordered=False) for layer in layers]
    for text, x, y in marks:
        px, py = across.place(np.array([x, -y])).tolist()
        parts.append(f'<text class="mark" x="{px:.1f}" y="{py - 5:.1f}">{escape(text)}</text>')
    return "".join([*parts, "</svg></svg>"])


def _map_scales(layers: Sequence[Layer]) -> tuple[Scale, Scale]:
    """East and north, as many metres per pixel on both; at least 0.45 and at most as high as wide."""
    inner = _WIDTH - _LEFT - _RIGHT
    spans = [_finite_range([layer.x for layer in layers]), _finite_range([layer.y for layer in layers])]
    wide, high = (span[1] - span[0] for span in spans)
    per_pixel = max(wide, high, 1.0) * 1.08 / inner
    tall = min(max(high * 1.08 / per_pixel + 16, inner * 0.45), inner)
    return _centred(spans[0], inner, per_pixel), _centred(spans[1], tall, per_pixel)


def _finite_range(values: Sequence[Floats]) -> tuple[float, float]:
    joined = np.concatenate([np.zeros(0), *values])
    joined = joined[np.isfinite(joined)]
    return (float(joined.min()), float(joined.max())) if len(joined) else (0.0, 0.0)


def _centred(span: tuple[float, float], pixels: float, per_pixel: float) -> Scale:
    middle, half = (span[0] + span[1]) / 2, pixels * per_pixel / 2
    return Scale(middle - half, middle + half, pixels)
