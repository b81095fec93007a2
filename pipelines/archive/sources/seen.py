"""What the files of an archive hold, looked at once: a file that has not changed is not opened again.

The book of it is a file of lines of JSON in the destination, so that a resumed batch of many thousand files decides in
seconds.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path

from importers.containers.remote import address_of, fetch
from importers.containers.stand_in import Scratch
from importers.formats import known_formats, open_log
from importers.settings import InputSettings
from navreplay.timeline import LogError
from pipelines.archive.sources.spans import Span, roles_of, time_span
from pipelines.files.remote import status_of
from pipelines.files.whole_file import write_whole

__all__ = ["SOURCES", "Seen", "SeenFiles"]

SOURCES = "sources.jsonl"
_BLOCK = 1 << 20
_PACKED = frozenset({".gz", ".zst", ".bz2", ".xz", ".zip"})
_TABLES = frozenset({".csv", ".txt", ".mat"})
_WRITTEN = "is being written while it is read; run the batch again with --resume when it is complete"


@dataclass(frozen=True, slots=True)
class Seen:
    """A file, or a folder that is one log. mtime_ns: time of change. digest: SHA-256 of what it holds, empty where it cannot be
    read. roles: what its channels can serve as; ``broken`` where it is a log that does not open. other: why it is no log,
    empty where it is one. problem: why it cannot be processed, empty where it can. span: see `time_span`, asked for where
    asked is set."""

    path: str
    size: int
    mtime_ns: int
    digest: str = ""
    roles: tuple[str, ...] = ()
    other: str = ""
    problem: str = ""
    span: Span | None = None
    asked: bool = False


class SeenFiles:
    """Files as they were seen, by path. key: of settings and program; what was seen under another counts for nothing but its
    digest."""

    def __init__(self, settings: InputSettings, code: str) -> None:
        self._settings = settings
        self._key = sha256(f"{code}\n{settings.model_dump_json()}".encode()).hexdigest()[:16]
        self._before: dict[str, Seen] = {}
        self._same_key = False
        self._now: dict[str, Seen] = {}
        self._suffixes = {suffix for known in known_formats() for suffix in known.extensions} | _PACKED

    def read(self, path: Path) -> None:
        """What an earlier batch wrote; a book that is missing or damaged is an empty one."""
        try:
            head, *lines = path.read_text(encoding="utf-8").splitlines()
            self._same_key = json.loads(head) == {"navreplay_sources": self._key}
            entries = [json.loads(line) for line in lines]
            seen = [Seen(**{**entry, "roles": tuple(entry["roles"]), "span": _pair(entry["span"])}) for entry in entries]
        except (OSError, ValueError, TypeError, KeyError):
            return  # it only spares time; all files are looked at again
        self._before = {one.path: one for one in seen}

    def write(self, path: Path) -> None:
        """All files that were looked at, in the order of their paths."""
        lines = [json.dumps({"navreplay_sources": self._key})]
        lines += [json.dumps(asdict(self._now[name]), sort_keys=True) for name in sorted(self._now)]
        write_whole(path, lambda part: part.write_text("\n".join(lines) + "\n", encoding="utf-8"))

    def look(self, path: Path) -> Seen:
        """What a file holds."""
        seen = self._now.get(str(path))
        if seen is None:
            seen = self._now[str(path)] = self._look(path)
        return seen

    def span(self, path: Path) -> Span | None:
        """When a log was made, None where it does not tell."""
        seen = self.look(path)
        if not seen.asked:
            span = None
            if "broken" not in seen.roles and not seen.other:
                span = time_span(open_log(path, self._settings))
            seen = self._now[str(path)] = replace(seen, span=span, asked=True)
        return seen.span

    def stamps(self, paths: Iterable[Path]) -> tuple[tuple[str, int, int, str], ...]:
        """Path, size, time of change and digest of each."""
        return tuple((one.path, one.size, one.mtime_ns, one.digest) for one in map(self.look, paths))

    def problem(self, paths: Iterable[Path]) -> str:
        """The first reason why one of them cannot be processed, or empty."""
        return next((one.problem for one in map(self.look, paths) if one.problem), "")

    def _look(self, path: Path) -> Seen:
        name = str(path)
        try:
            status = status_of(path)
            before = self._before.get(name)
            known = before is not None and (before.size, before.mtime_ns) == status and before.digest
            if before is not None and known and self._same_key:
                return before
            if path.suffix.lower() not in self._suffixes and not path.is_dir():
                return Seen(name, *status, other="no extension of a log")
            owner, place = Scratch(), path
            if address_of(name) is not None:
                place = fetch(str(address_of(name)), owner)
            digest = before.digest if before is not None and known else _digest(place)
            if status_of(path) != status:
                return Seen(name, *status, roles=("broken",), problem=f"{path}: {_WRITTEN}")
        except OSError as error:
            return Seen(name, 0, 0, roles=("broken",), problem=f"{path}: cannot be read: {error.strerror or error}")
        except LogError as error:
            return Seen(name, 0, 0, roles=("broken",), problem=str(error))
        return Seen(name, *status, digest, *self._roles(path, place))

    def _roles(self, path: Path, place: Path) -> tuple[tuple[str, ...], str]:
        try:
            return tuple(sorted(roles_of(open_log(place, self._settings)))), ""
        except LogError as error:
            table = path.suffix.lower() in _TABLES and "unknown format" in str(error)
            return ((), "a table without a mapping") if table else (("broken",), "")


def _pair(values: list[int] | None) -> Span | None:
    return None if values is None else (values[0], values[1])


def _digest(path: Path) -> str:
    """Of a file, or of a folder's files with their names."""
    digest = sha256()
    for part in sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]:
        if path.is_dir():
            digest.update(part.relative_to(path).as_posix().encode() + b"\0")
        with part.open("rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
    return digest.hexdigest()
