"""What an archive, a destination or a log can have wrong: a line each, and nothing half."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from importers.settings import InputSettings
from navreplay.timeline import LogError
from pipelines import cli
from pipelines.archive.catalogue import read_catalogue
from pipelines.archive.job import Job, run_job
from pipelines.archive.manifest import read_manifest
from pipelines.archive.sources import seen as seen_files
from pipelines.archive.sources.seen import SeenFiles
from pipelines.config.spec import Config
from synthetic_logs import SCENARIOS, simulate, with_duration, write

QUIET = ["--quiet", "--workers", "1", "--set", "output.recording=false"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "drive.mcap"
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 1), path)
    return path


@pytest.fixture
def archive(log: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "drive.mcap").write_bytes(log.read_bytes())
    return folder


def batch(archive: Path, *options: str) -> int:
    return cli.main(["batch", str(archive), "-o", str(archive.parent / "out"), *QUIET, *options])


def reasons(archive: Path) -> dict[str, str]:
    table = read_catalogue(archive.parent / "out")
    return dict(zip(table["drive"], table["reason"], strict=True))


def test_two_drives_with_one_name_are_told_apart(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 2), archive / "Drive.bag")
    assert batch(archive, "--dry-run") == 0
    told = capsys.readouterr().out
    assert "is the name of another drive" in told
    assert "~2: " in told


@pytest.mark.parametrize("target", ["nowhere.mcap", "link.mcap"], ids=["dangling", "round"])
def test_a_link_that_leads_nowhere_is_a_failed_drive(archive: Path, target: str) -> None:
    (archive / "link.mcap").symlink_to(target)
    assert batch(archive) == 2
    assert set(reasons(archive)) == {"drive", "link"}
    assert "link.mcap: cannot be read: " in reasons(archive)["link"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_file_that_must_not_be_read(archive: Path) -> None:
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 2), archive / "secret.mcap")
    (archive / "secret.mcap").chmod(0)
    assert batch(archive) == 2
    assert "cannot be read: Permission denied" in reasons(archive)["secret"]


def test_a_file_that_grows_while_it_is_looked_at(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digest = seen_files._digest

    def grow(path: Path) -> str:
        with path.open("ab") as file:
            file.write(b"more")
        return digest(path)

    monkeypatch.setattr(seen_files, "_digest", grow)
    assert batch(archive) == 2
    assert "is being written while it is read; run the batch again with --resume" in reasons(archive)["drive"]
    monkeypatch.undo()
    assert batch(archive, "--resume") == 0, "its files are other ones now"


def test_a_file_that_changes_before_its_turn(archive: Path, tmp_path: Path) -> None:
    path = archive / "drive.mcap"
    stamps = SeenFiles(InputSettings(), "").stamps([path])
    os.utime(path, ns=(0, 1))
    job = Job("drive", (str(path),), (("fixed", Config()),), str(tmp_path / "out"), stamps=stamps)
    (outcome,) = run_job(job)
    assert "changed while the batch ran" in outcome.reason
    assert not (tmp_path / "out").exists()


def test_a_source_that_is_gone_is_a_failed_drive(archive: Path, tmp_path: Path) -> None:
    job = Job("drive", (str(archive / "gone.mcap"),), (("fixed", Config()),), str(tmp_path / "out"))
    (outcome,) = run_job(job)
    assert "gone.mcap: cannot be read" in outcome.reason


def test_a_full_disk_ends_the_batch_with_a_line_and_leaves_nothing_half(archive: Path) -> None:
    out = archive.parent / "out"
    program = (
        "import resource, sys\n"
        "from pipelines import cli\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))\n"
        f"sys.exit(cli.main(['batch', {str(archive)!r}, '-o', {str(out)!r}, *{QUIET!r}]))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert "cannot be written: File too large; make room, and go on with --resume" in done.stderr
    assert done.stderr.count("\n") == 1
    assert [path for path in (out / "drives").rglob("*") if path.is_file()] == []
    assert read_manifest(out) == {}
    assert batch(archive, "--resume") == 0


def test_a_manifest_that_cannot_grow_is_told(
    archive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipelines.archive.manifest.OpenManifest.add", fail)
    assert batch(archive) == 1
    line = capsys.readouterr().err
    assert "No space left on device; make room or mend it, and go on with --resume" in line
    assert line.count("\n") == 1


def test_a_file_system_that_renames_no_folders_is_told_before_the_work(
    archive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rename = Path.rename

    def refuse(self: Path, target: Path) -> Path:
        if self.is_dir():
            raise OSError(18, "Invalid cross-device link")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", refuse)
    assert batch(archive) == 1
    line = capsys.readouterr().err
    assert "its file system cannot rename folders (Invalid cross-device link)" in line
    assert line.count("\n") == 1
    assert list((archive.parent / "out" / "drives").iterdir()) == []


def test_a_destination_of_another_version_and_one_that_is_a_file(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = archive.parent / "out"
    out.mkdir()
    (out / "manifest.jsonl").write_text('{"navreplay_manifest": 99}\n')
    assert batch(archive, "--resume") == 1
    assert "is no manifest of this version of navreplay" in capsys.readouterr().err
    (out / "manifest.jsonl").unlink()
    out.rmdir()
    out.write_text("a file")
    assert batch(archive) == 1
    assert "is a file, but -o names a folder" in capsys.readouterr().err


def test_a_damaged_line_inside_a_manifest_is_named(archive: Path) -> None:
    assert batch(archive) == 0
    path = archive.parent / "out" / "manifest.jsonl"
    head, line = path.read_text().splitlines()
    path.write_text(f"{head}\n{line[:50]}\n{line}\n")
    with pytest.raises(LogError, match="line 2 is damaged; delete the line"):
        read_manifest(archive.parent / "out")


def test_a_damaged_book_of_sources_costs_only_time(archive: Path) -> None:
    assert batch(archive) == 0
    path = archive.parent / "out" / "sources.jsonl"
    whole = path.read_text()
    path.write_text(whole[:60])
    assert batch(archive, "--resume") == 0
    assert path.read_text() == whole


def test_a_list_that_is_no_text_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.lst").write_bytes(b"\xff\xfe\x00\xd8")
    assert cli.main(["batch", str(tmp_path / "a.lst"), "-o", str(tmp_path / "out")]) == 1
    assert "the list cannot be read" in capsys.readouterr().err


def test_a_fault_of_ours_costs_its_drive_and_is_kept_in_the_log(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("pipelines.archive.job.filter_drive", fail)
    assert batch(archive) == 2
    assert "the program is at fault (ZeroDivisionError)" in reasons(archive)["drive"]
    (log,) = (archive.parent / "out" / "log").iterdir()
    assert "a bug" in log.read_text()


def test_since_until_and_match_choose_files(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 2), archive / "old.bag")
    os.utime(archive / "old.bag", ns=(0, 10**18))  # 2001
    for options, names in (
        (["--until", "2010-01-01"], {"old"}),
        (["--since", "2010-01-01T00:00:00+00:00"], {"drive"}),
        (["--match", "*.mcap"], {"drive"}),
    ):
        assert batch(archive, "--dry-run", "--json", *options) == 0
        assert {one["drive"] for one in json.loads(capsys.readouterr().out)["drives"]} == names
    assert batch(archive, "--match", "*.mcap", "--until", "2010-01-01") == 1
    assert "holds no files that match --match, --since and --until" in capsys.readouterr().err
