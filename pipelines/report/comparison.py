"""The report of one drive through several methods: one table per quantity, errors drawn over each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navreplay.geodesy.earth import ned_between
from pipelines.drive.compare import Variant
from pipelines.drive.result import RunResult
from pipelines.plotting.plot import Live, Plot, bend_of
from pipelines.plotting.svg import Layer, Panel, draw_map, draw_time_panels, map_height
from pipelines.report.content import Report
from pipelines.report.figures import outage_shades
from pipelines.report.sections.course import track_of
from pipelines.report.table import Figure, Notice, Table, figure_text

__all__ = [
    "MOST_DRAWN",
    "Comparison",
    "build_comparison",
    "comparison_figures",
    "comparison_notice",
    "comparison_plots",
    "comparison_tables",
    "overview_table",
    "verdict_table",
]

_SCHEMA = "navreplay comparison 1"
_COMMON = ("versions", "channels", "files", "assumptions", "damage", "findings", "configuration")
_OWN = (
    "verdict",
    "warnings",
    "drive",
    "errors",
    "nees",
    "within_3_sigma",
    "nis",
    "innovations",
    "satellites",
    "outages",
    "events",
    "timing_s",
)
_HEADLINES = {"position": "3d", "velocity": "3d", "attitude": "heading"}
_GRADES = ("good", "fair", "poor")
_STRETCHES = {"all": "whole drive", "outside": "outside outages", "inside": "inside outages"}
_STYLES = tuple(f"c{number}" for number in range(1, 7))
MOST_DRAWN = len(_STYLES)
"""Runs that the plots can tell apart, and that have a headline each."""


@dataclass(frozen=True, eq=False, slots=True)
class Comparison:
    """What is left of the runs once each has written its own outputs, in their order.

    reports: of every variant that ran, as `build_report` makes them. failures: of the others, why they could not. drawn: the
    results of the first MOST_DRAWN that ran; of more, plots would be unreadable and memory full.
    """

    reports: tuple[tuple[Variant, Report], ...]
    failures: tuple[tuple[Variant, str], ...]
    drawn: tuple[tuple[Variant, RunResult], ...]


def build_comparison(comparison: Comparison) -> Report:
    """What the runs share once (of the first run), by label under ``methods`` what each one reports of its own, and under
    ``failures`` why the others could not run."""
    variant, first = comparison.reports[0]
    return {
        "schema": _SCHEMA,
        **{key: first[key] for key in _COMMON},
        "varied": variant.setting.key or None,
        "methods": {
            variant.label: {"value": variant.setting.value, **{key: report[key] for key in _OWN}}
            for variant, report in comparison.reports
        },
        "failures": {variant.label: reason for variant, reason in comparison.failures},
    }


def comparison_figures(report: Report) -> tuple[Figure, ...]:
    """A headline per method: its horizontal error, and where there were outages that at their ends. None of more methods than
    can be drawn: the overview tells more at a glance."""
    if len(report["methods"]) > MOST_DRAWN:
        return ()
    figures = []
    for label, method in report["methods"].items():
        ends = method["outages"]["summary"]["end_horizontal"]
        context = (
            f"at outage ends {figure_text(ends['p50'], 'm')} median, {figure_text(ends['p95'], 'm')} 95 %"
            if ends["count"]
            else ""
        )
        if method["errors"] is not None:
            stretch = "outside" if ends["count"] and method["errors"]["outside"]["position"]["horizontal"]["count"] else "all"
            rms = figure_text(method["errors"][stretch]["position"]["horizontal"]["rms"], "m")
            figures.append(Figure(label, rms, f"horizontal RMS {_STRETCHES[stretch]}; {context}".rstrip("; ")))
    return tuple(figures)


def comparison_tables(report: Report) -> tuple[Table, ...]:
    """The overview, what could not run, and one table per quantity, a row per method."""
    methods = report["methods"]
    failures = Table("Could not run", ("method", "reason"), tuple(report["failures"].items()))
    tables = [table for table in (overview_table(report), verdict_table(report), failures) if table.rows]
    first = next(iter(methods.values()))
    if first["errors"] is not None:
        for quantity in first["errors"]["all"]:
            tables += [table for stretch in _STRETCHES if (table := _error_table(report, quantity, stretch)).rows]
    tables += [table for table in (_outage_table(report), _consistency_table(report), _use_table(report)) if table.rows]
    seconds = tuple((label, figure_text(sum(method["timing_s"].values()))) for label, method in methods.items())
    return (*tables, Table("Time spent", ("method", "seconds"), seconds, "Reading included, which is done once for all."))


def overview_table(report: Report) -> Table:
    """The figures that matter most, a row per method; no rows without a reference."""
    methods = {label: method for label, method in report["methods"].items() if method["errors"] is not None}
    if not methods:
        return Table("Overview", ("method",), ())
    outages = any(method["outages"]["summary"]["end_horizontal"]["count"] for method in methods.values())
    columns = {label: _headline_columns(method, "outside" if outages else "all") for label, method in methods.items()}
    heads = next(iter(columns.values()))
    rows = tuple((label, *(figure_text(figures.get(head)) for head in heads)) for label, figures in columns.items())
    stretch = "outside outages, which last until a fix is used again" if outages else "whole drive"
    note = f"Errors are RMS, {stretch}; NEES over its expected value: 1 is right."
    return Table("Overview", ("method", *heads), rows, note)


def comparison_notice(report: Report) -> Notice:
    """The verdict on each run, in the colour of the worst."""
    verdicts = {label: method["verdict"] for label, method in report["methods"].items()}
    grades = [verdict["grade"] for verdict in verdicts.values()]
    counts = ", ".join(f"{grades.count(grade)} {grade}" for grade in _GRADES if grade in grades)
    lines = tuple(f"{label}: {verdict['summary']}" for label, verdict in verdicts.items())
    return Notice(max(grades, key=_GRADES.index), f"Verdicts: {counts}", lines)


def verdict_table(report: Report) -> Table:
    """The verdict on each run."""
    rows = []
    for label, method in report["methods"].items():
        verdict = method["verdict"]
        expected = verdict["expected_horizontal_m"]
        shares = (f"{kind.replace('_', ' ')} {use['used']} of {use['read']}" for kind, use in verdict["kinds"].items())
        figures = figure_text(expected["median"], "m"), figure_text(expected["p95"], "m")
        rows.append((label, verdict["grade"], verdict["limited_by"], *figures, ", ".join(shares)))
    header = ("method", "verdict", "limited by", "expected horizontal median", "95 %", "used")
    return Table("Verdict", header, tuple(rows), "Expected is what the covariance says, corrected by the innovations.")


def _headline_columns(method: Mapping[str, Any], stretch: str) -> dict[str, float | None]:
    """By head of the column. stretch: for which the errors count."""
    errors = method["errors"][stretch]
    columns: dict[str, float | None] = {}
    for quantity, component in _HEADLINES.items():
        if quantity in errors:
            table = errors[quantity]
            columns[f"{quantity} {component.replace('3d', '3-D')} [{table['unit']}]"] = table[component]["rms"]
    if stretch == "outside":
        columns["outage end, horizontal median [m]"] = method["outages"]["summary"]["end_horizontal"]["p50"]
    nees = method["nees"]["position"]
    columns["position NEES"] = None if nees["mean"] is None else nees["mean"] / nees["dof"]
    columns["epochs"] = errors["position"]["3d"]["count"]
    return columns


def _error_table(report: Report, quantity: str, stretch: str) -> Table:
    rows: list[tuple[str, ...]] = []
    components: tuple[str, ...] = ()
    unit = ""
    for label, method in report["methods"].items():
        table = method["errors"][stretch].get(quantity)
        if table is None:
            continue
        unit = table["unit"]
        components = tuple(name for name in table if name != "unit")
        figures = [figure_text(table[name][statistic]) for name in components for statistic in _statistics(name)]
        if table[components[0]]["count"]:
            rows.append((label, *figures, str(table[components[0]]["count"])))
    heads = [f"{name.replace('3d', '3-D')} {word}" for name in components for word in _statistics(name).values()]
    title = f"{quantity.replace('_', ' ').capitalize()} error {_STRETCHES[stretch]} [{unit}]"
    return Table(title, ("method", *heads, "epochs"), tuple(rows))


def _statistics(component: str) -> dict[str, str]:
    """What is told of a component, and in which word: of the length of an error more than of its parts."""
    if component in ("horizontal", "3d"):
        return {"rms": "rms", "p50": "median", "p95": "95 %", "max": "max"}
    return {"rms": "rms", "p95": "95 %"}


def _outage_table(report: Report) -> Table:
    rows = []
    names = ("end_horizontal", "end_3d", "max_horizontal")
    for label, method in report["methods"].items():
        summary = method["outages"]["summary"]
        if summary["end_horizontal"]["count"]:
            figures = [figure_text(summary[name][statistic]) for name in names for statistic in ("p50", "p95", "max")]
            rows.append((label, *figures, str(summary["end_horizontal"]["count"])))
    words = ("end horizontal", "end 3-D", "largest horizontal")
    header = ("method", *(f"{name} {statistic}" for name in words for statistic in ("median", "95 %", "max")), "outages")
    return Table("Outages [m]", header, tuple(rows), "Errors at the end are those before the next fix corrects.")


def _consistency_table(report: Report) -> Table:
    rows = []
    for label, method in report["methods"].items():
        judged = [(f"NEES {name}", values) for name, values in (method["nees"] or {}).items()]
        judged += [(f"NIS {name}", values) for name, values in method["nis"].items()]
        for name, values in judged:
            share = "–" if values["share_inside"] is None else f"{100 * values['share_inside']:.1f} %"
            rows.append((name, label, figure_text(values["dof"]), figure_text(values["mean"]), share))
    rows.sort(key=lambda row: row[0])
    return Table("Consistency", ("", "method", "expected", "mean", "inside 95 % bounds"), tuple(rows))


def _use_table(report: Report) -> Table:
    rows = tuple(
        (kind, label, str(series["read"]), str(series["used"]), str(series["read"] - series["used"]))
        for label, method in report["methods"].items()
        for kind, series in method["innovations"].items()
    )
    return Table("Measurements", ("", "method", "read", "used", "rejected"), tuple(sorted(rows, key=lambda row: row[0])))


def comparison_plots(comparison: Comparison) -> tuple[Plot, ...]:
    """The tracks, and for each quantity the errors, of the runs that are drawn."""
    labels = [variant.label for variant, _ in comparison.drawn]
    results = [result for _, result in comparison.drawn]
    styles = _STYLES[: len(labels)]
    legend = tuple((f"line {style}", label) for style, label in zip(styles, labels, strict=True))
    tracks = _track_layers(labels, styles, results)
    runs = len(comparison.reports)
    of_all = f" The first {len(labels)} of {runs} runs are drawn; the tables show all." if runs > len(labels) else ""
    live = Live(shades=outage_shades(results[0]), track=track_of(results, labels, styles))
    plots = [_plot_tracks(tracks, results[0], of_all, live)]
    judged = [result.evaluation for result in results if result.evaluation is not None]
    for quantity in judged[0].errors if judged else ():
        beside_tracks = map_height(tracks) if len(plots) == 1 else None
        plots.append(_plot_errors(quantity, labels, styles, results, legend, beside_tracks, of_all))
    return tuple(plots)


def _plot_tracks(layers: Sequence[Layer], first: RunResult, of_all: str, live: Live) -> Plot:
    legend = tuple((f"{layer.kind} {layer.style}", layer.name) for layer in layers)
    lat, lon = np.degrees(first.solution.lla[0, :2])
    note = f"East and north of the first position, {lat:.6f}°, {lon:.6f}°.{of_all}"
    return Plot("Track", note, legend, draw_map(layers), live)


def _track_layers(labels: Sequence[str], styles: Sequence[str], results: Sequence[RunResult]) -> list[Layer]:
    origin = results[0].solution.lla[0]
    layers = []
    reference = results[0].timeline.reference
    if reference is not None:
        where = ned_between(origin, reference.lla)
        layers.append(Layer("line", where[:, 1], where[:, 0], "reference", "reference"))
    for label, style, result in zip(labels, styles, results, strict=True):
        track = ned_between(origin, result.solution.lla)
        layers.append(Layer("line", track[:, 1], track[:, 0], style, label))
    return layers


def _plot_errors(
    quantity: str,
    labels: Sequence[str],
    styles: Sequence[str],
    results: Sequence[RunResult],
    legend: tuple[tuple[str, str], ...],
    height: float | None,
    of_all: str,
) -> Plot:
    start = min(int(result.solution.t_ns[0]) for result in results)
    duration = max(int(result.solution.t_ns[-1]) - start for result in results) / 1e9
    drawn = [
        (label, style, result.evaluation.t_ns, result.evaluation.errors[quantity])
        for label, style, result in zip(labels, styles, results, strict=True)
        if result.evaluation is not None and quantity in result.evaluation.errors
    ]
    first = drawn[0][3]
    factor, unit = (np.degrees(1.0), "deg") if first.unit == "rad" else (1.0, first.unit)
    bend = bend_of(*(series.error * factor for _, _, _, series in drawn))
    panels = []
    for i, axis in enumerate(first.labels):
        layers = [
            Layer("line", (t_ns - start) / 1e9, series.error[:, i] * factor, style, label)
            for label, style, t_ns, series in drawn
        ]
        panels.append(Panel(f"{axis} [{unit}]", tuple(layers), bend))
    note = f"Estimated minus reference.{'' if bend is None else ' Signed logarithmic scale.'}{of_all}"
    shades = outage_shades(results[0])
    svg = draw_time_panels(panels, duration, shades, height)
    return Plot(f"{quantity.replace('_', ' ').capitalize()} error", note, legend, svg, Live(tuple(panels), shades))
