"""Nothing from logs, archives or configurations is run, leads out of the destination, or becomes part of a page."""

import ast
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from pipelines import cli
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.paths import ROOT

HOSTILE = "<script>alert(1)</script>"
FORBIDDEN = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}


@pytest.mark.parametrize("package", ["navreplay", "importers", "pipelines"])
def test_nothing_is_unpickled_or_evaluated(package: str) -> None:
    found = []
    for path in (ROOT / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            allowed = any(k.arg == "allow_pickle" and getattr(k.value, "value", True) for k in getattr(node, "keywords", []))
            if (
                FORBIDDEN & {name.split(".")[0] for name in names}
                or called in {"eval", "exec", "compile", "__import__"}
                or allowed
            ):
                found.append(f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}")
    assert found == []


def rename_topics(source: Path, target: Path) -> None:
    """The same messages on topics with a script in their names."""
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic + HOSTILE, channel.message_encoding, number)
            data = message.data.replace(b"gnss\0", b"<u>\0\0")  # a frame
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()


def test_hostile_topics_frames_and_file_names_stay_text(tmp_path: Path) -> None:
    plain = tmp_path / "plain.mcap"
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 1), plain)
    folder = tmp_path / "in" / "<img src=x onerror=alert(2)>"
    folder.mkdir(parents=True)
    rename_topics(plain, folder / "<u>&quot;'.mcap")
    (folder / "<script>alert(3).mcap").write_bytes(plain.read_bytes()[:3000])
    out = tmp_path / "out"
    assert cli.main(["batch", str(tmp_path / "in"), "-o", str(out), "--quiet", "--workers", "1"]) == 2
    pages = [*out.rglob("*.html")]
    assert len(pages) == 2
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for tag in ("<script>alert", "<img src=x", "<u>"):
            assert tag not in text, page
        assert "alert(1)" in text or page.name == "index.html", "the topic is shown, as text"
    assert {path.name for path in out.iterdir()} == {
        "catalog.parquet",
        "drives",
        "index.html",
        "log",
        "manifest.jsonl",
        "sources.jsonl",
    }
    assert {path.name for path in tmp_path.iterdir()} == {"plain.mcap", "plain.truth.csv", "in", "out"}


def test_a_list_and_rules_name_files_but_lead_no_result_out(tmp_path: Path) -> None:
    log = tmp_path / "logs" / "x.mcap"
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 1), log)
    place = tmp_path / "a" / "b"
    place.mkdir(parents=True)
    (place / "drives.lst").write_text("../../logs/x.mcap\n")
    arguments = ["--quiet", "--workers", "1", "--set", "output.recording=false"]
    assert cli.main(["batch", str(place / "drives.lst"), "-o", str(place / "out"), *arguments]) == 0
    written = {path.parent for path in tmp_path.rglob("report.json")}
    assert all(place / "out" / "drives" in folder.parents for folder in written)
    assert len(written) == 1
