"""What has been done: an entry per drive and method, by the hashes of its inputs, of its configuration and of the program.

The manifest is a file of lines of JSON in the destination. Lines are appended as jobs end, and the file is written anew,
sorted, when a batch ends; a line cut short by a crash is passed over.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from navreplay.timeline import LogError
from pipelines.archive.sources.rules import Assigned
from pipelines.config.spec import dump_toml
from pipelines.files.whole_file import write_whole

__all__ = [
    "Entry",
    "OpenManifest",
    "code_version",
    "config_hash",
    "input_hash",
    "read_manifest",
    "write_manifest",
]

NAME = "manifest.jsonl"
_SCHEMA = 1
_PACKAGES = ("navreplay", "importers", "pipelines")


@dataclass(frozen=True, slots=True)
class Entry:
    """One drive by one method. files: path, size, time of change [ns] and SHA-256 of each input. status: ``done`` or
    ``failed``, with the reason. row: what the catalogue shows of it."""

    drive: str
    method: str
    inputs: str
    config: str
    code: str
    files: tuple[tuple[str, int, int, str], ...]
    status: str
    reason: str = ""
    row: dict[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str]:
        """Drive and method."""
        return self.drive, self.method


@cache
def code_version() -> str:
    """The program's version and a hash over its own sources, so that a change of either is one."""
    digest = sha256()
    for package in _PACKAGES:
        root = Path(__file__).parents[2] / package
        for path in sorted(root.rglob("*.py")):
            digest.update(str(path.relative_to(root)).encode())
            digest.update(path.read_bytes())
    try:
        number = version("navreplay")
    except PackageNotFoundError:
        number = "unknown"
    return f"{number}+{digest.hexdigest()[:12]}"


def config_hash(assigned: Assigned, method: str) -> str:
    """Of the effective configuration, the vehicle and the method."""
    text = f"{dump_toml(assigned.config)}\n{assigned.vehicle}\n{method}"
    return sha256(text.encode()).hexdigest()[:16]


def input_hash(stamps: Iterable[tuple[str, int, int, str]]) -> str:
    """Of what files hold and what they are called, wherever they lie."""
    text = "\n".join(f"{Path(path).name} {digest}" for path, _, _, digest in stamps)
    return sha256(text.encode()).hexdigest()[:16]


def read_manifest(folder: Path) -> dict[tuple[str, str], Entry]:
    """The last entry of each drive and method; empty where there is no manifest. Raises LogError for one of another program or
    version."""
    path = folder / NAME
    if not path.exists():
        return {}
    entries: dict[tuple[str, str], Entry] = {}
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    for number, line in enumerate(lines):
        try:
            data = json.loads(line)
            if number == 0:
                _check_schema(path, data)
                continue
            data["files"] = tuple((str(p), int(s), int(t), str(d)) for p, s, t, d in data["files"])
            entry = Entry(**data)
        except (ValueError, TypeError, KeyError) as error:
            if number == len(lines) - 1:
                break  # the crash that cut the last line short is why somebody resumes
            raise LogError(
                f"{path}: line {number + 1} is damaged; delete the line, and its drive is processed again"
            ) from error
        entries[entry.key] = entry
    return entries


def _check_schema(path: Path, data: object) -> None:
    if not isinstance(data, dict) or data.get("navreplay_manifest") != _SCHEMA:
        raise LogError(f"{path}: is no manifest of this version of navreplay; choose another -o, or move it away")


class OpenManifest:
    """The manifest of a batch that runs: entries are added as jobs end. Raises OSError."""

    def __init__(self, folder: Path) -> None:
        path = folder / NAME
        if path.exists():
            write_manifest(folder, read_manifest(folder).values())  # whole lines, whatever a crash left of the last
        self._file = path.open("a", encoding="utf-8")
        if not path.stat().st_size:
            self._file.write(f"{json.dumps({'navreplay_manifest': _SCHEMA})}\n")
            self._file.flush()

    def add(self, entry: Entry) -> None:
        """Adds a line, which is there at once."""
        self._file.write(f"{_line(entry)}\n")
        self._file.flush()

    def close(self) -> None:
        """No entry follows."""
        self._file.close()


def write_manifest(folder: Path, entries: Iterable[Entry]) -> None:
    """The whole manifest anew, in the order of drives and methods."""
    lines = [json.dumps({"navreplay_manifest": _SCHEMA}), *(_line(entry) for entry in sorted(entries, key=lambda one: one.key))]
    write_whole(folder / NAME, lambda path: path.write_text("\n".join(lines) + "\n", encoding="utf-8"))


def _line(entry: Entry) -> str:
    return json.dumps({f.name: getattr(entry, f.name) for f in fields(entry)}, sort_keys=True, separators=(",", ":"))
