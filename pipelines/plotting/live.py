"""What a browser needs to draw plots itself, as one compressed block: the points of their layers, thinned, extremes kept."""

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navreplay.timeline import Floats
from pipelines.plotting.plot import Plot
from pipelines.plotting.scales import find_breaks, thin_band, thin_line
from pipelines.plotting.svg import Layer, Panel
from pipelines.plotting.track import Course, Track

__all__ = ["Clock", "pack_plots", "unpack_array"]

_MOST_POINTS = 220_000
"""Of all layers together: about 1 MB in the page."""
_FEWEST_BINS, _MOST_BINS = 700, 20_000
_TIME_STEP_S, _PLACE_STEP_M = 1e-4, 1e-2
_MANTISSA_KEPT = 0xFFFFFFE0
"""Bits of a single-precision number that stay: five digits of it. The others are noise to a reader and cannot be compressed."""


@dataclass(frozen=True, slots=True)
class Clock:
    """When the plots begin, in milliseconds of Unix time, and how long they last [s]."""

    start_ms: float
    duration_s: float


class _Store:
    """Arrays one behind the other, each as its offset, count and coding."""

    def __init__(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0

    def _add(self, words: Any, coding: dict[str, float]) -> dict[str, float]:
        block = np.ascontiguousarray(words.astype("<i4").view(np.uint8).reshape(-1, 4).T).tobytes()  # like bytes together
        place = {"at": self.size, "n": len(words), **coding}
        self.blocks.append(block)
        self.size += len(block)
        return place

    def steps(self, values: Floats, step: float) -> dict[str, float]:
        """Values (n,) to a whole number of steps, as differences."""
        whole = np.rint(values / step).astype(np.int64)
        first = int(whole[0]) if len(whole) else 0
        return self._add(np.diff(whole, prepend=first), {"step": step, "first": first * step})

    def numbers(self, values: Floats) -> dict[str, float]:
        """Values (n,), NaN included, about their middle."""
        known = values[np.isfinite(values)]
        middle = float(f"{np.median(known):.6g}") if len(known) else 0.0
        words = (values - middle).astype("<f4").view(np.uint32) + np.where(np.isfinite(values), 0x10, 0).astype(np.uint32)
        return self._add((words & np.uint32(_MANTISSA_KEPT)).view(np.int32), {"middle": middle})


def pack_plots(plots: Sequence[Plot], clock: Clock) -> tuple[str, str]:
    """A description in JSON, an entry per plot (null where it is a drawing only), and the base64 text of the gzipped arrays."""
    layers = [layer for plot in plots if plot.live is not None for panel in plot.live.panels for layer in panel.layers]
    values = sum(2 + (layer.high is not None) for layer in layers)
    bins = int(np.clip(_MOST_POINTS / max(values, 1), _FEWEST_BINS, _MOST_BINS))
    store = _Store()
    described = [_describe_plot(plot, store, bins) for plot in plots]
    spec = {"start_ms": clock.start_ms, "duration_s": clock.duration_s, "plots": described}
    block = gzip.compress(b"".join(store.blocks), 6, mtime=0)
    text = json.dumps(spec, allow_nan=False, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")
    return text, base64.b64encode(block).decode("ascii")


def unpack_array(block: bytes, place: dict[str, float]) -> Floats:
    """The array (n,) at a place of the block: what the script of the page does."""
    at, n = int(place["at"]), int(place["n"])
    words = np.ascontiguousarray(np.frombuffer(block, np.uint8, 4 * n, at).reshape(4, n).T).view("<i4").ravel()
    if "step" in place:
        return np.asarray(place["first"] + np.cumsum(words.astype(np.int64)) * place["step"])
    return words.view("<f4").astype(np.float64) + place["middle"]


def _describe_plot(plot: Plot, store: _Store, bins: int) -> dict[str, Any] | None:
    if plot.live is None:
        return None
    track = plot.live.track
    return {
        "title": plot.title,
        "shades": [list(shade) for shade in plot.live.shades],
        "panels": [_describe_panel(panel, store, bins) for panel in plot.live.panels],
        "track": None if track is None else _describe_track(track, store),
    }


def _describe_panel(panel: Panel, store: _Store, bins: int) -> dict[str, Any]:
    layers = [_describe_layer(layer, store, bins) for layer in panel.layers]
    return {"label": panel.label, "bend": panel.linear_to, "layers": [layer for layer in layers if layer["x"]["n"]]}


def _describe_layer(layer: Layer, store: _Store, bins: int) -> dict[str, Any]:
    described: dict[str, Any] = {"kind": layer.kind, "style": layer.style, "name": layer.name}
    if layer.kind == "band" and layer.high is not None:
        x, low, high = thin_band(layer.x, layer.y, layer.high, bins)
        return described | {"x": store.steps(x, _TIME_STEP_S), "y": store.numbers(low), "high": store.numbers(high)}
    x, y = _thin_pieces(layer, bins) if layer.kind == "line" else _thin_marks(layer, bins)
    return described | {"x": store.steps(x, _TIME_STEP_S), "y": store.numbers(y)}


def _thin_pieces(layer: Layer, bins: int) -> tuple[Floats, Floats]:
    """A line's points, an unknown value where it has a gap; bins are shared out by the time that a piece lasts."""
    known = np.isfinite(layer.x) & np.isfinite(layer.y)
    x, y = layer.x[known], layer.y[known]
    if not len(x):
        return x, y
    pieces = np.split(np.arange(len(x)), find_breaks(x))
    whole = max(float(x[-1] - x[0]), 1e-9)
    xs, ys = [], []
    for piece in pieces:
        share = max(2, int(bins * (x[piece[-1]] - x[piece[0]]) / whole))
        thin_x, thin_y = thin_line(x[piece], y[piece], share)
        xs += [thin_x, thin_x[-1:]]
        ys += [thin_y, np.array([np.nan])]
    return np.concatenate(xs), np.concatenate(ys)


def _thin_marks(layer: Layer, bins: int) -> tuple[Floats, Floats]:
    """Marks in the order of time, at least the extremes of each bin."""
    known = np.isfinite(layer.x) & np.isfinite(layer.y)
    order = np.argsort(layer.x[known], kind="stable")
    x, y = layer.x[known][order], layer.y[known][order]
    return thin_line(x, y, bins) if len(x) else (x, y)


def _describe_track(track: Track, store: _Store) -> dict[str, Any]:
    return {
        "lat_deg": track.lat_deg,
        "lon_deg": track.lon_deg,
        "courses": [_describe_course(course, store) for course in track.courses],
    }


def _describe_course(course: Course, store: _Store) -> dict[str, Any]:
    return {
        "kind": course.kind,
        "style": course.style,
        "name": course.name,
        "t": store.steps(course.t_s, _TIME_STEP_S),
        "east": store.steps(course.east, _PLACE_STEP_M),
        "north": store.steps(course.north, _PLACE_STEP_M),
        "values": {
            name: {"data": store.numbers(shade.values), "unit": shade.unit, "classes": list(shade.classes)}
            for name, shade in course.shades.items()
        },
    }
