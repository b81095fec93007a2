"""The catalogue: conditions, hostile names, many rows, differences, and the archive in Rerun."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from navreplay.timeline import LogError
from pipelines import cli
from pipelines.archive.catalogue import read_catalogue, select_rows, write_catalogue
from pipelines.archive.difference import compare_archives, separate
from pipelines.archive.index_page import write_index
from pipelines.archive.manifest import Entry, read_manifest, write_manifest
from pipelines.archive.sources.drives import ArchiveDrive, find_drives
from pipelines.archive.sources.seen import SeenFiles
from pipelines.config.spec import Config
from synthetic_logs import SCENARIOS, simulate, with_duration, write

TABLE = pd.DataFrame(
    {
        "drive": ["a/one", "b/two", "c/three"],
        "status": ["done", "failed", "done"],
        "horizontal_rms_m": [0.5, None, 2.0],
        "distance_m": [100.0, None, 900.0],
    }
)


@pytest.mark.parametrize(
    ("where", "drives"),
    [
        ("horizontal_rms_m > 1", ["c/three"]),
        ("horizontal_rms_m >= 0.5 and distance_m < 500", ["a/one"]),
        ("status = 'failed' or distance_m == 900", ["b/two", "c/three"]),
        ("not status = done", ["b/two"]),
        ("(status != done or drive ~ THREE) and not drive ~ two", ["c/three"]),
        ("horizontal_rms_m < -1e3", []),
    ],
)
def test_conditions_choose_rows(where: str, drives: list[str]) -> None:
    assert select_rows(TABLE, where, None, None)["drive"].tolist() == drives


@pytest.mark.parametrize(
    ("where", "told"),
    [
        ("horizontal_rm > 1", "did you mean horizontal_rms_m"),
        ("horizontal_rms_m >", "a comparison is a column, a sign and a value"),
        ("horizontal_rms_m > 'x'", "is a number, and 'x' is none"),
        ("(status = done", "a parenthesis is not closed"),
        ("status = done distance_m", "is left over"),
        ("__import__('os').system('true')", "is no part of a condition"),
        ("status = done; drop", "is no part of a condition"),
    ],
)
def test_what_is_no_condition_is_told_and_never_run(where: str, told: str) -> None:
    with pytest.raises(LogError, match=told):
        select_rows(TABLE, where, None, None)


def entry(name: str, row: dict | None = None, status: str = "done", reason: str = "") -> Entry:
    return Entry(name, "checked", "i", "c", "v", ((f"/logs/{name}.mcap", 1, 1, "d"),), status, reason, row or {})


def test_hostile_names_stay_text(tmp_path: Path) -> None:
    name = '<script>alert(1)</script>&"</title>'
    row = {"first_finding": "</script><img src=x onerror=alert(2)>", "track": "48.0,11.0 48.1,11.1"}
    write_index(tmp_path, [entry(name, row)])
    page = (tmp_path / "index.html").read_text()
    assert "<script>alert" not in page
    assert "<img" not in page
    assert page.count("</script>") == 2
    assert "\\u003cscript\\u003ealert(1)" in page


@pytest.mark.parametrize("folder", ["../../etc", "..", "a/../../b", "/abs", ".hidden", "x" * 20 + "\n<b>"])
def test_no_name_leads_out_of_the_destination(tmp_path: Path, folder: str) -> None:
    path = tmp_path / "in" / "log.mcap"
    path.parent.mkdir()
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 1), path)
    odd = tmp_path / "in" / folder.replace("/", "_").replace("..", "up") / ".." / "log.mcap"
    odd.parent.parent.mkdir(exist_ok=True, parents=True)
    (drive,) = find_drives([path], Path("/"), SeenFiles(Config().input, ""))[0]
    destination = (tmp_path / "out" / drive.name).resolve()
    assert tmp_path / "out" in destination.parents
    assert ".." not in drive.name.split("/")
    assert isinstance(drive, ArchiveDrive)


def test_many_rows_go_through(tmp_path: Path) -> None:
    """benchmarks/archive.py does this with 100 000 and tells the seconds."""
    row = {"horizontal_rms_m": 0.1, "distance_m": 1e3, "track": "48.0,11.0 48.1,11.1"}
    entries = [entry(f"d{number // 100:04d}/n{number:06d}", row) for number in range(3000)]
    write_manifest(tmp_path, entries)
    assert list(read_manifest(tmp_path).values()) == entries
    write_catalogue(tmp_path, entries)
    write_index(tmp_path, entries)
    assert len(select_rows(read_catalogue(tmp_path), "horizontal_rms_m > 0.05 and drive ~ d0001", "drive", None)) == 100


@pytest.fixture(scope="module")
def two_batches(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same two drives twice, the second time with a lever arm that is wrong by half a metre."""
    folder = tmp_path_factory.mktemp("batches")
    for seed in (1, 2):
        write(simulate(with_duration(SCENARIOS["car-short"], 40.0), seed), folder / "in" / f"drive{seed}.bag")
    for name, sets in (("a", []), ("b", ["--set", "input.fix.lever_arm_m=[3.0, 0.0, 0.0]"])):
        assert cli.main(["batch", str(folder / "in"), "-o", str(folder / name), "--quiet", "--workers", "1", *sets]) == 0
    return folder / "a", folder / "b"


