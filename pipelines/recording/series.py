"""The time series of a recording: errors, innovations, noise and biases, and the plots that show them."""

import numpy as np
import rerun as rr

from navreplay.solution import InnovationSeries, Solution
from pipelines.drive.result import RunResult
from pipelines.plotting.angles import suit_errors, suit_innovations
from pipelines.plotting.plot import has_noise_to_show
from pipelines.plotting.scales import find_breaks
from pipelines.recording.layout import Stack
from pipelines.recording.paint import BLUE, GREEN, GREY, ORANGE, PALE, RED, send_dots, send_line, time_columns
from pipelines.recording.sky import send_satellite_innovations, send_shared_noise

__all__ = ["list_stacks", "send_biases", "send_errors", "send_innovations", "send_weights"]

_DPH = np.degrees(3600)
_MG = 1 / 9.80665e-3
_WEIGHT_COLORS = BLUE, ORANGE, GREEN, RED, PALE, GREY


def list_stacks(result: RunResult) -> tuple[Stack, ...]:
    """The groups of plots for which `send_errors`, `send_innovations`, `send_weights` and `send_biases` send the series."""
    stacks = []
    if result.evaluation is not None:
        for quantity, series in result.evaluation.errors.items():
            name, unit = quantity.replace("_", " ").capitalize(), suit_errors(series).unit
            stacks.append(Stack(f"{name} error", f"/errors/{quantity}", series.labels, unit))
    else:
        stacks.append(Stack("Position sigma", "/sigma/position", ("north", "east", "down"), "m"))
    if result.sky is not None:
        stacks.append(Stack("Satellites", "/satellites", ("number", "dilution"), ""))
    for innovations in result.solution.innovations:
        kind = innovations.kind
        labels, unit = () if innovations.sources else innovations.labels, suit_innovations(innovations).unit
        stacks.append(Stack(f"Innovations: {kind}", f"/innovations/{kind}", labels, unit))
        if has_noise_to_show(innovations):
            stacks.append(Stack(f"Noise: {kind}", f"/noise/{kind}", labels, unit))
    if result.solution.weights is not None:
        stacks.append(Stack("Weights", "/weights", ("bank",), "1"))
    stacks.append(Stack("Gyro bias", "/bias/gyro", ("x", "y", "z"), "deg/h"))
    stacks.append(Stack("Accelerometer bias", "/bias/accelerometer", ("x", "y", "z"), "mg"))
    return tuple(stacks)


def send_errors(recording: rr.RecordingStream, result: RunResult) -> None:
    """Errors with their 3-sigma envelopes; without a reference the standard deviations of position."""
    solution, evaluation = result.solution, result.evaluation
    if evaluation is None:
        times = time_columns(solution.t_ns, solution)
        for i, label in enumerate(("north", "east", "down")):
            send_line(recording, f"/sigma/position/{label}/sigma", times, solution.std[:, i], "sigma", BLUE)
        return
    times = time_columns(evaluation.t_ns, solution)
    # an unknown value where the reference has a gap, so that no line leads across it
    breaks = find_breaks(evaluation.t_ns / 1e9)
    broken = time_columns(np.insert(evaluation.t_ns, breaks, evaluation.t_ns[breaks - 1] + 1), solution)
    for quantity, measured in evaluation.errors.items():
        series = suit_errors(measured)
        for i, label in enumerate(series.labels):
            path, envelope = f"/errors/{quantity}/{label}", 3 * series.std[:, i]
            send_line(recording, f"{path}/upper", times, envelope, "+3 sigma", PALE)
            send_line(recording, f"{path}/lower", times, -envelope, "-3 sigma", PALE)
            error = np.insert(series.error[:, i], breaks, np.nan)
            send_line(recording, f"{path}/error", broken, error, "error", BLUE)


def send_innovations(recording: rr.RecordingStream, solution: Solution) -> None:
    """Innovations used and rejected with their 3-sigma envelopes, and the measurement noise told and used."""
    for series in solution.innovations:
        if series.sources:
            send_satellite_innovations(recording, series, solution)
            send_shared_noise(recording, series, solution)
        else:
            _send_components(recording, suit_innovations(series), solution)


def _send_components(recording: rr.RecordingStream, series: InnovationSeries, solution: Solution) -> None:
    times = time_columns(series.t_ns, solution)
    for i, label in enumerate(series.labels):
        path = f"/innovations/{series.kind}/{label}"
        send_line(recording, f"{path}/upper", times, 3 * series.std[:, i], "+3 sigma", PALE)
        send_line(recording, f"{path}/lower", times, -3 * series.std[:, i], "-3 sigma", PALE)
        for name, rows, color in (("used", series.used, BLUE), ("rejected", ~series.used, RED)):
            if rows.any():
                shown = time_columns(series.t_ns[rows], solution)
                send_dots(recording, f"{path}/{name}", shown, series.residual[rows, i], name, color)
        noise = f"/noise/{series.kind}/{label}"
        send_line(recording, f"{noise}/told", times, series.nominal_std[:, i], "told", GREY)
        send_line(recording, f"{noise}/used", times, series.noise_std[:, i], "used", ORANGE)


def send_weights(recording: rr.RecordingStream, solution: Solution) -> None:
    """Weights of a bank's hypotheses."""
    if solution.weights is None:
        return
    times = time_columns(solution.weights.t_ns, solution)
    for i, label in enumerate(solution.weights.labels):
        color = _WEIGHT_COLORS[i % len(_WEIGHT_COLORS)]
        send_line(recording, f"/weights/bank/hypothesis_{i + 1}", times, solution.weights.values[:, i], label, color)


def send_biases(recording: rr.RecordingStream, solution: Solution) -> None:
    """Estimated biases with their 1-sigma bands."""
    times = time_columns(solution.t_ns, solution)
    for name, values, state, factor in (
        ("gyro", solution.gyro_bias, "gyro_bias_x", _DPH),
        ("accelerometer", solution.accel_bias, "accel_bias_x", _MG),
    ):
        first = solution.state_names.index(state) if state in solution.state_names else None
        for i, axis in enumerate("xyz"):
            bias = values[:, i] * factor
            if first is not None:
                std = solution.std[:, first + i] * factor
                send_line(recording, f"/bias/{name}/{axis}/upper", times, bias + std, "+1 sigma", PALE)
                send_line(recording, f"/bias/{name}/{axis}/lower", times, bias - std, "-1 sigma", PALE)
            send_line(recording, f"/bias/{name}/{axis}/estimate", times, bias, "estimate", GREEN)
