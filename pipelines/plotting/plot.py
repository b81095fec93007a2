"""A drawing with what a reader needs beside it, and how the drawings over time are put together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats, Times
from pipelines.plotting.svg import Panel, draw_time_panels
from pipelines.plotting.track import Track

__all__ = ["Legend", "Live", "Plot", "bend_of", "elapsed_s", "has_noise_to_show", "time_plot"]

Legend = tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False, slots=True)
class Live:
    """What a browser that runs scripts draws instead of the drawing: panels over the time of the report, with stretches shaded
    (start, end) [s]; or a track."""

    panels: tuple[Panel, ...] = ()
    shades: tuple[tuple[float, float], ...] = ()
    track: Track | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Plot:
    """A drawing with its title, what it shows in a sentence, and its legend: pairs of style class and name. live: the same
    for a browser that can zoom; None where there is nothing to zoom into."""

    title: str
    note: str
    legend: Legend
    svg: str
    live: Live | None = None


def elapsed_s(t_ns: Times, solution: Solution) -> Floats:
    """Seconds (k,) since the first row."""
    return np.asarray((t_ns - solution.t_ns[0]) / 1e9)


def time_plot(
    title: str,
    note: str,
    legend: Legend,
    panels: Sequence[Panel],
    solution: Solution,
    shades: Sequence[tuple[float, float]],
    height: float | None = None,
) -> Plot:
    """Panels over the time of a solution; shades and height as in `draw_time_panels`."""
    duration_s = float((solution.t_ns[-1] - solution.t_ns[0]) / 1e9)
    live = Live(tuple(panels), tuple(shades))
    return Plot(title, note, legend, draw_time_panels(panels, duration_s, shades, height), live)


def has_noise_to_show(series: InnovationSeries) -> bool:
    """Whether its noise is more than one number: of several sources, changing, or not that told."""
    return bool(series.sources or np.ptp(series.noise_std) or (series.noise_std != series.nominal_std).any())


def bend_of(*series: Floats) -> float | None:
    """Where a signed-logarithmic axis should begin; None where a linear one shows small and large values alike."""
    magnitudes = np.abs(np.concatenate([values.ravel() for values in series]))
    magnitudes = magnitudes[np.isfinite(magnitudes) & (magnitudes > 0)]
    if len(magnitudes) == 0:
        return None
    usual, large = np.percentile(magnitudes, [50, 99.5])
    return float(10 ** np.floor(np.log10(usual))) if large > 15 * usual else None
