"""What a report consists of beside its plots: headline figures and tables of texts."""

from dataclasses import dataclass

__all__ = ["Figure", "Table", "figure_text"]


@dataclass(frozen=True, slots=True)
class Figure:
    """A headline figure: what it is, its value with unit, and a word of context (may be empty)."""

    name: str
    value: str
    context: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts. note: one sentence below it (may be empty). One column without a header is a list of sentences."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    @property
    def is_list(self) -> bool:
        """Whether it is a list of sentences."""
        return self.header == ("",)


def figure_text(value: float | None, unit: str = "") -> str:
    """A figure to three significant digits; a dash for an unknown one."""
    if value is None:
        return "–"
    if isinstance(value, int):
        text = str(value)
    else:
        text = f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.1e}"
    return f"{text} {unit}".strip()
