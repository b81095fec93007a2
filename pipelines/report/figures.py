"""The plots of a report: which series of a run go into which panels."""

from collections.abc import Sequence

import numpy as np

from navreplay.evaluation.metrics import Evaluation
from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import FixStatus, Floats, Timeline
from pipelines.drive.result import RunResult
from pipelines.plotting.angles import suit_errors, suit_innovations
from pipelines.plotting.plot import Legend, Live, Plot, bend_of, elapsed_s, has_noise_to_show, time_plot
from pipelines.plotting.sky import plot_satellites, plot_shared_noise, sky_plots
from pipelines.plotting.svg import Layer, Panel, draw_map, map_height
from pipelines.plotting.weights import plot_weights
from pipelines.report.content import outage_errors
from pipelines.report.sections.course import track_of
from pipelines.report.sections.over_time import plot_along_across, plot_nis

__all__ = ["outage_shades", "report_plots"]

_DPH = np.degrees(3600)
_MG = 1 / 9.80665e-3
_FIX_NAMES = {status: status.name.lower().replace("_", " ") for status in FixStatus}


def report_plots(result: RunResult) -> tuple[Plot, ...]:
    """All plots in the order of a report."""
    solution, evaluation = result.solution, result.evaluation
    shades = outage_shades(result)
    track = _track_layers(result)
    plots = [_plot_track(result, track), _plot_motion(result, shades, map_height(track))]
    if evaluation is not None:
        plots += [*_plot_errors(evaluation, solution, shades), plot_along_across(evaluation, solution, shades)]
    else:
        plots.append(_plot_deviations(solution, shades))
    plots.append(_plot_attitude(solution, shades))
    if result.sky is not None:
        plots += sky_plots(result.sky, solution, shades)
    measured = [series for series in solution.innovations if len(series.t_ns)]
    for series in measured:
        noise = plot_shared_noise if series.sources else _plot_noise
        plots.append(_plot_innovations(series, solution, shades))
        plots += [noise(series, solution, shades)] if has_noise_to_show(series) else []
    plots += [plot_nis(measured, solution, shades)] if measured else []
    plots += [plot_satellites(series, solution, shades) for series in measured if series.sources]
    if solution.weights is not None:
        plots.append(plot_weights(solution.weights, solution, shades))
    return (*plots, *_plot_biases(solution, shades))


def outage_shades(result: RunResult) -> tuple[tuple[float, float], ...]:
    """Start and end of each outage in seconds since the first row."""
    origin = int(result.solution.t_ns[0])
    outages = [errors.outage for errors in outage_errors(result)]
    return tuple(((o.start_ns - origin) / 1e9, (o.end_ns - origin) / 1e9) for o in outages)


def _plot_track(result: RunResult, layers: Sequence[Layer]) -> Plot:
    legend = tuple(
        (f"{layer.kind} {layer.style}", layer.name) for layer in sorted(layers, key=lambda layer: layer.kind != "line")
    )
    lat, lon = np.degrees(result.solution.lla[0, :2])
    note = f"East and north of the first position, {lat:.6f}°, {lon:.6f}°."
    live = Live(shades=outage_shades(result), track=track_of([result], ["solution"], ["c1"]))
    return Plot("Track", note, legend, draw_map(layers), live)


def _track_layers(result: RunResult) -> list[Layer]:
    """From the lowest to the topmost."""
    solution, timeline = result.solution, result.timeline
    origin = solution.lla[0]
    track = ned_between(origin, solution.lla)
    layers = []
    if timeline.reference is not None:
        at = (timeline.reference.t_ns >= solution.t_ns[0]) & (timeline.reference.t_ns <= solution.t_ns[-1])
        reference = ned_between(origin, timeline.reference.lla[at])
        layers.append(Layer("line", reference[:, 1], reference[:, 0], "reference", "reference"))
    layers += _fix_layers(timeline, origin)
    layers.append(Layer("line", track[:, 1], track[:, 0], "c1", "solution"))
    outages = np.zeros(len(solution), dtype=np.bool_)
    for errors in outage_errors(result):
        outages |= (solution.t_ns >= errors.outage.start_ns) & (solution.t_ns <= errors.outage.end_ns)
    if outages.any():
        lost = np.where(outages[:, None], track, np.nan)
        layers.append(Layer("line", lost[:, 1], lost[:, 0], "lost", "in outages"))
    rejected = _rejected_fixes(result)
    if len(rejected):
        where = ned_between(origin, rejected)
        layers.append(Layer("crosses", where[:, 1], where[:, 0], "bad", "rejected fix"))
    return layers


