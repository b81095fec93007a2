"""report.html: one page without any network, readable on a phone, in light and dark."""

import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files

from pipelines.plotting.live import Clock, pack_plots
from pipelines.plotting.plot import Plot
from pipelines.report.table import Figure, Notice, Table

__all__ = ["render_html"]

_FIGURE_CELL = re.compile(r"[-−–]?[\d.,]*(e[-+]?\d+)?( ± [\d.,]+(e[-+]?\d+)?)?( ?(%|s|m|m/s|deg))?")
_SCRIPTS = ("data.js", "panels.js", "track.js", "page.js")
_LEVELS = ("warning", "error", "good", "fair", "poor")
_SAMPLES = {
    "line": '<path class="{}" d="M1 5H19"/>',
    "band": '<path class="{}" d="M1 1H19V9H1Z"/>',
    "dots": '<path class="{}" d="M4 5h0M10 5h0M16 5h0"/>',
    "crosses": '<path class="{}" d="M7 2l6 6m0-6l-6 6"/>',
}


def render_html(
    title: str,
    subtitle: str,
    figures: Sequence[Figure],
    plots: Sequence[Plot],
    tables: Sequence[Table],
    configuration: Mapping[str, object],
    notice: Notice | None = None,
    clock: Clock | None = None,
) -> str:
    """The page, with a notice on top. All texts are escaped here; drawings come ready. clock: of the plots, where a browser is
    to draw those it can zoom into; without it, and without scripts, the drawings stand."""
    assets = files("pipelines.report") / "assets"
    config = escape(json.dumps(configuration, indent=1, ensure_ascii=False))
    return "".join(
        [
            '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title><style>{(assets / 'report.css').read_text('utf-8')}",
            "" if clock is None else (assets / "live" / "uPlot.min.css").read_text("utf-8"),
            "</style></head>\n<body><main>",
            f'<h1>{escape(title)}</h1><p class="dim">{escape(subtitle)}</p>\n',
            "" if notice is None else _render_notice(notice),
            '<div class="figures">',
            *(_render_figure(figure) for figure in figures),
            '</div>\n<div class="plots">',
            *(_render_plot(plot, index) for index, plot in enumerate(plots)),
            '</div>\n<div class="tables">',
            *(_render_table(table) for table in tables),
            f"<section><details><summary>Configuration</summary><pre>{config}</pre></details></section></div></main>\n",
            "" if clock is None else _render_scripts(plots, clock),
            "</body></html>\n",
        ]
    )


def _render_scripts(plots: Sequence[Plot], clock: Clock) -> str:
    """The data of the plots, uPlot under its licence, and what draws with it."""
    live = files("pipelines.report") / "assets" / "live"
    described, data = pack_plots(plots, clock)
    own = "\n".join([(live / name).read_text("utf-8") for name in _SCRIPTS])
    library, licence = ((live / name).read_text("utf-8") for name in ("uPlot.iife.min.js", "uPlot.licence.txt"))
    return (
        f'<script type="application/json" id="plots-described">{described}</script>\n'
        f'<script type="text/plain" id="plots-data">{data}</script>\n'
        f'<script>/* uPlot\n{licence}*/\n{library}</script>\n<script>(function () {{\n"use strict";\n{own}}})();</script>\n'
    )


def _render_notice(notice: Notice) -> str:
    items = "".join([f"<li>{escape(line)}</li>" for line in notice.lines])
    return f'<section class="notice {escape(notice.level)}"><h2>{escape(notice.title)}</h2><ul>{items}</ul></section>\n'


def _render_figure(figure: Figure) -> str:
    context = f'<span class="dim">{escape(figure.context)}</span>' if figure.context else ""
    return f"<div><span>{escape(figure.name)}</span><b>{escape(figure.value)}</b>{context}</div>"


def _render_plot(plot: Plot, index: int) -> str:
    legend = "".join([_render_sample(style) + f"{escape(name)}</span>" for style, name in plot.legend])
    live = "" if plot.live is None else f' data-live="{index}"'
    return (
        f"<figure{live}><figcaption><h2>{escape(plot.title)}</h2><p>{escape(plot.note)}</p>"
        f'<div class="legend">{legend}</div></figcaption>{plot.svg}<output></output></figure>\n'
    )


def _render_sample(style: str) -> str:
    kind = style.split()[0]
    return f'<span><svg viewBox="0 0 20 10">{_SAMPLES[kind].format(escape(style))}</svg>'


def _render_table(table: Table) -> str:
    if table.is_list:
        items = "".join([f"<li>{escape(text)}</li>" for (text,) in table.rows])
        return f"<section><h2>{escape(table.title)}</h2><ul>{items}</ul></section>\n"
    numeric = [
        bool(table.rows) and all(_FIGURE_CELL.fullmatch(row[i]) for row in table.rows) and any(row[i] for row in table.rows)
        for i in range(len(table.header))
    ]
    mark = [' class="n"' if number else "" for number in numeric]
    head = "".join([f"<th{m}>{escape(cell)}</th>" for m, cell in zip(mark, table.header, strict=True)])
    rows = []
    spans = table.spans or (None,) * len(table.rows)
    for row, span in zip(table.rows, spans, strict=True):
        cells = [
            f"<td{f' class={cell}' if cell in _LEVELS else m}>{escape(cell)}</td>" for m, cell in zip(mark, row, strict=True)
        ]
        rows.append(f"<tr{_render_span(span)}>{''.join(cells)}</tr>")
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    return (
        f'<section><h2>{escape(table.title)}</h2><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>{note}</section>\n"
    )


def _render_span(span: tuple[float, float] | None) -> str:
    return "" if span is None else f' data-from="{span[0]:.3f}" data-to="{span[1]:.3f}"'
