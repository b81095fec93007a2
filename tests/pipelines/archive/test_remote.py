"""Archives at addresses, as source and as destination."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pipelines import cli
from pipelines.files import remote
from synthetic_logs import SCENARIOS, simulate, with_duration, write

fsspec = pytest.importorskip("fsspec")
QUIET = ["--quiet", "--workers", "1", "--set", "output.recording=false"]


@pytest.fixture
def memory() -> Iterator[Any]:
    """The store of memory://, empty before and after."""
    store = fsspec.filesystem("memory")
    _empty(store)
    yield store
    _empty(store)


def _empty(store: Any) -> None:
    for name in store.ls("/", detail=False):
        store.rm(name, recursive=True)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("remote") / "in"
    for seed, name in ((1, "monday/one.mcap"), (2, "tuesday/two.csv")):
        (folder / name).parent.mkdir(parents=True)
        write(simulate(with_duration(SCENARIOS["car-short"], 30.0), seed), folder / name)
    (folder / "tuesday/cut.mcap").write_bytes((folder / "monday/one.mcap").read_bytes()[:3000])
    return folder


def put(store: Any, folder: Path) -> None:
    for path in sorted(one for one in folder.rglob("*") if one.is_file()):
        store.pipe(f"/logs/{path.relative_to(folder)}", path.read_bytes())


def hashes(store: Any, place: str) -> dict[str, str]:
    """Of what the program says of drives; the catalogue and the manifest hold the paths of the logs as well."""
    found = store.find(f"{place}/drives")
    return {name.partition("/drives/")[2]: hashlib.sha256(store.cat(name)).hexdigest() for name in found}


def test_from_an_address_to_an_address_and_back(memory: Any, archive: Path, tmp_path: Path, capsys: Any) -> None:
    put(memory, archive)
    assert cli.main(["batch", "memory://logs", "-o", "memory://out", *QUIET]) == 2
    names = {name.removeprefix("/out/") for name in memory.find("/out")}
    assert {"manifest.jsonl", "catalog.parquet", "index.html", "sources.jsonl"} <= names
    assert {name.rpartition("/")[0] for name in names if name.endswith("report.json")} == {
        "drives/monday/one/checked",
        "drives/tuesday/two/checked",
    }
    assert not [name for name in names if ".part" in name]
    capsys.readouterr()
    assert cli.main(["catalog", "memory://out", "--columns", "drive,status", "--format", "csv", "--sort", "drive"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == ["monday/one,done", "tuesday/cut,failed", "tuesday/two,done"]
    assert cli.main(["summary", "memory://out"]) == 0
    assert cli.main(["diff", "memory://out", "memory://out"]) == 0
    assert cli.main(["batch", "memory://logs", "-o", str(tmp_path / "out"), *QUIET]) == 2
    solution = memory.cat("/out/drives/monday/one/checked/solution.csv")
    assert solution == (tmp_path / "out/drives/monday/one/checked/solution.csv").read_bytes()
    assert "memory://logs/monday/one.mcap" in (tmp_path / "out/drives/monday/one/checked/report.json").read_text()


def test_resumed_it_does_what_is_missing_and_clears_what_is_half(memory: Any, archive: Path, capsys: Any) -> None:
    put(memory, archive)
    assert cli.main(["batch", "memory://logs", "-o", "memory://out", *QUIET, "--match", "*one*"]) == 0
    assert cli.main(["batch", "memory://logs", "-o", "memory://out", *QUIET, "--match", "*one*"]) == 1
    whole = hashes(memory, "/out")
    memory.rm("/out/drives/monday/one/checked/report.json")
    memory.pipe("/out/drives/tuesday/two/checked/solution.csv", b"half")
    capsys.readouterr()
    assert (
        cli.main(["batch", "memory://logs", "-o", "memory://out", *QUIET[1:], "--match", "*one*", "--resume", "--dry-run"]) == 0
    )
    assert "its output is gone" in capsys.readouterr().out
    assert cli.main(["batch", "memory://logs", "-o", "memory://out", *QUIET, "--match", "*one*", "--resume"]) == 0
    assert hashes(memory, "/out") == whole


def test_a_store_that_fails_half_way_leaves_nothing_half(memory: Any, archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put_file = type(memory).put_file

    def fail(self: Any, source: str, target: str, *args: Any, **options: Any) -> None:
        if "report.md" in target:
            raise OSError(5, "the line is cut")
        put_file(self, source, target, *args, **options)

    monkeypatch.setattr(type(memory), "put_file", fail)
    assert cli.main(["batch", str(archive), "-o", "memory://out", *QUIET, "--match", "*one*"]) == 2
    assert memory.find("/out/drives") == []
    assert b"the line is cut" in memory.cat("/out/manifest.jsonl")
    monkeypatch.undo()
    assert cli.main(["batch", str(archive), "-o", "memory://out", *QUIET, "--match", "*one*", "--retry-failed"]) == 0
    assert [name for name in memory.find("/out/drives") if name.endswith(remote.LAST)]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["memory://nothing", "-o", "out"], "memory://nothing: nothing is there"),
        (["nosuch://logs", "-o", "out"], "nosuch://logs: cannot be reached"),
        (["memory://logs", "-o", "memory://logs/out"], "lies inside"),
        (["memory://logs", "-o", "out", "--workers", "2"], "use --workers 1"),
    ],
)
def test_what_cannot_be_is_one_line(
    memory: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, arguments: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    memory.pipe("/logs/a.csv", b"t,x\n")
    workers = [] if "--workers" in arguments else ["--workers", "1"]
    assert cli.main(["batch", *arguments, *workers]) == 1
    line = capsys.readouterr().err
    assert told in line
    assert line.count("\n") == 1


def test_a_file_appears_at_an_address_whole(memory: Any, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"content")
    remote.store_file(tmp_path / "a", Path("memory://bucket/deep/a"))
    assert remote.fetch_file(Path("memory://bucket/deep/a"), tmp_path / "back")
    assert (tmp_path / "back").read_bytes() == b"content"
    assert not remote.fetch_file(Path("memory://bucket/other"), tmp_path / "no")
    assert list(remote.below(Path("memory://bucket"))) == [Path("memory://bucket/deep/a")]
    remote.remove(Path("memory://bucket/deep"))
    assert remote.below(Path("memory://bucket")) == {}
