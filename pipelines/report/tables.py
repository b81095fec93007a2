"""The tables of a report, taken from its plain data; Markdown and HTML only set them."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from pipelines.plotting.angles import suit_unit
from pipelines.report.content import Report
from pipelines.report.satellite_tables import satellite_figure, satellite_tables
from pipelines.report.table import Figure, Table, figure_text

__all__ = ["headline_figures", "report_tables"]

_STRETCHES = {"all": "whole drive", "outside": "outside outages", "inside": "inside outages"}
_STATISTICS = ("rms", "mean", "std", "p50", "p68", "p95", "max", "count")


def _duration_text(seconds: float) -> str:
    minutes, second = divmod(round(seconds), 60)
    return f"{minutes} min {second:02d} s" if minutes else f"{seconds:.1f} s"


def headline_figures(report: Report) -> tuple[Figure, ...]:
    """What a reader looks for first."""
    drive = report["drive"]
    distance = f"{drive['distance_m'] / 1000:.2f} km"
    figures = [Figure("Drive", _duration_text(drive["duration_s"]), f"{distance}, method {drive['method']}")]
    errors = report["errors"]
    if errors is not None:
        stretch = "outside" if report["outages"]["counted"] and errors["outside"]["position"]["horizontal"]["count"] else "all"
        position = errors[stretch]["position"]
        words = _STRETCHES[stretch]
        for name, component in (("Horizontal error", "horizontal"), ("Height error", "down")):
            p95 = figure_text(position[component]["p95"], "m")
            figures.append(Figure(f"{name} RMS", figure_text(position[component]["rms"], "m"), f"{words}; 95 % {p95}"))
    figures += _outage_figures(report["outages"])
    if errors is not None and "attitude" in errors["all"]:
        figures.append(_attitude_figure(errors["all"]))
    if report["nees"] is not None:
        nees = report["nees"]["position"]
        inside = f"3 expected; {_percent(nees['share_below_upper'])} below the 97.5 % bound"
        figures.append(Figure("Position NEES", figure_text(nees["mean"]), inside))
    if report["satellites"] is not None:
        figures.append(satellite_figure(report["satellites"]))
    counts = [(kind, innovation["used"], innovation["read"]) for kind, innovation in report["innovations"].items()]
    if counts:
        used, read = sum(count[1] for count in counts), sum(count[2] for count in counts)
        kinds = "; ".join(f"{kind} {used} of {read}" for kind, used, read in counts)
        figures.append(Figure("Measurements used", f"{100 * used / max(read, 1):.4g} %", kinds))
    return tuple(figures)


def _attitude_figure(errors: Mapping[str, Any]) -> Figure:
    """Heading or, where attitudes were measured against the stars, the worst axis against these."""
    name, table, axes = "Heading error RMS", errors["attitude"], ("heading",)
    if "inertial_attitude" in errors:
        name, table, axes = "Attitude error RMS", errors["inertial_attitude"], ("north", "east", "heading")
    rms = max((table[axis]["rms"] for axis in axes if table[axis]["count"]), default=None)
    factor, unit = suit_unit("deg", inf if rms is None else rms)
    context = "whole drive" if len(axes) == 1 else "whole drive, worst axis, against Earth-fixed axes"
    return Figure(name, figure_text(None if rms is None else rms * factor, unit), context)


def _outage_figures(outages: Mapping[str, Any]) -> list[Figure]:
    summary = outages["summary"]["end_horizontal"]
    if not outages["count"]:
        return []
    if not summary["count"]:
        longest = max(outage["length_s"] for outage in outages["list"])
        return [Figure("Outages", str(outages["count"]), f"longest {longest:.0f} s")]
    context = f"median of {_counted_text(outages)}; 95 % {figure_text(summary['p95'], 'm')}"
    return [Figure("Horizontal error at outage end", figure_text(summary["p50"], "m"), context)]


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.1f} %"


def _reasons(rejected: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {reason}" for reason, count in rejected.items())


def report_tables(report: Report) -> tuple[Table, ...]:
    """All tables in the order of a report."""
    tables: list[Table] = []
    if report["errors"] is not None:
        tables += _error_tables(report["errors"])
    tables += _outage_tables(report["outages"])
    tables.append(_consistency_table(report))
    if report["within_3_sigma"] is not None:
        tables.append(_coverage_table(report["within_3_sigma"]))
    if report["innovations"]:
        tables.append(_innovation_table(report["innovations"]))
    if report["satellites"] is not None:
        tables += satellite_tables(report["satellites"])
    tables.append(_channel_table(report["channels"]))
    tables += _text_tables(report)
    return tuple(tables)


def _error_tables(errors: Mapping[str, Any]) -> list[Table]:
    tables = []
    for quantity, first in errors["all"].items():
        rows = []
        middles = [figures["p50"] for component, figures in first.items() if component != "unit" and figures["count"]]
        factor, unit = suit_unit(first["unit"], max(middles, default=inf))
        for stretch, words in _STRETCHES.items():
            table = errors[stretch][quantity]
            for component, figures in table.items():
                if component != "unit" and figures["count"]:
                    shown = (figure_text(figures[name] * (1 if name == "count" else factor)) for name in _STATISTICS)
                    rows.append((words, component.replace("3d", "3-D"), *shown))
        title = f"{quantity.replace('_', ' ').capitalize()} error [{unit}]"
        tables.append(
            Table(
                title, ("", "component", *_STATISTICS), tuple(rows), "Estimated minus reference; percentiles of the magnitude."
            )
        )
    return tables


def _outage_tables(outages: Mapping[str, Any]) -> list[Table]:
    if not outages["count"]:
        return []
    names = ("end_horizontal_m", "end_3d_m", "max_horizontal_m", "max_3d_m")
    rows = [
        (
            str(number),
            outage["start_utc"].partition("T")[2][:10],
            figure_text(outage["length_s"], "s"),
            figure_text(outage["distance_m"], "m"),
            *(figure_text(outage[name]) for name in names),
            outage["cause"],
        )
        for number, outage in enumerate(outages["list"], start=1)
    ]
    starts = [(outage["start_elapsed_s"], outage["start_elapsed_s"] + outage["length_s"]) for outage in outages["list"]]
    counted = f"of {_counted_text(outages)}"
    for share, word in (("p50", "median"), ("p95", "95 %")) if outages["counted"] else ():
        figures = (figure_text(outages["summary"][name.removesuffix("_m")][share]) for name in names)
        rows.append((word, "", "", "", *figures, counted))
    header = ("", "start UTC", "length", "distance", "end horizontal", "end 3-D", "largest horizontal", "largest 3-D", "cause")
    spans = (*starts, *[None] * (len(rows) - len(starts)))
    return [Table("Outages [m]", header, tuple(rows), "Errors at the end are those before the next fix corrects.", spans)]


def _counted_text(outages: Mapping[str, Any]) -> str:
    simulated = any(outage["cause"] == "simulated" for outage in outages["list"])
    return f"{outages['counted']} {'simulated' if simulated else 'without fixes'}"


def _consistency_table(report: Report) -> Table:
    judged = [(f"NEES {name}", values) for name, values in (report["nees"] or {}).items()]
    judged += [(f"NIS {name}", values) for name, values in report["nis"].items()]
    rows = tuple(
        (
            name,
            figure_text(values["dof"]),
            figure_text(values["mean"]),
            f"{values['lower']:.3g} to {values['upper']:.3g}",
            _percent(values["share_inside"]),
            _percent(values["share_below_upper"]),
            figure_text(values["count"]),
        )
        for name, values in judged
    )
    header = ("", "expected", "mean", "95 % bounds", "inside", "below the upper", "epochs")
    return Table("Consistency", header, rows, "Inside the bounds 95 % are expected, below the upper one 97.5 %.")


def _coverage_table(within: Mapping[str, Mapping[str, float]]) -> Table:
    rows = tuple((quantity, label, _percent(share)) for quantity, shares in within.items() for label, share in shares.items())
    return Table("Errors within 3 sigma", ("", "component", "share"), rows, "99.7 % are expected.")


def _innovation_table(innovations: Mapping[str, Any]) -> Table:
    rows = []
    for kind, series in innovations.items():
        for label, component in series["components"].items():
            rms, mean = component["residual"]["rms"], component["residual"]["mean"]
            factor, unit = suit_unit(series["unit"], rms if rms is not None else inf)
            rows.append(
                (
                    kind,
                    label,
                    figure_text(None if rms is None else rms * factor, unit),
                    figure_text(None if mean is None else mean * factor, unit),
                    figure_text(component["normalised"]["rms"]),
                    figure_text(component["noise_over_nominal"]["p50"]),
                    f"{series['used']} of {series['read']}",
                    _reasons(series["rejected"]),
                )
            )
    header = ("", "component", "rms", "mean", "rms in sigma", "noise used over told", "used", "rejected")
    return Table(
        "Innovations", header, tuple(rows), "Of the measurements used; 1 sigma is expected; the noise ratio is a median."
    )


def _channel_table(channels: Sequence[Mapping[str, Any]]) -> Table:
    rows = tuple(
        (c["name"], c["role"], c["type"], str(c["read"]), str(c["used"]), str(c["read"] - c["used"]), _reasons(c["rejected"]))
        for c in channels
    )
    return Table(
        "Channels", ("channel", "role", "type", "read", "used", "rejected", "reasons"), rows, "Read = used + rejected."
    )


def _text_tables(report: Report) -> list[Table]:
    findings = tuple((f["level"], f["text"], f["hint"]) for f in report["findings"])
    events = tuple((e["utc"].partition("T")[2][:10], e["level"], e["text"]) for e in report["events"][:200])
    files = tuple((f["path"], f["format"], str(f["size"]), f["sha256"]) for f in report["files"])
    moments = tuple((e["elapsed_s"], e["elapsed_s"]) for e in report["events"][:200])
    more = len(report["events"]) - len(events)
    tables = [
        Table("Findings", ("level", "finding", "what to do"), findings),
        Table("Damage", ("found in the files",), tuple((text,) for text in report["damage"])),
        Table("Assumptions", ("assumed or converted on the way",), tuple((text,) for text in report["assumptions"])),
        Table("Events", ("UTC", "level", "event"), events, f"{more} more are in report.json." if more else "", moments),
        Table("Files", ("file", "format", "bytes", "SHA-256"), files),
        Table("Time spent", ("stage", "seconds"), tuple((k, figure_text(v)) for k, v in report["timing_s"].items())),
    ]
    return [table for table in tables if table.rows]
