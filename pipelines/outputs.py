"""Everything a run leaves in its folder; each file appears complete or not at all."""

from collections.abc import Callable, Iterable
from pathlib import Path

from navreplay.timeline import LogError
from pipelines.config.spec import dump_toml, filter_options
from pipelines.drive.compare import Outcome, Variant
from pipelines.drive.estimated import estimated_toml
from pipelines.drive.result import RunResult
from pipelines.files.whole_file import write_whole
from pipelines.report.comparison import (
    MOST_DRAWN,
    Comparison,
    build_comparison,
    comparison_figures,
    comparison_notice,
    comparison_plots,
    comparison_tables,
)
from pipelines.report.content import Report, build_report, dump_json
from pipelines.report.figures import report_plots
from pipelines.report.html import render_html
from pipelines.report.markdown import render_markdown
from pipelines.report.sections.course import clock_of
from pipelines.report.sections.stretches import stretch_tables
from pipelines.report.tables import headline_figures, report_tables
from pipelines.report.verdict import verdict_notice
from pipelines.trajectory.launch_csv import write_launch_csv
from pipelines.trajectory.solution_csv import utc_text, write_solution_csv, write_solution_parquet

__all__ = ["write_comparison", "write_each", "write_outputs"]

_LONGEST_NAMES = 60
"""Names of runs that a title holds [characters]."""


def write_outputs(result: RunResult, out_dir: str | Path, layer: tuple[str, str] | None = None) -> dict[str, Path]:
    """Writes solution.csv or .parquet, report.json, report.md, report.html, config.toml, config.estimated.toml where the method
    estimated noise from the whole log, launch.csv in the launch-inertial frame, and, unless the configuration says otherwise,
    recording.rrd; layer: the segment of a catalogue that the recording belongs to and its name there (see
    `write_recording`). Returns the paths by name. Raises LogError when the folder cannot be written."""
    report = build_report(result)
    title, subtitle = _title(result)
    figures, tables, notice = headline_figures(report), report_tables(report), verdict_notice(report["verdict"])
    tables = (*stretch_tables(result), *tables)
    html = render_html(
        title, subtitle, figures, report_plots(result), tables, report["configuration"], notice, clock_of([result])
    )
    markdown = render_markdown(title, figures, tables, notice)
    write_solution = write_solution_csv if result.config.output.format == "csv" else write_solution_parquet
    writers: dict[str, Callable[[Path], object]] = {
        f"solution.{result.config.output.format}": lambda path: write_solution(path, result.solution),
        "report.json": lambda path: path.write_text(dump_json(report), encoding="utf-8"),
        "report.md": lambda path: path.write_text(markdown, encoding="utf-8"),
        "report.html": lambda path: path.write_text(html, encoding="utf-8"),
        "config.toml": lambda path: path.write_text(dump_toml(result.config), encoding="utf-8"),
    }
    launch, imu = filter_options(result.config).launch, result.used.imu
    if launch is not None and imu is not None:
        writers["launch.csv"] = lambda path: write_launch_csv(path, result.solution, imu, launch)
    if result.solution.estimated:
        estimated = estimated_toml(result.config, result.solution)
        writers["config.estimated.toml"] = lambda path: path.write_text(estimated, encoding="utf-8")
    if result.config.output.recording:
        from pipelines.recording.view import write_recording  # loading rerun takes a second, and not every run records

        writers["recording.rrd"] = lambda path: write_recording(path, result, layer)
    return _write_files(Path(out_dir), writers)


def write_each(outcomes: Iterable[Outcome], out_dir: Path) -> Comparison:
    """Writes each run's own outputs, as it is done, in a folder of its own, and keeps what their comparison needs.

    Raises LogError as `write_outputs` does, and the first failure where every variant failed.
    """
    reports: list[tuple[Variant, Report]] = []
    failures: list[tuple[Variant, LogError]] = []
    drawn: list[tuple[Variant, RunResult]] = []
    for outcome in outcomes:
        variant, result = outcome.variant, outcome.result
        if isinstance(result, LogError):
            failures.append((variant, result))
            continue
        write_outputs(result, out_dir / variant.folder)
        reports.append((variant, build_report(result)))
        if len(drawn) < MOST_DRAWN:
            drawn.append((variant, result))
    if not reports:
        raise failures[0][1]
    return Comparison(tuple(reports), tuple((variant, str(error)) for variant, error in failures), tuple(drawn))


def write_comparison(comparison: Comparison, out_dir: Path) -> dict[str, Path]:
    """Writes report.json, report.md and report.html of several methods on one drive. Returns the paths by name. Raises LogError
    as `write_outputs` does."""
    report = build_comparison(comparison)
    drive, subtitle = _title(comparison.drawn[0][1])
    title = f"{drive}: {_name_runs(comparison)}"
    figures, tables, notice = comparison_figures(report), comparison_tables(report), comparison_notice(report)
    clock = clock_of([result for _, result in comparison.drawn])
    html = render_html(title, subtitle, figures, comparison_plots(comparison), tables, report["configuration"], notice, clock)
    markdown = render_markdown(title, figures, tables, notice)
    return _write_files(
        out_dir,
        {
            "report.json": lambda path: path.write_text(dump_json(report), encoding="utf-8"),
            "report.md": lambda path: path.write_text(markdown, encoding="utf-8"),
            "report.html": lambda path: path.write_text(html, encoding="utf-8"),
        },
    )


def _name_runs(comparison: Comparison) -> str:
    labels = [variant.label for variant, _ in comparison.reports]
    text = ", ".join(labels)
    return text if len(text) <= _LONGEST_NAMES else f"{len(labels)} runs"


def _title(result: RunResult) -> tuple[str, str]:
    files = [Path(file.path).name for file in result.timeline.provenance.files]
    start, end = utc_text(result.solution.t_ns[[0, -1]])
    return ", ".join(files) or "Drive", f"{start[:19].replace('T', ' ')} to {end[11:19]} UTC"


def _write_files(out_dir: Path, writers: dict[str, Callable[[Path], object]]) -> dict[str, Path]:
    try:
        for name, write in writers.items():
            write_whole(out_dir / name, write)
    except OSError as error:
        raise LogError(f"{out_dir}: cannot write the results: {error.strerror or error}; choose another -o") from error
    return {name: out_dir / name for name in writers}
