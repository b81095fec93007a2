"""The report of an experiment: tables, plots and files."""

from collections.abc import Sequence
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np

from navreplay.solution import WeightSeries
from navreplay.timeline import Floats, LogError
from pipelines.files.whole_file import write_whole
from pipelines.monte_carlo.experiment import CONSISTENT, QUANTITIES, Experiment, Outcome
from pipelines.monte_carlo.summary import SETTLED, WHOLE, summarise_experiment
from pipelines.plotting.means import draw_means
from pipelines.plotting.plot import Plot
from pipelines.plotting.svg import Layer, Panel, draw_time_panels
from pipelines.plotting.weights import weight_panels
from pipelines.report.content import Report, dump_json
from pipelines.report.html import render_html
from pipelines.report.markdown import render_markdown
from pipelines.report.table import Figure, Table, figure_text, interval_text

__all__ = ["experiment_figures", "experiment_plots", "experiment_tables", "write_experiment"]

_NOISE_BIN_S = 10.0


def write_experiment(experiment: Experiment, outcomes: Sequence[Outcome], out_dir: Path) -> dict[str, Path]:
    """Writes experiment.json, experiment.md and experiment.html; returns the paths by name. Raises LogError when the folder
    cannot be written."""
    report = summarise_experiment(experiment, outcomes)
    title = f"{experiment.name}: {experiment.description}"
    figures, tables = experiment_figures(report), experiment_tables(report)
    configuration = {key: report[key] for key in ("paper", "scenario", "seeds", "stretches", "notes")}
    html = render_html(title, experiment.paper, figures, experiment_plots(experiment, outcomes, report), tables, configuration)
    texts = {
        "experiment.json": dump_json(report),
        "experiment.md": render_markdown(title, figures, tables),
        "experiment.html": html,
    }
    try:
        for name, text in texts.items():
            write_whole(out_dir / name, partial(Path.write_text, data=text, encoding="utf-8"))
    except OSError as error:
        raise LogError(f"{out_dir}: cannot write the results: {error.strerror or error}; choose another -o") from error
    return {name: out_dir / name for name in texts}


def experiment_figures(report: Report) -> tuple[Figure, ...]:
    """A headline per arm: its error in the quantity and stretch published first, else of position over the whole drive."""
    published = report["published"][0] if report["published"] else {"stretch": WHOLE.name, "quantity": "position"}
    stretch, quantity = published["stretch"], published["quantity"].split()[0]
    unit = report["units"][quantity]
    return tuple(
        Figure(label, _interval_text(arm["stretches"][stretch]["rmse"][quantity], unit), f"3-D {quantity} RMSE, {stretch}")
        for label, arm in report["arms"].items()
    )


def _interval_text(interval: dict[str, Any], unit: str = "") -> str:
    return interval_text(interval["mean"], interval["half_width"], unit)


def experiment_tables(report: Report) -> tuple[Table, ...]:
    """All tables in the order of a report."""
    stretches = (*report["stretches"], WHOLE.name)
    tables = [
        Table("Conclusions", ("",), tuple((text,) for text in report["conclusions"])),
        *(_error_table(report, quantity, stretches) for quantity in QUANTITIES),
        *(_component_table(report, stretch) for stretch in report["stretches"]),
        _order_table(report),
        _noise_table(report, stretches),
        *(_mean_noise_table(report, stretch) for stretch in report["stretches"]),
        _settling_table(report),
        _switching_table(report),
        *(_nees_table(report, quantity, stretches) for quantity in CONSISTENT),
        _arm_table(report),
        Table("Notes", ("",), tuple((text,) for text in report["notes"])),
    ]
    return tuple(table for table in tables if table.rows)


def _error_table(report: Report, quantity: str, stretches: Sequence[str]) -> Table:
    published = [row for row in report["published"] if row["quantity"] == quantity]
    heads = [f"published, {row['stretch']}" for row in published]
    rows = tuple(
        (
            label,
            *(_interval_text(arm["stretches"][stretch]["rmse"][quantity]) for stretch in stretches),
            *(figure_text(row["figures"].get(label)) for row in published),
        )
        for label, arm in report["arms"].items()
    )
    count = len(report["seeds"])
    note = f"Root mean square of the 3-D error: mean over {count} seeds and the 95 % interval of that mean."
    title = f"{quantity.capitalize()} error [{report['units'][quantity]}]"
    return Table(title, ("", *stretches, *heads), rows, note)


