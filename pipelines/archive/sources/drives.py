"""Which files of an archive are one drive, and why."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipelines.archive.sources.seen import SeenFiles
from pipelines.archive.sources.spans import AIDS, Span, shared_time

__all__ = ["ArchiveDrive", "find_drives"]

_REFERENCE = re.compile(r"(^|[._-])(truth|reference|ref|groundtruth|ground_truth)($|[._-])", re.IGNORECASE)
_SPLIT = re.compile(r"[._-]?(\d+)$")
_SPLIT_GAP_NS, _SPLIT_OVERLAP_NS = 60 * 10**9, 5 * 10**9
"""Recorders begin the next file at once; buffers may overlap a little."""


@dataclass(frozen=True, slots=True)
class ArchiveDrive:
    """name: of its folder in the destination, unique. logs: its files, in order. reference: beside them, or None. why: the
    files belong together, in words."""

    name: str
    logs: tuple[Path, ...]
    reference: Path | None = None
    why: str = ""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files it is made of."""
        return self.logs if self.reference is None else (*self.logs, self.reference)


@dataclass(frozen=True, slots=True)
class _Part:
    """A log of an archive. roles: what its channels can serve as. book: that knows it."""

    path: Path
    roles: frozenset[str]
    book: SeenFiles

    @property
    def complete(self) -> bool:
        """Whether it is a drive by itself."""
        return "broken" in self.roles or ("imu" in self.roles and bool(self.roles & AIDS))

    @property
    def span(self) -> Span | None:
        """When it was made, None where unknown; asked for only where it matters, since it is read for it."""
        return self.book.span(self.path)

    @property
    def stem(self) -> str:
        """The name's first part."""
        return self.path.name.split(".")[0]


@dataclass(slots=True)
class _Group:
    """Files that become one drive."""

    name: str
    parts: list[_Part]
    why: str

    @property
    def span(self) -> Span | None:
        """From the first to the last of its times, None where none is known."""
        known = [part.span for part in self.parts if part.span is not None]
        return (min(first for first, _ in known), max(last for _, last in known)) if known else None


def find_drives(files: Sequence[Path], root: Path, book: SeenFiles) -> tuple[list[ArchiveDrive], dict[Path, str]]:
    """The drives that files make, their names relative to root, and what is no log with the reason.

    A file that holds an IMU and something that aids it is a drive by itself; files of one name that count on and follow each
    other in time are splits of one; what else lies in a folder is joined by the first part of its name, else by the time it
    shares with one drive alone.
    """
    parts, references, others = _sort(files, book)
    by_folder: dict[Path, list[_Part]] = {}
    for part in parts:
        by_folder.setdefault(part.path.parent, []).append(part)
    drives: list[ArchiveDrive] = []
    beside: dict[Path, list[Path]] = {}
    for one in references:
        beside.setdefault(one.parent, []).append(one)
    for folder, inside in sorted(by_folder.items()):
        drives += _join(folder, inside, beside.get(folder, []), root)
    used = {drive.reference for drive in drives}
    others |= {one: "a reference that belongs to no drive here" for one in references if one not in used}
    return _unique(drives), others


def _sort(files: Sequence[Path], book: SeenFiles) -> tuple[list[_Part], list[Path], dict[Path, str]]:
    parts, references, others = [], [], {}
    for path in files:
        seen = book.look(path)
        if seen.other:
            others[path] = seen.other
        elif "broken" not in seen.roles and (_REFERENCE.search(path.stem) or seen.roles == ("reference",)):
            references.append(path)
        elif seen.roles:
            parts.append(_Part(path, frozenset(seen.roles), book))
        else:
            others[path] = "nothing in it serves navigation"
    return parts, references, others


def _join(folder: Path, parts: Sequence[_Part], references: Sequence[Path], root: Path) -> list[ArchiveDrive]:
    """The drives of one folder."""
    groups = _splits([part for part in parts if part.complete])
    rest = _join_names(groups, [part for part in parts if not part.complete])
    if not groups and len(rest) > 1 and len({part.stem for part in rest}) == len(rest):
        groups, rest = [_Group(folder.name or "drive", rest[:1], "the files of its folder")], rest[1:]
    _join_rest(groups, rest)
    named: dict[str, list[Path]] = {}
    for path in references:
        named.setdefault(_REFERENCE.sub("", path.name.split(".")[0]).rstrip("._-"), []).append(path)
    place = "" if folder == root or root not in folder.parents else f"{folder.relative_to(root)}/"
    return [
        ArchiveDrive(
            *(_safe(place + group.name), tuple(part.path for part in group.parts)),
            *(_reference_of(group, named, references if len(groups) == 1 else ()), group.why),
        )
        for group in sorted(groups, key=lambda one: one.name)
    ]


