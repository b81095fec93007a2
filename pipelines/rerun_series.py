"""The time series of a recording: errors, innovations, noise and biases, and the plots that show them."""

import numpy as np
import rerun as rr

from navreplay.solution import Solution
from navreplay.time_scales import utc_from_gps
from navreplay.timeline import Floats, Times
from pipelines.rerun_layout import Stack
from pipelines.result import RunResult

__all__ = ["list_stacks", "send_biases", "send_errors", "send_innovations", "time_columns"]

Color = tuple[int, int, int]
_DPH = np.degrees(3600)
_MG = 1 / 9.80665e-3
_BLUE, _GREY, _RED, _PALE = (88, 140, 255), (150, 160, 176), (235, 70, 70), (120, 135, 175)
_ORANGE, _GREEN = (235, 130, 40), (30, 185, 140)


def time_columns(t_ns: Times, solution: Solution) -> list[rr.TimeColumn]:
    """The two timelines at t_ns (k,)."""
    return [
        rr.TimeColumn("elapsed", duration=(t_ns - solution.t_ns[0]).astype("timedelta64[ns]")),
        rr.TimeColumn("time", timestamp=utc_from_gps(t_ns).astype("datetime64[ns]")),
    ]


def list_stacks(result: RunResult) -> tuple[Stack, ...]:
    """The groups of plots for which `send_errors`, `send_innovations` and `send_biases` send the series."""
    stacks = []
    if result.evaluation is not None:
        for quantity, series in result.evaluation.errors.items():
            unit = "deg" if series.unit == "rad" else series.unit
            stacks.append(Stack(f"{quantity.capitalize()} error", f"/errors/{quantity}", series.labels, unit))
    else:
        stacks.append(Stack("Position sigma", "/sigma/position", ("north", "east", "down"), "m"))
    for innovations in result.solution.innovations:
        kind = innovations.kind
        stacks.append(Stack(f"Innovations: {kind}", f"/innovations/{kind}", innovations.labels, innovations.unit))
        stacks.append(Stack(f"Noise: {kind}", f"/noise/{kind}", innovations.labels, innovations.unit))
    stacks.append(Stack("Gyro bias", "/bias/gyro", ("x", "y", "z"), "deg/h"))
    stacks.append(Stack("Accelerometer bias", "/bias/accelerometer", ("x", "y", "z"), "mg"))
    return tuple(stacks)


def _send_line(
    recording: rr.RecordingStream, path: str, times: list[rr.TimeColumn], values: Floats, name: str, color: Color
) -> None:
    recording.log(path, rr.SeriesLines(colors=color, names=name, widths=1.0 if color == _PALE else 1.5), static=True)
    recording.send_columns(path, indexes=times, columns=rr.Scalars.columns(scalars=values))


def _send_dots(
    recording: rr.RecordingStream, path: str, times: list[rr.TimeColumn], values: Floats, name: str, color: Color
) -> None:
    marker = "cross" if name == "rejected" else "circle"
    recording.log(path, rr.SeriesPoints(colors=color, names=name, markers=marker, marker_sizes=2.5), static=True)
    recording.send_columns(path, indexes=times, columns=rr.Scalars.columns(scalars=values))


def send_errors(recording: rr.RecordingStream, result: RunResult) -> None:
    """Errors with their 3-sigma envelopes; without a reference the standard deviations of position."""
    solution, evaluation = result.solution, result.evaluation
    if evaluation is None:
        times = time_columns(solution.t_ns, solution)
        for i, label in enumerate(("north", "east", "down")):
            _send_line(recording, f"/sigma/position/{label}/sigma", times, solution.std[:, i], "sigma", _BLUE)
        return
    times = time_columns(evaluation.t_ns, solution)
    for quantity, series in evaluation.errors.items():
        factor = np.degrees(1.0) if series.unit == "rad" else 1.0
        for i, label in enumerate(series.labels):
            path, envelope = f"/errors/{quantity}/{label}", 3 * series.std[:, i] * factor
            _send_line(recording, f"{path}/upper", times, envelope, "+3 sigma", _PALE)
            _send_line(recording, f"{path}/lower", times, -envelope, "-3 sigma", _PALE)
            _send_line(recording, f"{path}/error", times, series.error[:, i] * factor, "error", _BLUE)


def send_innovations(recording: rr.RecordingStream, solution: Solution) -> None:
    """Innovations used and rejected with their 3-sigma envelopes, and the measurement noise told and used."""
    for series in solution.innovations:
        times = time_columns(series.t_ns, solution)
        for i, label in enumerate(series.labels):
            path = f"/innovations/{series.kind}/{label}"
            if not series.sources:  # of many satellites at a time no line can be drawn
                _send_line(recording, f"{path}/upper", times, 3 * series.std[:, i], "+3 sigma", _PALE)
                _send_line(recording, f"{path}/lower", times, -3 * series.std[:, i], "-3 sigma", _PALE)
            for name, rows, color in (("used", series.used, _BLUE), ("rejected", ~series.used, _RED)):
                if rows.any():
                    shown = time_columns(series.t_ns[rows], solution)
                    _send_dots(recording, f"{path}/{name}", shown, series.residual[rows, i], name, color)
            noise = f"/noise/{series.kind}/{label}"
            send = _send_dots if series.sources else _send_line
            send(recording, f"{noise}/told", times, series.nominal_std[:, i], "told", _GREY)
            send(recording, f"{noise}/used", times, series.noise_std[:, i], "used", _ORANGE)


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
                _send_line(recording, f"/bias/{name}/{axis}/upper", times, bias + std, "+1 sigma", _PALE)
                _send_line(recording, f"/bias/{name}/{axis}/lower", times, bias - std, "-1 sigma", _PALE)
            _send_line(recording, f"/bias/{name}/{axis}/estimate", times, bias, "estimate", _GREEN)