def _fix_layers(timeline: Timeline, origin: Floats) -> list[Layer]:
    if timeline.fixes is None:
        return []
    where = ned_between(origin, timeline.fixes.lla)
    layers = []
    for status, name in _FIX_NAMES.items():
        rows = timeline.fixes.has_position & (timeline.fixes.status == status)
        if rows.any():
            layers.append(Layer("dots", where[rows, 1], where[rows, 0], f"fix{int(status)}", f"{name} fix"))
    return layers


def _rejected_fixes(result: RunResult) -> Floats:
    fixes = result.used.fixes
    positions = [series for series in result.solution.innovations if series.kind == "position"]
    if fixes is None or not positions:
        return np.zeros((0, 3))
    times = np.concatenate([series.t_ns[~series.used] for series in positions])
    return fixes.lla[np.isin(fixes.t_ns, times) & fixes.has_position]


def _plot_motion(result: RunResult, shades: Sequence[tuple[float, float]], drawing_height: float) -> Plot:
    solution, timeline = result.solution, result.timeline
    t = elapsed_s(solution.t_ns, solution)
    speed = np.linalg.norm(solution.vel_n, axis=1)
    height = [Layer("line", t, solution.lla[:, 2], "c1", "solution")]
    if timeline.reference is not None:
        reference = timeline.reference
        at = (reference.t_ns >= solution.t_ns[0]) & (reference.t_ns <= solution.t_ns[-1])
        height.insert(0, Layer("line", elapsed_s(reference.t_ns[at], solution), reference.lla[at, 2], "reference", "reference"))
    panels = [Panel("height [m]", tuple(height)), Panel("speed [m/s]", (Layer("line", t, speed, "c1", "solution"),))]
    legend = tuple((f"line {layer.style}", layer.name) for layer in height)
    return time_plot("Height and speed", "Height above the ellipsoid.", legend, panels, solution, shades, drawing_height)


def _plot_errors(evaluation: Evaluation, solution: Solution, shades: Sequence[tuple[float, float]]) -> list[Plot]:
    plots = []
    t = elapsed_s(evaluation.t_ns, solution)
    for quantity, measured in evaluation.errors.items():
        series = suit_errors(measured)
        error, envelope, unit = series.error, 3 * series.std, series.unit
        bend = bend_of(error, envelope)
        panels = [
            Panel(
                f"{label} [{unit}]",
                (
                    Layer("band", t, -envelope[:, i], "c1", "3 sigma", envelope[:, i]),
                    Layer("line", t, error[:, i], "c1", "error"),
                ),
                bend,
            )
            for i, label in enumerate(series.labels)
        ]
        note = "Estimated minus reference, with the 3-sigma envelope." + ("" if bend is None else " Signed logarithmic scale.")
        legend = (("line c1", "error"), ("band c1", "3 sigma"))
        plots.append(time_plot(f"{quantity.replace('_', ' ').capitalize()} error", note, legend, panels, solution, shades))
    return plots


