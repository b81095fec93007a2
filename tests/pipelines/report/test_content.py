"""The report of a run: keys, figures, escaping, plots."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from navreplay.solution import Event
from navreplay.timeline import LogError
from pipelines.config.sections import OutputSection
from pipelines.drive.result import RunResult
from pipelines.notebook import open_run
from pipelines.outputs import write_outputs
from pipelines.report.content import build_report, dump_json
from pipelines.report.table import figure_text, interval_text
from pipelines.report.tables import headline_figures, report_tables
from pipelines.report.verdict import group_warnings
from tests.helpers.paths import ROOT
from tests.helpers.sample_drive import make_result, make_solution

NASTY = "/gps/<script>alert('x')</script>|&"


class Page(HTMLParser):
    """Tags in order, their attributes, and the text outside style and script."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self.open):
            self.text += data


def without_recording(result: RunResult) -> RunResult:
    output = OutputSection(recording=False)
    return replace(result, config=result.config.model_copy(update={"output": output}))


@pytest.fixture(scope="module")
def result() -> RunResult:
    return without_recording(make_result(make_solution(duration_s=90), topic=NASTY))


@pytest.fixture(scope="module")
def folder(result: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("out") / "made"
    write_outputs(result, path)
    return path


def test_outputs_are_named_and_nothing_else_is_left(result: RunResult, tmp_path: Path) -> None:
    outputs = write_outputs(result, tmp_path)
    names = ["solution.csv", "report.json", "report.md", "report.html", "config.toml"]
    assert list(outputs) == names
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


def test_the_solution_is_parquet_where_that_is_asked_for(result: RunResult, tmp_path: Path) -> None:
    output = result.config.output.model_copy(update={"format": "parquet"})
    outputs = write_outputs(replace(result, config=result.config.model_copy(update={"output": output})), tmp_path)
    assert "solution.parquet" in outputs
    assert not (tmp_path / "solution.csv").exists()
    assert np.allclose(
        open_run(tmp_path).solution.columns["lat_deg"], np.degrees(result.solution.lla[:, 0]), rtol=0, atol=1e-12
    )


def test_folder_that_cannot_be_written_is_told(result: RunResult, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(LogError, match="cannot write the results"):
        write_outputs(result, tmp_path / "file")


def test_json_holds_the_documented_keys(folder: Path) -> None:
    report = json.loads((folder / "report.json").read_text())
    documented = set(re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/report.md").read_text(), re.M))
    assert set(report) <= documented
    horizontal = report["errors"]["outside"]["position"]["horizontal"]
    assert list(horizontal) == ["count", "rms", "mean", "std", "p50", "p68", "p95", "max"]
    assert report["errors"]["all"]["attitude"]["unit"] == "deg"
    assert report["outages"]["count"] == len(report["outages"]["list"]) == 3
    assert report["channels"][0]["rejected"] == {"not finite": 2}
    assert report["files"][0]["sha256"] == "ab" * 32
    assert report["configuration"]["filter"]["name"] == "checked"
    innovations = report["innovations"]["position"]
    assert innovations["read"] == innovations["used"] + sum(innovations["rejected"].values())


def test_the_verdict_stands_on_top(folder: Path, result: RunResult) -> None:
    report = json.loads((folder / "report.json").read_text())
    described = report["verdict"]
    documented = (ROOT / "docs/report.md").read_text()
    assert all(f"`{key}`" in documented for key in [*described, *described["kinds"]["position"], *described["fixes"]])
    assert described["grade"] == result.verdict.grade
    kind = described["kinds"]["position"]
    assert kind["read"] == kind["used"] + kind["rejected"]
    html, markdown = (folder / "report.html").read_text(), (folder / "report.md").read_text()
    assert f'<section class="notice {described["grade"]}"><h2>Verdict: {described["grade"]}: ' in html
    assert markdown.splitlines()[2].startswith(f"**Verdict: {described['grade']}: ")
    assert sum(line.startswith("- positions: ") for line in markdown.splitlines()) == 1


def test_warnings_that_differ_in_figures_alone_are_counted_together() -> None:
    base = make_solution()
    texts = [f"position: {k} epochs in a row contradicted the filter" for k in range(40)] + ["a gap of 3.0 s"]
    events = tuple(Event(int(base.t_ns[k]), "warning", text) for k, text in enumerate(texts))
    grouped = group_warnings(replace(base, events=(Event(int(base.t_ns[0]), "info", "aligned"), *events)))
    assert [(group["text"], group["count"]) for group in grouped] == [(texts[0], 40), (texts[-1], 1)]


def test_json_agrees_with_the_evaluation(result: RunResult) -> None:
    assert result.evaluation is not None
    report = build_report(result)
    statistics = result.evaluation.statistics["all"]
    assert report["errors"]["all"]["position"]["north"]["rms"] == pytest.approx(statistics["position"]["north"].rms)
    heading = report["errors"]["all"]["attitude"]["heading"]["p95"]
    assert heading == pytest.approx(np.degrees(statistics["attitude"]["heading"].p95))


def test_unknown_figures_are_null(tmp_path: Path) -> None:
    result = without_recording(make_result(with_reference=False))
    write_outputs(result, tmp_path)
    text = (tmp_path / "report.json").read_text()
    report = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert report["errors"] is None
    assert report["nees"] is None
    assert report["outages"]["list"][0]["end_horizontal_m"] is None
    assert report["outages"]["list"][0]["distance_m"] > 10
    assert "Standard deviations" in (tmp_path / "report.html").read_text()


def test_report_is_the_same_for_the_same_run(result: RunResult) -> None:
    assert dump_json(build_report(result)) == dump_json(build_report(result))


def test_page_needs_no_network_and_fits_a_phone(folder: Path) -> None:
    page = Page((folder / "report.html").read_text())
    sources = [
        value for _, attributes in page.tags for key, value in attributes.items() if key in ("src", "href", "xlink:href")
    ]
    assert sources == []
    assert "url(" not in (folder / "report.html").read_text()
    viewport = next(attributes for tag, attributes in page.tags if attributes.get("name") == "viewport")
    assert "width=device-width" in str(viewport["content"])


def test_texts_from_logs_are_escaped(folder: Path) -> None:
    html = (folder / "report.html").read_text()
    page = Page(html)
    assert [tag for tag, _ in page.tags].count("script") == 4  # described, data, uPlot, ours
    assert NASTY in page.text
    markdown = (folder / "report.md").read_text()
    assert "<script" not in markdown.replace("\\<", "")
    rows = [line for line in markdown.splitlines() if "alert" in line]
    assert all(len(re.findall(r"(?<!\\)\|", row)) == 8 for row in rows)


def test_page_shows_all_plots_with_finite_coordinates(folder: Path) -> None:
    html = (folder / "report.html").read_text()
    page = Page(html)
    for title in (
        "Track",
        "Position error",
        "Velocity error",
        "Attitude error",
        "Innovations: position",
        "Noise: velocity",
        "Gyro bias",
        "Accelerometer bias",
    ):
        assert title in page.text
    paths = [str(attributes["d"]) for tag, attributes in page.tags if tag == "path"]
    assert len(paths) > 100
    assert not any("nan" in path or "inf" in path for path in paths)
    shades = [attributes for tag, attributes in page.tags if tag == "rect" and attributes.get("class") == "shade"]
    assert len(shades) % 3 == 0
    assert len(shades) > 30


def test_hour_of_drive_stays_small(tmp_path: Path) -> None:
    result = without_recording(make_result(make_solution(duration_s=3600, outage_every_s=300)))
    write_outputs(result, tmp_path)
    assert (tmp_path / "report.html").stat().st_size < 2_500_000
    assert len((tmp_path / "solution.csv").read_text().splitlines()) == 36002


def test_headline_and_tables_tell_the_same_as_json(result: RunResult) -> None:
    report = build_report(result)
    figures = {figure.name: figure for figure in headline_figures(report)}
    rms = report["errors"]["outside"]["position"]["horizontal"]["rms"]
    assert figures["Horizontal error RMS"].value == figure_text(rms, "m")
    outages = next(table for table in report_tables(report) if table.title.startswith("Outages"))
    assert len(outages.rows) == report["outages"]["count"] + 2
    assert all(len(row) == len(table.header) for table in report_tables(report) for row in table.rows)


@pytest.mark.parametrize(
    ("value", "text"), [(None, "– m"), (0.0, "0 m"), (0.04567, "0.0457 m"), (123.4, "123 m"), (4e-5, "4.0e-05 m"), (12, "12 m")]
)
def test_figures_have_three_digits(value: float | None, text: str) -> None:
    assert figure_text(value, "m") == (text if value is not None else "–")


@pytest.mark.parametrize(
    ("mean", "half_width", "text"),
    [
        (0.406, 0.00598, "0.4060 ± 0.0060"),
        (259.4, 46.38, "259 ± 46"),
        (1.0, None, "1"),
        (None, None, "–"),
        (2.0, 0.0, "2"),
        (0.3, 12.7, "0 ± 13"),
        (3.41e-5, 2.2e-6, "3.41e-05 ± 2.2e-06"),
        (1455.0, 3039.0, "1500 ± 3000"),
    ],
)
def test_means_are_told_as_far_as_their_interval_reaches(mean, half_width, text):
    assert interval_text(mean, half_width) == text
