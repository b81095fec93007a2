"""The satellites of a recording: the sky over time, their number, dilution of precision, innovations of each, noise of all."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from navreplay.evaluation.sky import Sky
from navreplay.solution import InnovationSeries, Solution
from pipelines.plotting.sky import epoch_shares
from pipelines.recording.paint import BLUE, GREEN, GREY, ORANGE, PALE, RED, Color, send_dots, send_line, time_columns

__all__ = ["send_satellite_innovations", "send_shared_noise", "send_sky"]

_SYSTEM_COLORS: dict[str, Color] = {"G": BLUE, "R": ORANGE, "E": GREEN, "C": (160, 110, 245), "J": (220, 185, 50)}


def send_sky(recording: rr.RecordingStream, sky: Sky, solution: Solution) -> None:
    """Where each satellite stands (grey: masked, red: rejected), how many there are, and the dilution of precision."""
    rim = np.linspace(0, 2 * np.pi, 73)
    circle = np.stack([np.cos(rim), np.sin(rim)], axis=1)
    cross = [[[0, -1], [0, 1]], [[-1, 0], [1, 0]]]
    grid = rr.LineStrips2D(
        [*(circle * share for share in (1 / 3, 2 / 3, 1)), *cross], colors=GREY, radii=rr.Radius.ui_points(0.5)
    )
    recording.log("/sky/grid", grid, static=True)
    names = rr.Points2D([[0, -1.06], [1.06, 0], [0, 1.06], [-1.06, 0]], labels=list("NESW"), radii=0.001, show_labels=True)
    recording.log("/sky/directions", names, static=True)
    for name in np.unique(sky.sat).tolist():
        _send_satellite(recording, sky, np.flatnonzero(sky.sat == name), name, solution)
    times = time_columns(sky.epoch_ns, solution)
    _, received = np.unique(sky.t_ns, return_counts=True)
    for label, counts, color in (("received", received, GREY), ("used", sky.used_count, BLUE)):
        send_line(recording, f"/satellites/number/{label}", times, counts.astype(np.float64), label, color)
    for label, column, color in (("position", 1, BLUE), ("horizontal", 2, ORANGE), ("vertical", 3, GREEN)):
        known = np.isfinite(sky.dop[:, column])
        shown = time_columns(sky.epoch_ns[known], solution)
        send_line(recording, f"/satellites/dilution/{label}", shown, sky.dop[known, column], label, color)


def _send_satellite(recording: rr.RecordingStream, sky: Sky, rows: NDArray[np.intp], name: str, solution: Solution) -> None:
    """One satellite's place; it vanishes at the first epoch without it."""
    epoch = np.searchsorted(sky.epoch_ns, sky.t_ns[rows])
    here = np.zeros(len(sky.epoch_ns) + 1, dtype=np.intp)
    here[epoch] = 1
    told = np.flatnonzero(here[:-1] | np.roll(here, 1)[:-1])
    flat = 1 - sky.elevation[rows] / (np.pi / 2)
    place = np.stack([flat * np.sin(sky.azimuth[rows]), -flat * np.cos(sky.azimuth[rows])], axis=1)
    colors = np.tile(np.array(_SYSTEM_COLORS.get(name[:1], PALE), dtype=np.uint8), (len(rows), 1))
    colors[~sky.used[rows]] = RED
    colors[~sky.judged[rows]] = GREY
    path = f"/sky/satellites/{name}"
    style = rr.Points2D.from_fields(labels=[name], radii=rr.Radius.ui_points(6), show_labels=True)
    recording.log(path, style, static=True)
    columns = rr.Points2D.columns(positions=place, colors=colors).partition(here[told])
    # the first epoch counts from the first row on, where the recording opens
    epoch_ns = np.where(told > 0, sky.epoch_ns[told], solution.t_ns[0])
    recording.send_columns(path, indexes=time_columns(epoch_ns, solution), columns=columns)


def send_satellite_innovations(recording: rr.RecordingStream, series: InnovationSeries, solution: Solution) -> None:
    """What was used, a series per satellite, and what was rejected."""
    sat = np.array(series.sources)
    for name in np.unique(sat).tolist():
        rows = (sat == name) & series.used
        if rows.any():
            times = time_columns(series.t_ns[rows], solution)
            color = _SYSTEM_COLORS.get(name[:1], PALE)
            send_dots(recording, f"/innovations/{series.kind}/{name}", times, series.residual[rows, 0], name, color)
    rows = ~series.used
    if rows.any():
        times = time_columns(series.t_ns[rows], solution)
        send_dots(recording, f"/innovations/{series.kind}/rejected", times, series.residual[rows, 0], "rejected", RED)


def send_shared_noise(recording: rr.RecordingStream, series: InnovationSeries, solution: Solution) -> None:
    """Of the satellites of an epoch the median of the noise told and used, and the middle two thirds of the used."""
    t_ns, told = epoch_shares(series.t_ns, series.nominal_std[:, 0], (0.5,))
    _, used = epoch_shares(series.t_ns, series.noise_std[:, 0], (1 / 6, 0.5, 5 / 6))
    times = time_columns(t_ns, solution)
    path = f"/noise/{series.kind}"
    send_line(recording, f"{path}/told", times, told[:, 0], "told", GREY)
    for i, label, name, color in (
        (0, "lower", "a sixth", PALE),
        (2, "upper", "five sixths", PALE),
        (1, "used", "used", ORANGE),
    ):
        send_line(recording, f"{path}/{label}", times, used[:, i], name, color)