def _splits(parts: Sequence[_Part]) -> list[_Group]:
    """Complete logs, those that count on under one name and follow each other in time as one."""
    by_name: dict[str, list[_Part]] = {}
    for part in parts:
        by_name.setdefault(_SPLIT.sub("", part.stem) or part.stem, []).append(part)
    groups: list[_Group] = []
    for name, same in sorted(by_name.items()):
        chains: list[list[_Part]] = []
        for part in sorted(same, key=_split_number):
            if chains and _follows(chains[-1][-1], part):
                chains[-1].append(part)
            else:
                chains.append([part])
        for chain in chains:
            if len(chain) == 1:
                why = "a log that does not open" if "broken" in chain[0].roles else "holds IMU and GNSS"
                groups.append(_Group(chain[0].stem, chain, why))
            else:
                groups.append(_Group(name if len(chains) == 1 else chain[0].stem, chain, "splits of one recording"))
    return groups


def _follows(earlier: _Part, later: _Part) -> bool:
    if earlier.span is None or later.span is None or earlier.path.suffix != later.path.suffix:
        return False
    return -_SPLIT_OVERLAP_NS <= later.span[0] - earlier.span[1] <= _SPLIT_GAP_NS


def _join_names(groups: list[_Group], rest: Sequence[_Part]) -> list[_Part]:
    """Adds files to the group of their name, makes groups of those that share a name, and returns the others."""
    by_stem: dict[str, list[_Part]] = {}
    for part in rest:
        by_stem.setdefault(part.stem, []).append(part)
    named = {name: group for group in groups for name in (group.name, *(part.stem for part in group.parts))}
    alone = []
    for stem, same in sorted(by_stem.items()):
        group = named.get(stem)
        if group is not None:
            group.parts += same
            group.why += "; files of its name go with it"
        elif len(same) > 1:
            groups.append(_Group(stem, same, "files of one name"))
        else:
            alone += same
    return alone


def _join_rest(groups: list[_Group], rest: Sequence[_Part]) -> None:
    """Adds each file to the group whose time it shares, to the folder's only group where times are unknown, or alone."""
    only = groups[0] if len(groups) == 1 else None
    made: list[_Group] = []
    for part in rest:
        group = _of_its_time(groups, part)
        if group is not None:
            words = "files of its time go with it"
        elif only is not None and (part.span is None or only.span is None):
            group, words = only, "the other files of its folder go with it"
        if group is None:
            made.append(_Group(part.stem, [part], "alone"))
        else:
            group.parts.append(part)
            group.why += "" if words in group.why else f"; {words}"
    groups += made


def _of_its_time(groups: Sequence[_Group], part: _Part) -> _Group | None:
    """The group that shares the part's time; None where none does, or another does nearly as long."""
    shared = [(0 if part.span is None or one.span is None else shared_time(part.span, one.span), one) for one in groups]
    ordered = sorted(shared, key=lambda pair: -pair[0])
    if not ordered or not ordered[0][0] or (len(ordered) > 1 and ordered[1][0] > 0.5 * ordered[0][0]):
        return None
    return ordered[0][1]


def _reference_of(group: _Group, named: Mapping[str, list[Path]], only: Sequence[Path]) -> Path | None:
    """The one reference of its name, or that of its folder. named: references by name. only: of a folder with one drive."""
    own = {path for name in {group.name, *(part.stem for part in group.parts)} for path in named.get(name, ())} or set(only)
    return own.pop() if len(own) == 1 else None


def _split_number(part: _Part) -> tuple[int, str]:
    number = _SPLIT.search(part.stem)
    return (int(number.group(1)) if number else -1, part.path.name)


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
            if number == 0:
                unique.append(drive)
            else:
                why = f"{drive.why}; {same[0].name} is the name of another drive"
                unique.append(replace(drive, name=f"{drive.name}~{number + 1}", why=why))
    return sorted(unique, key=lambda drive: drive.name)
