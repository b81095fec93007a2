"""Several methods on one drive: which runs are made, what their common report shows, and the command line of it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from navreplay.filters.presets import PRESETS
from navreplay.timeline import LogError
from pipelines import cli
from pipelines.config.sections import OutputSection
from pipelines.config.spec import Config, load_config
from pipelines.drive.compare import Outcome, Setting, name_methods, number_equal, plan_variants
from pipelines.drive.result import RunResult
from pipelines.outputs import write_comparison, write_each
from pipelines.report.comparison import MOST_DRAWN, build_comparison, comparison_tables
from pipelines.report.content import dump_json
from tests.helpers.sample_drive import make_result, make_solution


@pytest.fixture(scope="module")
def results() -> tuple[RunResult, RunResult]:
    """Two runs of a hand-made drive, the second with twice the errors."""
    config = Config(output=OutputSection(recording=False))
    first, second = (make_result(make_solution(duration_s=90, seed=scale, scale=scale)) for scale in (1, 2))
    return replace(first, config=config), replace(second, config=config)


def outcomes_of(names: Sequence[str], results: Sequence[RunResult | LogError]) -> list[Outcome]:
    variants = plan_variants(names, [Setting(Config())])
    return [Outcome(variant, result) for variant, result in zip(variants, results, strict=True)]


def test_all_stands_for_every_method_but_the_slow_ones(capsys: pytest.CaptureFixture[str]) -> None:
    left_out = set(PRESETS) - set(name_methods("all"))
    assert left_out == {"ml-ga", "mlckf-ga"}
    assert name_methods("all, ml-ga")[-1] == "ml-ga"
    assert name_methods("huber,,iae") == ("huber", "iae")
    with pytest.raises(SystemExit):
        cli.main(["compare", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in left_out)


def test_equal_texts_are_numbered() -> None:
    assert number_equal(["fixed", "iae", "fixed"]) == ("fixed-1", "iae", "fixed-2")
    assert number_equal(["a", "a", "a-1"]) == ("a-2", "a-3", "a-1")


def test_every_method_runs_in_every_setting() -> None:
    settings = [
        Setting(load_config(None, [f"gnss.noise_scale={value}", "imu.grade=tactical"]), "gnss.noise_scale", value)
        for value in (0.25, 4)
    ]
    variants = plan_variants(["huber", "iae"], settings)
    assert [variant.label for variant in variants] == [
        "huber, noise_scale 0.25",
        "huber, noise_scale 4",
        "iae, noise_scale 0.25",
        "iae, noise_scale 4",
    ]
    assert [variant.folder for variant in variants][:2] == ["huber-noise_scale-0.25", "huber-noise_scale-4"]
    assert [variant.config.gnss.noise_scale for variant in variants] == [0.25, 4, 0.25, 4]
    assert [variant.config.filter.name for variant in variants] == ["huber", "huber", "iae", "iae"]
    assert {variant.config.imu.grade for variant in variants} == {"tactical"}


def test_folders_differ_where_values_hold_odd_characters() -> None:
    settings = [Setting(Config(), "outages.file", value) for value in ("../a b.json", "../a/b.json")]
    folders = [variant.folder for variant in plan_variants(["fixed"], settings)]
    assert folders == ["fixed-file-..-a-b.json-1", "fixed-file-..-a-b.json-2"]


def test_parameters_go_to_their_method_and_a_varied_one_to_all() -> None:
    config = load_config(None, ["filter.name=iae", "filter.parameters.window=20"])
    told = {variant.label: variant.config.filter.parameters for variant in plan_variants(["iae", "ml"], [Setting(config)])}
    assert told == {"iae": {"window": 20}, "ml": {}}
    varied = plan_variants(["iae", "ml"], [Setting(config, "filter.parameters.window", 20)])
    assert [variant.config.filter.parameters for variant in varied] == [{"window": 20}] * 2
    with pytest.raises(LogError, match="there is no parameter 'window'"):
        plan_variants(["iae", "huber"], [Setting(config, "filter.parameters.window", 20)])


def test_the_report_has_a_row_per_method_in_every_table(results: tuple[RunResult, RunResult], tmp_path: Path) -> None:
    comparison = write_each(outcomes_of(["fixed", "iae"], results), tmp_path)
    outputs = write_comparison(comparison, tmp_path)
    assert list(outputs) == ["report.json", "report.md", "report.html"]
    report = json.loads(outputs["report.json"].read_text())
    assert list(report["methods"]) == ["fixed", "iae"]
    assert (report["varied"], report["failures"]) == (None, {})
    assert report == json.loads(dump_json(build_comparison(comparison)))
    markdown = outputs["report.md"].read_text()
    for title in ("Overview", "Position error outside outages", "Outages", "Consistency", "Time spent"):
        section = markdown.split(f"## {title}")[1].split("##")[0]
        assert "fixed" in section
        assert "iae" in section
    assert (tmp_path / "iae" / "solution.csv").exists()
    assert outputs["report.html"].read_text().count('data-name="iae"') == 9


def test_the_overview_takes_its_figures_from_the_report(results: tuple[RunResult, RunResult], tmp_path: Path) -> None:
    report = build_comparison(write_each(outcomes_of(["fixed", "iae"], results), tmp_path))
    overview = comparison_tables(report)[0]
    figures = dict(zip(overview.header, overview.rows[1], strict=True))
    method = report["methods"]["iae"]
    assert float(figures["position 3-D [m]"]) == pytest.approx(method["errors"]["outside"]["position"]["3d"]["rms"], rel=0.01)
    assert float(figures["position NEES"]) == pytest.approx(method["nees"]["position"]["mean"] / 3, rel=0.01)
    ends = method["outages"]["summary"]["end_horizontal"]
    assert float(figures["outage end, horizontal median [m]"]) == pytest.approx(ends["p50"], rel=0.01)


def test_of_many_runs_the_first_are_drawn_and_all_are_tabulated(results: tuple[RunResult, RunResult], tmp_path: Path) -> None:
    names = list(PRESETS)[: MOST_DRAWN + 2]
    comparison = write_each(outcomes_of(names, [results[0]] * len(names)), tmp_path)
    page = write_comparison(comparison, tmp_path)["report.html"].read_text()
    assert f"The first {MOST_DRAWN} of {len(names)} runs are drawn" in page
    assert page.count(f'data-name="{names[MOST_DRAWN - 1]}"') == 9
    assert f'data-name="{names[MOST_DRAWN]}"' not in page
    tables = comparison_tables(build_comparison(comparison))
    assert all(len(table.rows) % len(names) == 0 for table in tables)


def test_what_cannot_run_is_named_beside_the_others(results: tuple[RunResult, RunResult], tmp_path: Path) -> None:
    refused = LogError("filter: no | ranges <here>")
    outputs = write_comparison(write_each(outcomes_of(["srmakf", "fixed"], [refused, results[0]]), tmp_path), tmp_path)
    report = json.loads(outputs["report.json"].read_text())
    assert report["failures"] == {"srmakf": str(refused)}
    assert list(report["methods"]) == ["fixed"]
    assert "| srmakf | filter: no \\| ranges" in outputs["report.md"].read_text()
    assert "no | ranges &lt;here&gt;" in outputs["report.html"].read_text()


def test_where_all_fail_the_first_reason_is_the_error(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="one"):
        write_each(outcomes_of(["srmakf", "fixed"], [LogError("one"), LogError("two")]), tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A synthetic log of two minutes; its truth lies beside it."""
    path = tmp_path_factory.mktemp("compare") / "car.mcap"
    assert cli.main(["synth", "car-short", "--seed", "1", "-o", str(path)]) == 0
    return path


