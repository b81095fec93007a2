"""NIS over time with its bounds, and the error along and across the track."""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from navreplay.evaluation.metrics import Evaluation
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats
from pipelines.plotting.plot import Plot, bend_of, elapsed_s, time_plot
from pipelines.plotting.svg import Layer, Panel

__all__ = ["along_across", "plot_along_across", "plot_nis"]

_LEAST_SPEED = 0.5
"""Below it there is no direction of travel [m/s]."""


def plot_nis(measured: Sequence[InnovationSeries], solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    """Normalised innovations squared of each kind, on a logarithmic axis, with the bounds of 95 % of a chi-squared variable."""
    panels = []
    for series in measured:
        t, known = elapsed_s(series.t_ns, solution), series.nis > 0
        low, high = (np.full(len(t), bound) for bound in chdtri(series.residual.shape[1], [0.975, 0.025]))
        used, refused = known & series.used, known & ~series.used
        layers = (
            Layer("dots", t[used], series.nis[used], "c1", "used"),
            Layer("crosses", t[refused], series.nis[refused], "bad", "rejected"),
            Layer("line", t, low, "c2", "2.5 %"),
            Layer("line", t, high, "c2", "97.5 %"),
        )
        panels.append(Panel(series.kind.replace("_", " "), layers, 0.0))
    legend = (("dots c1", "used"), ("crosses bad", "rejected"), ("line c2", "2.5 % and 97.5 %"))
    note = "Squared innovations over their covariance; 95 % should lie between the lines."
    return time_plot("NIS over time", note, legend, panels, solution, shades)


def along_across(error: Floats, vel_n: Floats) -> Floats:
    """Horizontal errors (k, 2+) north, east resolved along and to the right of the velocity (k, 2+); NaN at rest."""
    speed = np.hypot(vel_n[:, 0], vel_n[:, 1])
    course = vel_n[:, :2] / np.where(speed > _LEAST_SPEED, speed, np.nan)[:, None]
    along = course[:, 0] * error[:, 0] + course[:, 1] * error[:, 1]
    across = course[:, 0] * error[:, 1] - course[:, 1] * error[:, 0]
    return np.stack([along, across], axis=1)


def plot_along_across(evaluation: Evaluation, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    """The horizontal error in the direction of travel and to the right of it: a late time shows along, a lever arm across."""
    velocity = np.stack([np.interp(evaluation.t_ns, solution.t_ns, solution.vel_n[:, i]) for i in range(2)], axis=1)
    parts, t = along_across(evaluation.errors["position"].error, velocity), elapsed_s(evaluation.t_ns, solution)
    bend = bend_of(parts)
    names = ("along", "across")
    panels = [Panel(f"{name} [m]", (Layer("line", t, parts[:, i], "c1", "error"),), bend) for i, name in enumerate(names)]
    note = "Estimated minus reference, ahead and to the right. A wrong time shows along, a wrong lever arm often across."
    return time_plot("Error along and across the track", note, (("line c1", "error"),), panels, solution, shades)
