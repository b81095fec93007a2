"""report.md: the headline figures and the tables of a report."""

from collections.abc import Sequence

from pipelines.report.table import Figure, Notice, Table

__all__ = ["render_markdown"]


def _escape(text: str) -> str:
    flat = " ".join(text.split())
    for character in "\\`*_[]<>|":
        flat = flat.replace(character, f"\\{character}")
    return flat


def _render_table(table: Table) -> str:
    if table.is_list:
        return f"## {table.title}\n\n" + "\n".join(f"- {_escape(text)}" for (text,) in table.rows) + "\n"
    rows = [table.header, ("---",) * len(table.header)]
    lines = ["| " + " | ".join(cells) + " |" for cells in rows]
    lines += ["| " + " | ".join(_escape(cell) for cell in row) + " |" for row in table.rows]
    note = f"\n\n{table.note}" if table.note else ""
    return f"## {table.title}\n\n" + "\n".join(lines) + note + "\n"


def render_markdown(title: str, figures: Sequence[Figure], tables: Sequence[Table], notice: Notice | None = None) -> str:
    """The report as Markdown, a notice first; texts that come from logs are escaped."""
    headline = []
    if notice is not None:
        headline = [f"**{_escape(notice.title)}**\n", *(f"- {_escape(line)}" for line in notice.lines), ""]
    for figure in figures:
        context = f" ({_escape(figure.context)})" if figure.context else ""
        headline.append(f"- {_escape(figure.name)}: **{_escape(figure.value)}**{context}")
    return "\n".join([f"# {_escape(title)}\n", *headline, "", *[_render_table(table) for table in tables]])