def test_a_difference_names_what_moved_and_is_an_exit_code(
    two_batches: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = map(str, two_batches)
    assert cli.main(["diff", before, before]) == 0
    assert "0 of 2 changed" in capsys.readouterr().out
    assert cli.main(["diff", before, after]) == 1
    told = capsys.readouterr().out
    assert "[config]" in told
    assert "2 of 2 changed, 2 beyond 0.01 m" in told
    assert cli.main(["diff", before, after, "--tolerance", "100"]) == 0
    change = compare_archives(*two_batches).changes[0]
    assert 0.1 < change.rms_m < change.largest_m < 20


def test_a_difference_is_a_page_with_the_separations_drawn(two_batches: tuple[Path, Path], tmp_path: Path) -> None:
    before, after = two_batches
    page = tmp_path / "diff.html"
    assert cli.main(["diff", str(before), str(after), "--html", str(page)]) == 1
    text = page.read_text(encoding="utf-8")
    for drive in ("drive1", "drive2"):
        assert f"Separation: {drive} (checked)" in text
    assert text.count('<svg class="plot time"') == 2
    assert "2 of 2 runs beyond 0.01 m" in text
    change = compare_archives(before, after).changes[0]
    assert f"{change.lat_deg:.6f}, {change.lon_deg:.6f}" in text
    assert change.settings == ("input.fix.lever_arm_m: [0.0, 0.0, 0.0] -> [3.0, 0.0, 0.0]",)
    assert "input.fix.lever_arm_m: [0.0, 0.0, 0.0] -&gt; [3.0, 0.0, 0.0]" in text
    apart = separate(before, after, change.drive, change.method)
    assert np.linalg.norm(apart.ned_m, axis=1).max() == change.largest_m
    assert cli.main(["diff", str(before), str(before), "--html", str(page)]) == 0
    assert "Separation:" not in page.read_text(encoding="utf-8")
    assert cli.main(["diff", str(before), str(after), "--html", str(tmp_path)]) == 1


def test_a_lost_drive_comes_first(two_batches: tuple[Path, Path], tmp_path: Path) -> None:
    lost = tmp_path / "lost"
    shutil.copytree(two_batches[0], lost)
    entries = list(read_manifest(lost).values())
    write_catalogue(lost, [entries[0], replace(entries[1], status="failed", reason="no")])
    first = compare_archives(two_batches[0], lost).changes[0]
    assert (first.drive, first.what) == (entries[1].drive, "fails now")


def test_a_survey_tells_of_all_drives(two_batches: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["summary", str(two_batches[0])]) == 0
    told = capsys.readouterr().out
    assert told.startswith("2 drives over ")
    assert "checked: 2 runs, 2 with a reference" in told
    assert cli.main(["summary", str(two_batches[0]), "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    (group,) = values["groups"]
    assert 0 < group["horizontal_rms_m"]["p50"] <= group["horizontal_rms_m"]["p95"] < 5
    assert {one["drive"] for one in values["look_at"]} == {"drive1", "drive2"}
    assert cli.main(["summary", str(two_batches[0].parent)]) == 1
