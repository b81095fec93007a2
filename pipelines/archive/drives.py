"""Which files of an archive are one drive, and why."""

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from importers.formats import known_formats, open_log
from importers.roles.messages import kind_of
from importers.rows.log import Log
from importers.settings import InputSettings
from navreplay.timeline import LogError

__all__ = ["ArchiveDrive", "find_drives", "list_files"]

_REFERENCE = re.compile(r"(^|[._-])(truth|reference|ref|groundtruth|ground_truth)($|[._-])", re.IGNORECASE)
_SPLIT = re.compile(r"[._-]?(\d+)$")
_LISTS = (".lst", ".list")
_AIDS = frozenset({"fix", "range", "attitude"})


@dataclass(frozen=True, slots=True)
class ArchiveDrive:
    """name: of its folder in the destination, unique. logs: its files, in order. reference: beside them, or None. why: the
    files belong together, in words. problem: why it cannot be processed, empty where it can."""

    name: str
    logs: tuple[Path, ...]
    reference: Path | None = None
    why: str = ""
    problem: str = ""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files it is made of."""
        return self.logs if self.reference is None else (*self.logs, self.reference)


@dataclass(frozen=True, slots=True)
class _Part:
    """A log of an archive. roles: what its channels can serve as."""

    path: Path
    roles: frozenset[str]

    @property
    def complete(self) -> bool:
        """Whether it is a drive by itself."""
        return "imu" in self.roles and bool(self.roles & _AIDS)


def list_files(sources: Sequence[str], match: str = "*") -> list[Path]:
    """The logs below folders, that patterns find, that list files name; bag folders as one. Raises LogError for a source that
    is not there. Links that lead round in a circle are followed once."""
    found: dict[Path, None] = {}
    for source in sources:
        for path in _expand(source):
            if path.match(match) and not path.name.startswith("."):
                found.setdefault(path)
    return sorted(found)


def _expand(source: str) -> Iterable[Path]:
    path = Path(source)
    if path.suffix in _LISTS and path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.strip() and not line.startswith("#"):
                yield from _expand(str(path.parent / line.strip()))
    elif path.is_dir():
        yield from _walk(path)
    elif path.exists():
        yield path
    elif any(letter in source for letter in "*?["):
        base = Path(path.anchor) if path.is_absolute() else Path()
        yield from (one for one in base.glob(str(path.relative_to(path.anchor))) if one.is_file())
    else:
        raise LogError(f"{source}: there is no such file, folder or pattern; name the archive's folder, logs, or a list (.lst)")


def _walk(folder: Path) -> Iterable[Path]:
    seen: set[str] = set()
    for root, folders, names in os.walk(folder, followlinks=True):
        real = os.path.realpath(root)
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders.sort()
        here = Path(root)
        if (here / "metadata.yaml").exists() or any(name.endswith(".db3") for name in names):
            folders.clear()
            yield here
            continue
        yield from (here / name for name in sorted(names))


def find_drives(files: Sequence[Path], root: Path, settings: InputSettings) -> tuple[list[ArchiveDrive], dict[Path, str]]:
    """The drives that files make, their names relative to root, and what is no log with the reason.

    A file that holds an IMU and something that aids it is a drive by itself; splits of one recording (a number at the end of
    the same name) are one; what else lies in a folder is joined by the first part of its name, or goes with the folder's only
    drive.
    """
    parts, references, others = _sort(files, settings)
    by_folder: dict[Path, list[_Part]] = {}
    for part in parts:
        by_folder.setdefault(part.path.parent, []).append(part)
    drives: list[ArchiveDrive] = []
    for folder, inside in sorted(by_folder.items()):
        drives += _join(folder, inside, [one for one in references if one.parent == folder], root)
    for one in references:
        if not any(one == drive.reference for drive in drives):
            others[one] = "a reference that belongs to no drive here"
    return _unique(drives), others


def _sort(files: Sequence[Path], settings: InputSettings) -> tuple[list[_Part], list[Path], dict[Path, str]]:
    parts, references, others = [], [], {}
    suffixes = {suffix for known in known_formats() for suffix in known.extensions}
    for path in files:
        if path.is_file() and path.suffix.lower() not in suffixes | {".gz", ".zst", ".bz2", ".zip"}:
            others[path] = "no extension of a log"
            continue
        try:
            roles = _roles(open_log(path, settings))
        except LogError as error:
            if path.suffix.lower() in (".csv", ".txt", ".mat") and "unknown format" in str(error):
                others[path] = "a table without a mapping"
            else:
                parts.append(_Part(path, frozenset({"broken"})))
            continue
        if _REFERENCE.search(path.stem) or roles == {"reference"}:
            references.append(path)
        elif roles:
            parts.append(_Part(path, roles))
        else:
            others[path] = "nothing in it serves navigation"
    return parts, references, others


def _roles(log: Log) -> frozenset[str]:
    roles: set[str] = set()
    for channel in log.channels():
        kind = kind_of(channel)
        if kind is not None and kind.automatic:
            roles.add(kind.roles[0])
    return frozenset(roles)


def _join(folder: Path, parts: Sequence[_Part], references: Sequence[Path], root: Path) -> list[ArchiveDrive]:
    """The drives of one folder."""
    whole: dict[str, list[Path]] = {}
    for part in parts:
        if part.complete or "broken" in part.roles:
            whole.setdefault(_split_name(part.path), []).append(part.path)
    rest = [part.path for part in parts if not part.complete and "broken" not in part.roles]
    groups: list[tuple[str, list[Path], str]] = [
        (name, sorted(paths, key=_split_number), "holds IMU and GNSS" if len(paths) == 1 else "splits of one recording")
        for name, paths in sorted(whole.items())
    ]
    if len(groups) == 1:
        name, paths, why = groups[0]
        groups = [(name, paths + rest, f"{why}; the other files of its folder go with it" if rest else why)]
    else:
        by_stem: dict[str, list[Path]] = {}
        for path in rest:
            by_stem.setdefault(path.name.split(".")[0], []).append(path)
        if not groups and len(by_stem) > 1 and all(len(paths) == 1 for paths in by_stem.values()):
            by_stem = {folder.name or "drive": rest}
        groups += [(stem, paths, "files of one name" if len(paths) > 1 else "alone") for stem, paths in sorted(by_stem.items())]
    named = [(name, paths, why, _reference_of(name, references, len(groups) == 1)) for name, paths, why in groups]
    place = "" if folder == root or root not in folder.parents else f"{folder.relative_to(root)}/"
    return [ArchiveDrive(_safe(place + name), tuple(paths), reference, why) for name, paths, why, reference in named]


def _reference_of(name: str, references: Sequence[Path], only: bool) -> Path | None:
    own = [path for path in references if path.name.split(".")[0].startswith(name)]
    if not own and only and len(references) == 1:
        own = list(references)
    return own[0] if len(own) == 1 else None


def _split_name(path: Path) -> str:
    stem = path.name.split(".")[0]
    return _SPLIT.sub("", stem) or stem if path.suffix in (".mcap", ".db3") else stem


def _split_number(path: Path) -> tuple[int, str]:
    number = _SPLIT.search(path.name.split(".")[0])
    return (int(number.group(1)) if number else -1, path.name)


def _safe(name: str) -> str:
    """A name that is a folder below any other: no way up, nothing hidden, nothing a shell or page minds."""
    parts = [re.sub(r"[^\w.+-]+", "_", part).lstrip(".") for part in name.split("/")]
    return "/".join(part for part in parts if part) or "drive"


def _unique(drives: Sequence[ArchiveDrive]) -> list[ArchiveDrive]:
    counts: dict[str, list[ArchiveDrive]] = {}
    for drive in drives:
        counts.setdefault(drive.name.lower(), []).append(drive)
    unique = []
    for same in counts.values():
        for number, drive in enumerate(same):
            name = drive.name if number == 0 else f"{drive.name}~{number + 1}"
            unique.append(ArchiveDrive(name, drive.logs, drive.reference, drive.why, drive.problem))
    return sorted(unique, key=lambda drive: drive.name)