def _component_table(report: Report, stretch: str) -> Table:
    """Of components that a paper has published by themselves."""
    published = {row["quantity"]: row for row in report["published"] if row["stretch"] == stretch and " " in row["quantity"]}
    heads = [head for name in published for head in (f"{name} [{report['units'][name.split()[0]]}]", "published")]
    rows = tuple(
        (
            label,
            *(
                cell
                for name, row in published.items()
                for cell in (_interval_text(arm["stretches"][stretch]["rmse"][name]), figure_text(row["figures"].get(label)))
            ),
        )
        for label, arm in report["arms"].items()
        if published
    )
    return Table(f"Components, {stretch}", ("", *heads), rows, "Root mean square: mean over seeds and its 95 % interval.")


def _switching_table(report: Report) -> Table:
    rows = tuple(
        (label, f"{change['at_s']:g} s", change["hypothesis"], figure_text(change["mean_s"]), str(change["seeds"]))
        for label, arm in report["arms"].items()
        for change in arm["switching_s"]
    )
    note = "Until the weight of the hypothesis that is true from then on is the largest; mean over the seeds where it ever is."
    return Table("Time to switch [s]", ("", "from", "true hypothesis", "seconds", "seeds"), rows, note)


def _order_table(report: Report) -> Table:
    rows = tuple(
        (
            order["source"],
            order["stretch"],
            order["quantity"],
            f"{order['better']} < {order['worse']}",
            figure_text(order["measured_better"]),
            figure_text(order["measured_worse"]),
            _interval_text(order["gain"]),
            order["verdict"],
        )
        for order in report["orders"]
    )
    header = ("published", "stretch", "quantity", "order", "first", "second", "second minus first", "verdict")
    return Table("Published orders", header, rows, "Differences are paired by seed; a verdict needs 95 %.")


def _noise_table(report: Report, stretches: Sequence[str]) -> Table:
    kinds = list(dict.fromkeys(k for arm in report["arms"].values() for k in arm["stretches"][WHOLE.name]["noise_ratio"]))
    rows = tuple(
        (
            kind.replace("_", " "),
            label,
            *(figure_text(arm["stretches"][stretch]["noise_ratio"].get(kind)) for stretch in stretches),
        )
        for kind in kinds
        for label, arm in report["arms"].items()
    )
    note = "Median over all measurements and seeds of the variance used, divided by that in the truth of the log."
    return Table("R used over R true", ("", "", *stretches), rows, note)


def _mean_noise_table(report: Report, stretch: str) -> Table:
    """Means by component, beside the true and the published ones; without rows where components come and go."""
    means = {label: arm["stretches"][stretch]["noise_used"] for label, arm in report["arms"].items()}
    components = list(dict.fromkeys(name for figures in means.values() for name in figures))
    if not components:
        return Table("", (), ())
    true = next(figures for figures in means.values() if figures)
    rows = [("true", *(figure_text(true[name]["true"]) for name in components))]
    for label, figures in means.items():
        rows.append((label, *(figure_text(figures.get(name, {}).get("used")) for name in components)))
    for row in report["published_noise"]:
        if row["stretch"] == stretch:
            texts = (figure_text(row["figures"].get(name)) for name in components)
            rows.append((f"published for {row['arm']} ({row['source']})", *texts))
    note = "Mean over epochs and seeds of the variance used, in m^2 and (m/s)^2."
    return Table(f"Mean R used in '{stretch}'", ("", *components), tuple(rows), note)


def _settling_table(report: Report) -> Table:
    stretches = tuple(report["stretches"])
    kinds = dict.fromkeys(
        k for arm in report["arms"].values() for s in stretches for k in arm["stretches"][s]["noise_settled_s"]
    )
    rows = tuple(
        (
            kind.replace("_", " "),
            label,
            *(figure_text(arm["stretches"][stretch]["noise_settled_s"].get(kind)) for stretch in stretches),
        )
        for kind in kinds
        for label, arm in report["arms"].items()
    )
    note = (
        f"Median over seeds of the time from the start of the stretch until R used is first within a factor of {SETTLED:g} of "
        "the true one; – where it is not."
    )
    return Table("Time until R is found [s]", ("", "", *stretches), rows, note)


def _nees_table(report: Report, quantity: str, stretches: Sequence[str]) -> Table:
    rows = []
    for label, arm in report["arms"].items():
        cells = [arm["stretches"][stretch]["nees"].get(quantity) for stretch in stretches]
        texts = ("–" if cell is None else f"{figure_text(cell['mean'])} ({_percent(cell['share_inside'])})" for cell in cells)
        rows.append((label, *texts))
    note = "Mean (3 expected), and share of epochs whose average over seeds lies in its 95 % bounds (at least 90 % to believe)."
    return Table(f"NEES of {quantity}", ("", *stretches), tuple(rows), note)


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.0f} %"