def _plot_deviations(solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    t, std = elapsed_s(solution.t_ns, solution), solution.std
    groups = (("position [m]", std[:, :3]), ("velocity [m/s]", std[:, 3:6]), ("attitude [deg]", np.degrees(std[:, 6:9])))
    styles = tuple(zip(("c1", "c2", "c3"), ("north", "east", "down"), strict=True))
    panels = [
        Panel(
            label, tuple(Layer("line", t, values[:, i], style, name) for i, (style, name) in enumerate(styles)), bend_of(values)
        )
        for label, values in groups
    ]
    legend = tuple((f"line {style}", name) for style, name in styles)
    note = "No reference was given; this is what the filter believes of itself."
    return time_plot("Standard deviations", note, legend, panels, solution, shades)


def _plot_attitude(solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    t = elapsed_s(solution.t_ns, solution)
    angles = np.degrees(np.unwrap(euler_from_quat(solution.q_nb), axis=0))
    panels = [
        Panel(f"{name} [deg]", (Layer("line", t, angles[:, i], "c1", name),)) for i, name in enumerate(("roll", "pitch", "yaw"))
    ]
    return time_plot("Attitude", "Yaw is clockwise from north and counts on beyond a full turn.", (), panels, solution, shades)


def _plot_innovations(series: InnovationSeries, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    t, series = elapsed_s(series.t_ns, solution), suit_innovations(series)
    used, refused = series.used, ~series.used
    panels = []
    for i, label in enumerate(series.labels):
        spread = 3 * series.std[:, i]
        # of many satellites at a time no band can be drawn
        band = [] if series.sources else [Layer("band", t, -spread, "c1", "3 sigma", spread)]
        layers = [
            *band,
            Layer("dots", t[used], series.residual[used, i], "c1", "used"),
            Layer("crosses", t[refused], series.residual[refused, i], "bad", "rejected"),
        ]
        panels.append(Panel(f"{label} [{series.unit}]", tuple(layers), bend_of(series.residual, series.std)))
    legend: Legend = (("dots c1", "used"), ("crosses bad", "rejected"))
    note = "Measured minus predicted, of all satellites."
    if not series.sources:
        legend = (*legend, ("band c1", "3 sigma"))
        note = "Measured minus predicted, with three standard deviations of their spread."
    return time_plot(f"Innovations: {series.kind}", note, legend, panels, solution, shades)


def _plot_noise(series: InnovationSeries, solution: Solution, shades: Sequence[tuple[float, float]]) -> Plot:
    t, series = elapsed_s(series.t_ns, solution), suit_innovations(series)
    panels = [
        Panel(
            f"{label} [{series.unit}]",
            (
                Layer("line", t, series.nominal_std[:, i], "reference", "told"),
                Layer("line", t, series.noise_std[:, i], "c2", "used"),
            ),
            bend_of(series.noise_std, series.nominal_std),
        )
        for i, label in enumerate(series.labels)
    ]
    legend = (("line c2", "used by the filter"), ("line reference", "told by the receiver or the configuration"))
    note = "Standard deviation of the measurement noise."
    return time_plot(f"Noise: {series.kind}", note, legend, panels, solution, shades)


def _plot_biases(solution: Solution, shades: Sequence[tuple[float, float]]) -> tuple[Plot, ...]:
    t = elapsed_s(solution.t_ns, solution)
    plots = []
    for title, values, state, factor, unit in (
        ("Gyro bias", solution.gyro_bias, "gyro_bias_x", _DPH, "deg/h"),
        ("Accelerometer bias", solution.accel_bias, "accel_bias_x", _MG, "mg"),
    ):
        first = solution.state_names.index(state) if state in solution.state_names else None
        panels = []
        for i, axis in enumerate("xyz"):
            bias = values[:, i] * factor
            layers = [Layer("line", t, bias, "c3", axis)]
            if first is not None:
                std = solution.std[:, first + i] * factor
                layers.insert(0, Layer("band", t, bias - std, "c3", "1 sigma", bias + std))
            panels.append(Panel(f"{axis} [{unit}]", tuple(layers)))
        legend = (("line c3", "estimate"), ("band c3", "1 sigma"))
        plots.append(time_plot(title, "Body axes.", legend, panels, solution, shades))
    return tuple(plots)
