"""The plots of a report about ranges: sky, dilution of precision, residuals by satellite, noise over all of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from navreplay.evaluation.sky import Sky
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats
from pipelines.plotting.plot import Plot, bend_of, elapsed_s, time_plot
from pipelines.plotting.svg import SKY_HEIGHT, Layer, Panel, draw_sky

__all__ = ["SYSTEMS", "epoch_shares", "plot_satellites", "plot_shared_noise", "sky_plots"]

SYSTEMS = {"G": "GPS", "R": "GLONASS", "E": "Galileo", "C": "BeiDou", "J": "QZSS", "S": "SBAS", "I": "NavIC"}
"""Names by RINEX letter."""
_STYLES = {"G": "c1", "R": "c2", "E": "c3", "C": "c4", "J": "c5", "S": "c6", "I": "c6"}
_MOST_PER_SATELLITE = 600
_ROW_HEIGHT, _MARGIN = 56.0, 20.0


def sky_plots(sky: Sky, solution: Solution, shades: Sequence[tuple[float, float]]) -> tuple[Plot, ...]:
    """Where the satellites were and what the filter made of them; how many, and the dilution of precision."""
    return _plot_sky(sky), _plot_dilution(sky, solution, shades)


def _plot_sky(sky: Sky) -> Plot:
    flat = 1 - sky.elevation / (np.pi / 2)
    x, y = flat * np.sin(sky.azimuth), flat * np.cos(sky.azimuth)
    system = sky.sat.astype("U1")
    layers = []
    for rows, style, name in (
        (~sky.judged, "reference", "masked"),
        (sky.judged & ~sky.used, "bad", "rejected"),
        *((sky.used & (system == letter), style, SYSTEMS[letter]) for letter, style in _STYLES.items()),
    ):
        if rows.any():
            layers.append(Layer("dots", x[rows], y[rows], style, name))
    last = {name: i for i, name in enumerate(sky.sat.tolist())}
    marks = [(name, float(x[i]), float(y[i])) for name, i in last.items()]
    legend = tuple((f"dots {layer.style}", layer.name) for layer in layers)
    note = "Elevation from the rim (0°) to the middle (90°); a name stands where its satellite was last."
    return Plot("Sky", note, legend, draw_sky(layers, marks))


def _plot_dilution(sky: Sky, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    t = elapsed_s(sky.epoch_ns, solution)
    _, seen = np.unique(sky.t_ns, return_counts=True)
    dilutions = (("c1", "position", 1), ("c2", "horizontal", 2), ("c3", "vertical", 3))
    satellites = (
        Layer("line", t, seen.astype(np.float64), "reference", "received"),
        Layer("line", t, sky.used_count.astype(np.float64), "c4", "used"),
    )
    panels = [
        Panel("satellites", satellites),
        Panel(
            "dilution", tuple(Layer("line", t, sky.dop[:, i], style, name) for style, name, i in dilutions), bend_of(sky.dop)
        ),
    ]
    legend = (
        *((f"line {style}", f"{name} dilution") for style, name, _ in dilutions),
        ("line c4", "used"),
        ("line reference", "received"),
    )
    note = "Of the pseudoranges used; without a line where they are too few for a position of their own."
    return time_plot("Satellites and dilution of precision", note, legend, panels, solution, shades, SKY_HEIGHT)


def plot_satellites(series: InnovationSeries, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    """A panel per satellite with its innovations."""
    sat, t = np.array(series.sources), elapsed_s(series.t_ns, solution)
    bend = bend_of(series.residual)
    panels = []
    for name in np.unique(sat).tolist():
        rows = np.flatnonzero(sat == name)
        rows = rows[:: len(rows) // _MOST_PER_SATELLITE + 1]
        used, refused = rows[series.used[rows]], rows[~series.used[rows]]
        layers = (
            Layer("dots", t[used], series.residual[used, 0], _STYLES.get(name[:1], "c6"), name),
            Layer("crosses", t[refused], series.residual[refused, 0], "bad", f"{name} rejected"),
        )
        panels.append(Panel(name, layers, bend))
    note = f"Measured minus predicted [{series.unit}]." + ("" if bend is None else " Signed logarithmic scale.")
    legend = tuple((f"dots {_STYLES[letter]}", SYSTEMS[letter]) for letter in _STYLES if (sat.astype("U1") == letter).any())
    height = _ROW_HEIGHT * len(panels) + _MARGIN
    title = f"Innovations by satellite: {series.kind}"
    return time_plot(title, note, (*legend, ("crosses bad", "rejected")), panels, solution, shades, height)


def plot_shared_noise(series: InnovationSeries, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    """Noise used against noise told: over all satellites of an epoch the median, and of the used the middle two thirds."""
    t_ns, told = epoch_shares(series.t_ns, series.nominal_std[:, 0], (0.5,))
    _, used = epoch_shares(series.t_ns, series.noise_std[:, 0], (1 / 6, 0.5, 5 / 6))
    t = elapsed_s(t_ns, solution)
    layers = (
        Layer("band", t, used[:, 0], "c2", "two thirds", used[:, 2]),
        Layer("line", t, told[:, 0], "reference", "told"),
        Layer("line", t, used[:, 1], "c2", "used"),
    )
    legend = (
        ("line c2", "used by the filter, median"),
        ("band c2", "two thirds of the satellites"),
        ("line reference", "told by the receiver or the configuration, median"),
    )
    panel = Panel(f"{series.kind} [{series.unit}]", layers)
    note = "Standard deviation of the measurement noise, over the satellites of an epoch."
    return time_plot(f"Noise: {series.kind}", note, legend, [panel], solution, shades)


def epoch_shares(t_ns: NDArray[np.int64], values: Floats, shares: Sequence[float]) -> tuple[NDArray[np.int64], Floats]:
    """Times (e,) and, of the values (k,) at each of them, those in whose rank the given shares lie (e, len(shares))."""
    order = np.lexsort((values, t_ns))
    times, first, count = np.unique(t_ns[order], return_index=True, return_counts=True)
    at = first[:, None] + np.rint((count - 1)[:, None] * np.array(shares)).astype(np.intp)
    return times, values[order][at]
