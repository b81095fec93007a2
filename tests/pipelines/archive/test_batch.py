"""Archives: what is a drive, what is done again and why, and that the tree is the same whoever did it and whatever was
killed."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines import cli
from pipelines.archive.manifest import code_version, read_manifest
from synthetic_logs import SCENARIOS, simulate, with_duration, write

QUIET = ["--quiet", "--set", "output.recording=false"]


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three drives of three formats, one broken, one twice, and what is no log."""
    folder = tmp_path_factory.mktemp("archive")
    for seed, name in ((1, "monday/one.mcap"), (2, "monday/two.bag"), (3, "tuesday/three.csv")):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        write(simulate(with_duration(SCENARIOS["car-short"], 40.0), seed), path)
    (folder / "tuesday/cut.mcap").write_bytes((folder / "monday/one.mcap").read_bytes()[:3000])
    shutil.copy(folder / "monday/one.mcap", folder / "tuesday/again.mcap")
    (folder / "tuesday/notes.md").write_text("no log")
    (folder / "round").symlink_to(folder)
    return folder


def tree(folder: Path) -> dict[str, str]:
    """Hashes of all files but the logs of the batch itself."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
        if path.relative_to(folder).parts[0] != "log"
    }


def batch(archive: Path, out: Path, *options: str) -> int:
    return cli.main(["batch", str(archive), "-o", str(out), *QUIET, *options])


def test_the_tree_is_the_same_whatever_the_workers_and_a_second_run_does_nothing(archive: Path, tmp_path: Path) -> None:
    assert batch(archive, tmp_path / "one", "--workers", "1") == 2
    assert batch(archive, tmp_path / "two", "--workers", "2") == 2
    assert tree(tmp_path / "one") == tree(tmp_path / "two")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "one" / "drives").rglob("solution.csv")}
    assert batch(archive, tmp_path / "one", "--resume") == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert batch(archive, tmp_path / "one") == 1


def test_what_changed_is_done_again_and_said_why(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "in"
    shutil.copytree(archive, own, symlinks=True, ignore=shutil.ignore_patterns("round", "cut*", "again*"))
    out = tmp_path / "out"
    assert batch(own, out, "--workers", "1") == 0
    (own / "monday/one.truth.csv").write_text((own / "monday/one.truth.csv").read_text().rsplit("\n", 3)[0] + "\n")
    shutil.rmtree(out / "drives/monday/two/checked")
    assert cli.main(["batch", str(own), "-o", str(out), *QUIET[1:], "--resume", "--dry-run"]) == 0
    told = capsys.readouterr().out
    assert "monday/one" in told
    assert "its files changed" in told
    assert "its output is gone" in told
    assert told.count("checked: ") == 2
    for place in ("archive.batch", "commands.batch"):
        monkeypatch.setattr(f"pipelines.{place}.code_version", lambda: "another")
    assert cli.main(["batch", str(own), "-o", str(out), *QUIET[1:], "--resume", "--dry-run"]) == 0
    assert capsys.readouterr().out.count("the program changed") == 3
    assert code_version().startswith("0.")


def test_killed_at_any_moment_and_resumed_it_is_the_same_tree(archive: Path, tmp_path: Path) -> None:
    assert batch(archive, tmp_path / "whole", "--workers", "1") == 2
    command = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "batch",
        str(archive),
        "-o",
        str(tmp_path / "killed"),
        *QUIET,
        "--workers",
        "2",
    ]
    for _ in range(3):
        process = subprocess.Popen([*command, "--resume"], start_new_session=True, stderr=subprocess.DEVNULL)
        ends = time.monotonic() + 60
        lines = _lines(tmp_path / "killed")
        while process.poll() is None and _lines(tmp_path / "killed") == lines and time.monotonic() < ends:
            time.sleep(0.05)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert batch(archive, tmp_path / "killed", "--resume", "--retry-failed") == 2
    assert tree(tmp_path / "killed") == tree(tmp_path / "whole")


def _lines(folder: Path) -> int:
    path = folder / "manifest.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def test_a_manifest_cut_short_is_read_and_a_damaged_one_told(archive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert batch(archive, out, "--workers", "1", "--match", "*one*") == 0
    path = out / "manifest.jsonl"
    path.write_text(path.read_text()[:-40])
    assert read_manifest(out) == {}
    assert batch(archive, out, "--workers", "1", "--match", "*one*", "--resume") == 0
    assert set(read_manifest(out)) == {("monday/one", "checked")}
    path.write_text('{"something": "else"}\n')
    assert batch(archive, out, "--resume") == 1


def test_a_cluster_of_its_own_does_the_same(archive: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    assert batch(archive, tmp_path / "here", "--workers", "1", "--match", "*one*") == 0
    assert batch(archive, tmp_path / "there", "--scheduler", "local", "--workers", "1", "--match", "*one*") == 0
    assert tree(tmp_path / "here") == tree(tmp_path / "there")


def test_rules_settle_what_an_archive_cannot_know(archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "fast.toml").write_text("[imu]\ngrade = 'industrial'\n")
    rules = tmp_path / "rules.toml"
    rules.write_text(
        "[[rule]]\nmatch = 'tuesday/*'\nskip = true\n[[rule]]\nmatch = 'monday/*'\nconfig = 'fast.toml'\nvehicle = 'bus 7'\n"
    )
    assert batch(archive, tmp_path / "out", "--rules", str(rules), "--workers", "1") == 0
    assert cli.main(["catalog", str(tmp_path / "out"), "--columns", "drive,vehicle", "--format", "csv"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == ["monday/one,bus 7", "monday/two,bus 7"]
    rules.write_text("[[rule]]\nmatch = 'x'\nconfg = 'y'\n")
    assert batch(archive, tmp_path / "other", "--rules", str(rules)) == 1
    assert "confg" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("sources", "out", "told"),
    [
        (["missing"], "out", "there is no such file, folder or pattern"),
        (["empty"], "out", "holds no files"),
        (["texts"], "out", "no drive was recognised"),
        (["."], "out", "lies inside"),
    ],
)
def test_what_cannot_be_a_batch_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], sources: list[str], out: str, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "a.md").write_text("no log")
    assert cli.main(["batch", *sources, "-o", out]) == 1
    line = capsys.readouterr().err
    assert told in line
    assert line.count("\n") == 1


def test_json_is_for_programs(archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--json", "--workers", "1", "--set", "output.recording=false"]
    assert cli.main(["batch", str(archive), "-o", str(tmp_path / "out"), *options]) == 2
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert events[-1] == {"event": "end", "done": 3, "failed": 1, "skipped": 0, "left_out": 1, "reasons": events[-1]["reasons"]}
    assert {event["event"] for event in events} == {"started", "done", "failed", "left out", "end"}
