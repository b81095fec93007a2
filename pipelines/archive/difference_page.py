"""The page of a difference: what changed in sum, run by run, and the separation of the trajectories that moved most."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.archive.difference import Difference, DriveChange, Separation, separate
from pipelines.files.whole_file import write_whole
from pipelines.plotting.plot import Plot, bend_of
from pipelines.plotting.svg import Layer, Panel, draw_map, draw_time_panels
from pipelines.report.html import render_html
from pipelines.report.table import Figure, Notice, Table, figure_text

__all__ = ["write_difference"]

_DRAWN = 12
_LISTED = 500


def write_difference(path: Path, difference: Difference, before: Path, after: Path, tolerance_m: float) -> None:
    """Writes the page, whole. Raises OSError, and LogError where a solution cannot be read."""
    changed = [one for one in difference.changes if one.what != "same"]
    beyond = difference.beyond(tolerance_m)
    drawn = [one for one in changed if one.largest_m][:_DRAWN]
    plots = [plot for one in drawn for plot in _plots(one, separate(before, after, one.drive, one.method))]
    title = f"{len(beyond)} of {len(difference.changes)} runs beyond {tolerance_m:g} m"
    lines = tuple(f"{one.drive} ({one.method}): {_what(one)}" for one in beyond[:5])
    html = render_html(
        "What changed in an archive",
        f"{before} and {after}",
        _figures(difference, len(changed)),
        plots,
        (_over_drives(difference), *_settings(difference), _drive_by_drive(changed)),
        {"before": str(before), "after": str(after), "tolerance_m": tolerance_m},
        Notice("poor" if beyond else "good", title, lines),
    )
    write_whole(path, lambda part: part.write_text(html, encoding="utf-8"))


def _figures(difference: Difference, changed: int) -> list[Figure]:
    largest = max((one.largest_m or 0.0 for one in difference.changes), default=0.0)
    words = {one.figure: one for one in difference.figures}
    figures = [Figure("Runs changed", str(changed), f"of {len(difference.changes)}")]
    figures.append(Figure("Largest separation", figure_text(largest, "m")))
    for name, title in (("horizontal_rms_m", "Horizontal rms"), ("position_nees", "NEES of position")):
        if name in words:
            one = words[name]
            figures.append(Figure(title, f"{100 * one.relative:+.2f} %", f"{one.word} over {one.drives} runs"))
    return figures


def _over_drives(difference: Difference) -> Table:
    rows = tuple(
        (
            *(one.figure, str(one.drives), f"{one.mean:+.3g}", "" if np.isinf(one.error) else f"{one.error:.2g}"),
            *(f"{100 * one.relative:+.2f}", one.word),
        )
        for one in difference.figures
    )
    note = "Paired over the runs that have the figure in both; undecided: the mean is within twice its standard error."
    return Table("Over all runs", ("figure", "runs", "mean change", "standard error", "%", "word"), rows, note)


def _settings(difference: Difference) -> tuple[Table, ...]:
    rows = tuple((text, str(count)) for text, count in difference.settings.items())
    return (Table("Settings that differ", ("setting: before -> after", "runs"), rows[:_LISTED]),) if rows else ()


def _drive_by_drive(changed: Sequence[DriveChange]) -> Table:
    rows = []
    for one in changed[:_LISTED]:
        old, new = one.figures.get("horizontal_rms_m", (None, None))
        nees = one.figures.get("position_nees", (None, None))
        apart = ("", "", "") if one.largest_m is None else (f"{one.largest_m:.3g}", f"{one.rms_m:.3g}", f"{one.at_s:.1f}")
        where = "" if one.lat_deg is None else f"{one.lat_deg:.6f}, {one.lon_deg:.6f}"
        rows.append((one.drive, one.method, one.what, *apart, where, _pair(old, new), _pair(*nees), ", ".join(one.causes)))
    header = ("drive", "method", "what", "largest m", "rms m", "at s", "where", "horizontal rms m", "NEES", "differ")
    note = f"The first {_LISTED} of {len(changed)}." if len(changed) > _LISTED else "The largest regressions first."
    return Table("Run by run", header, tuple(rows), note)


def _pair(old: float | None, new: float | None) -> str:
    return "" if old is None or new is None else f"{old:.3g} → {new:.3g}"


def _what(one: DriveChange) -> str:
    return one.what if one.largest_m is None else f"apart by up to {one.largest_m:.3g} m at {one.at_s:.1f} s"


def _plots(one: DriveChange, apart: Separation | None) -> list[Plot]:
    """Horizontal and vertical separation over time, and both tracks."""
    if apart is None:
        return []
    name = f"{one.drive} ({one.method})"
    t = (apart.t_ns - apart.t_ns[0]) / 1e9
    panels = [
        Panel(label, (Layer("line", t, values, "c1", "separation"),), bend_of(values))
        for label, values in (
            ("horizontal [m]", np.linalg.norm(apart.ned_m[:, :2], axis=1)),
            ("down [m]", apart.ned_m[:, 2]),
        )
    ]
    svg = draw_time_panels(panels, float(t[-1]))
    note = f"After minus before; largest {one.largest_m:.3g} m at {one.at_s:.1f} s."
    tracks = (
        Layer("line", apart.track_m[:, 1], apart.track_m[:, 0], "reference", "before"),
        Layer("line", (apart.track_m + apart.ned_m)[:, 1], (apart.track_m + apart.ned_m)[:, 0], "c1", "after"),
    )
    legend = (("line reference", "before"), ("line c1", "after"))
    return [
        Plot(f"Separation: {name}", note, (("line c1", "separation"),), svg),
        Plot(f"Tracks: {name}", "East and north of the first position.", legend, draw_map(tracks)),
    ]
