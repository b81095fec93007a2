"""What a report consists of beside its plots: headline figures and tables of texts."""

from dataclasses import dataclass
from math import floor, log10

__all__ = ["Figure", "Notice", "Table", "figure_text", "interval_text", "table_lines"]


@dataclass(frozen=True, slots=True)
class Figure:
    """A headline figure: what it is, its value with unit, and a word of context (may be empty)."""

    name: str
    value: str
    context: str = ""


@dataclass(frozen=True, slots=True)
class Notice:
    """What stands above all else: its level (``good``, ``fair`` or ``poor``), a title, and sentences."""

    level: str
    title: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts. note: one sentence below it (may be empty). One column without a header is a list of sentences. spans:
    per row the stretch (start, end) [s since the first row of the solution] that it tells of, None where it tells of none;
    empty where no row does."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    spans: tuple[tuple[float, float] | None, ...] = ()

    @property
    def is_list(self) -> bool:
        """Whether it is a list of sentences."""
        return self.header == ("",)


def interval_text(mean: float | None, half_width: float | None, unit: str = "") -> str:
    """A mean with half the width of its interval, that to two significant digits and the mean to the same place; a dash for
    an unknown mean."""
    if mean is None or not half_width:
        return figure_text(mean, unit)
    places = 1 - floor(log10(half_width))
    mean, half_width = round(mean, places), round(half_width, places)
    if 0 < max(abs(mean), half_width) < 1e-3:
        return f"{mean:.{max(places + floor(log10(abs(mean or half_width))), 0)}e} ± {half_width:.1e} {unit}".strip()
    shown = max(places, 0)
    return f"{mean:.{shown}f} ± {half_width:.{shown}f} {unit}".strip()


def table_lines(table: Table) -> list[str]:
    """Header and rows as lines of equal columns, the first to the left and the figures to the right."""
    rows = (table.header, *table.rows)
    widths = [max(len(row[i]) for row in rows) for i in range(len(table.header))]
    return [
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]


def figure_text(value: float | None, unit: str = "") -> str:
    """A figure to three significant digits; a dash for an unknown one."""
    if value is None:
        return "–"
    if isinstance(value, int):
        text = str(value)
    else:
        text = f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.1e}"
    return f"{text} {unit}".strip()
