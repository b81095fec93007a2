"""Weights of a bank's hypotheses over time."""

from collections.abc import Sequence

from navreplay.solution import Solution, WeightSeries
from pipelines.plotting.plot import Legend, Plot, time_plot
from pipelines.plotting.svg import Layer, Panel

__all__ = ["plot_weights", "weight_panels"]

_STYLES = 6


def weight_panels(weights: WeightSeries, start_ns: int) -> tuple[list[Panel], Legend]:
    """Weights over seconds since start_ns, as many hypotheses to a panel as there are styles, and the legend."""
    t_s = (weights.t_ns - start_ns) / 1e9
    lines = [Layer("line", t_s, weights.values[:, i], f"c{i % _STYLES + 1}", label) for i, label in enumerate(weights.labels)]
    panels = [Panel("weight", tuple(lines[first : first + _STYLES])) for first in range(0, len(lines), _STYLES)]
    return panels, tuple((f"line {layer.style}", layer.name) for layer in lines)


def plot_weights(weights: WeightSeries, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    """How far the bank that gave a solution believes each hypothesis."""
    panels, legend = weight_panels(weights, int(solution.t_ns[0]))
    note = "How far the bank believes each of its hypotheses; they sum to one."
    return time_plot("Weights of the hypotheses", note, legend, panels, solution, shades)