def arguments_of(log: Path, out: Path, *more: str) -> list[str]:
    sets = ["--set", "output.recording=false"]
    return ["compare", str(log), "--reference", str(log.with_suffix(".truth.csv")), "-o", str(out), *sets, *more]


def test_a_key_is_varied_from_the_command_line(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    launch = ["--set", "filter.frame=launch-inertial", "--set", "launch.point_deg_m=[47.4, 8.5, 460]"]
    more = ["--filters", "fixed,ckf", "--vary", "gnss.noise_scale=0.25,1", "--smooth", *launch]
    assert cli.main(arguments_of(log, tmp_path / "told", *more)) == 0
    printed = capsys.readouterr().out
    assert "fixed-smoothed, noise_scale 0.25" in printed
    assert "could not run: ckf-smoothed, noise_scale 1: filter: cubature points move in NED" in printed
    assert (tmp_path / "told" / "fixed-smoothed-noise_scale-0.25" / "solution.csv").exists()
    assert cli.main(arguments_of(log, tmp_path / "json", *more, "--json")) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["varied"] == "gnss.noise_scale"
    assert [(row["method"], row["value"]) for row in figures["methods"]] == [("fixed-smoothed", 0.25), ("fixed-smoothed", 1)]
    assert list(figures["failures"]) == ["ckf-smoothed, noise_scale 0.25", "ckf-smoothed, noise_scale 1"]
    first, second = [row["errors_m"]["all"]["3d_rms"] for row in figures["methods"]]
    assert first != pytest.approx(second, rel=0.01)


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ("gnss.noise_scale", "expected KEY=A,B,..."),
        ("gnss.noise_scale=", "expected KEY=A,B,..."),
        ("gnss.noise_scal=1,2", "the nearest valid key is 'gnss.noise_scale'"),
        ("gnss.noise_scale=1,x", "gnss.noise_scale: expected a valid number"),
        ("imu.grade=consumer,best", "expected 'consumer', 'industrial', 'tactical' or 'navigation', got 'best'"),
        ("input.imu.time_offset_s=0,1", "read once for all runs"),
        ("filter.name=fixed,iae", "named with --filters"),
    ],
)
def test_what_cannot_be_varied_is_one_line(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], vary: str, message: str
) -> None:
    assert cli.main(arguments_of(log, tmp_path / "never", "--filters", "fixed", "--vary", vary)) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert not (tmp_path / "never").exists()


def test_values_may_be_words_or_lists(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    more = ["--filters", "fixed", "--json", "--vary"]
    assert cli.main(arguments_of(log, tmp_path / "words", *more, "imu.grade=consumer,tactical")) == 0
    assert [row["value"] for row in json.loads(capsys.readouterr().out)["methods"]] == ["consumer", "tactical"]
    assert cli.main(arguments_of(log, tmp_path / "endless", *more, "imu.gyro_bias_tau_s=100,inf")) == 0
    assert [row["label"] for row in json.loads(capsys.readouterr().out)["methods"]][1] == "fixed, gyro_bias_tau_s inf"
    assert cli.main(arguments_of(log, tmp_path / "lists", *more, "gnss.default_velocity_std_mps=[0.1, 0.2],[1, 2]")) == 0
    labels = [row["label"] for row in json.loads(capsys.readouterr().out)["methods"]]
    assert labels == ["fixed, default_velocity_std_mps [0.1, 0.2]", "fixed, default_velocity_std_mps [1, 2]"]