def _arm_table(report: Report) -> Table:
    told = {"log": "what the log tells", "moments": "true mean and variance", "model": "true labels and coloured-noise model"}
    rows = tuple(
        (
            label,
            arm["method"],
            ", ".join(
                [*(f"{k} = {v}" for k, v in arm["parameters"].items()), *(f"restarted at {t:g} s" for t in arm["restarts"])]
            ),
            told[arm["told"]],
            figure_text(arm["cpu_ms_per_epoch"]),
            str(len(arm["failures"])),
        )
        for label, arm in report["arms"].items()
    )
    return Table("Methods", ("", "method", "parameters", "told of the noise", "CPU ms per epoch", "seeds failed"), rows)


def experiment_plots(experiment: Experiment, outcomes: Sequence[Outcome], report: Report) -> tuple[Plot, ...]:
    """Errors and R of the drawn arms over time, the stretches shaded, and the mean errors of all arms."""
    styles = {label: f"c{number}" for number, label in enumerate(experiment.drawn, start=1)}
    legend = tuple((f"line {style}", label) for label, style in styles.items())
    duration = experiment.scenario.journey.duration
    shades = tuple(window for stretch in experiment.stretches for window in stretch.windows)
    count = len(outcomes)
    errors = draw_time_panels(_error_panels(experiment, outcomes, styles), duration, shades)
    plots = [Plot("Errors", f"Root mean square over {count} seeds of the 3-D errors; stretches shaded.", legend, errors)]
    noise = _noise_panels(outcomes, styles, duration)
    if noise:
        note = f"Median over {_NOISE_BIN_S:g} s and all seeds of the variance used over the true one; 1 is right."
        plots.append(Plot("R used over R true", note, legend, draw_time_panels(noise, duration, shades)))
    return (*plots, *draw_means(report), *_weight_plots(experiment, outcomes, shades))


def _weight_plots(experiment: Experiment, outcomes: Sequence[Outcome], shades: tuple[tuple[float, float], ...]) -> list[Plot]:
    """For every bank, the mean over seeds of the weights of its hypotheses."""
    journey, plots = experiment.scenario.journey, []
    for arm in experiment.arms:
        series = [weights for o in outcomes if arm.label in o.arms and (weights := o.arms[arm.label].weights) is not None]
        if series and len(series[0].labels) > 1:
            # seeds share their epochs but for some that a gate may refuse
            t_ns = reduce(np.intersect1d, [weights.t_ns for weights in series])
            mean = np.mean([weights.values[np.isin(weights.t_ns, t_ns)] for weights in series], axis=0)
            panels, legend = weight_panels(WeightSeries(t_ns, series[0].labels, mean), journey.start_ns)
            drawing = draw_time_panels(panels, journey.duration, shades)
            plots.append(Plot(f"Weights: {arm.label}", f"Mean over {len(series)} seeds.", legend, drawing))
    return plots


def _error_panels(experiment: Experiment, outcomes: Sequence[Outcome], styles: dict[str, str]) -> list[Panel]:
    attitude = experiment.attitude
    panels = []
    for i, (quantity, unit, factor) in enumerate(
        (("position", "m", 1.0), ("velocity", "m/s", 1.0), ("attitude", attitude.unit, attitude.per_radian))
    ):
        layers = []
        for label, style in styles.items():
            errors = [o.arms[label].errors[:, 3 * i : 3 * i + 3] * factor for o in outcomes if label in o.arms]
            if errors:
                mean_square = np.mean([(error**2).sum(axis=1) for error in errors], axis=0)
                layers.append(Layer("line", outcomes[0].t_s, np.sqrt(mean_square), style, label))
        panels.append(Panel(f"{quantity} [{unit}]", tuple(layers), 0.0))
    return panels


def _noise_panels(outcomes: Sequence[Outcome], styles: dict[str, str], duration: float) -> list[Panel]:
    kinds = dict.fromkeys(kind for o in outcomes for arm in o.arms.values() for kind in arm.noise)
    centres = np.arange(_NOISE_BIN_S / 2, duration, _NOISE_BIN_S)
    panels = []
    for kind in kinds:
        layers = []
        for label, style in styles.items():
            noises = [o.arms[label].noise[kind] for o in outcomes if label in o.arms and kind in o.arms[label].noise]
            if noises:
                t_s = np.concatenate([noise.t_s for noise in noises])
                ratio = np.concatenate([noise.ratio for noise in noises])
                layers.append(Layer("line", centres, _bin_medians(t_s, ratio, len(centres)), style, label))
        panels.append(Panel(kind.replace("_", " "), tuple(layers), 0.0))
    return panels


def _bin_medians(t_s: Floats, values: Floats, count: int) -> Floats:
    """(count,) medians in bins of _NOISE_BIN_S, NaN in empty ones."""
    order = np.argsort(t_s, kind="stable")
    edges = np.searchsorted(t_s[order], np.arange(count + 1) * _NOISE_BIN_S)
    parts = np.split(values[order], edges[1:-1]) if count > 1 else [values]
    return np.array([np.median(part) if len(part) else np.nan for part in parts])
