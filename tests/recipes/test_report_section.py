"""docs/recipes.md, a section of the report: a function of the report's values that gives a table."""

from pipelines.report.content import build_report
from pipelines.report.markdown import render_markdown
from pipelines.report.table import Table
from pipelines.report.tables import headline_figures, report_tables
from tests.helpers.sample_drive import make_result


def files_by_size(report) -> Table:
    """The files of the run, the largest first."""
    rows = sorted(((file["path"], file["size"]) for file in report["files"]), key=lambda row: -row[1])
    return Table("Files by size", ("file", "bytes"), [(path, str(size)) for path, size in rows])


def test_it_stands_in_the_report() -> None:
    report = build_report(make_result())
    page = render_markdown("drive", headline_figures(report), [*report_tables(report), files_by_size(report)])
    assert "## Files by size" in page
