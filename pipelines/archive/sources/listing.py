"""The files of an archive: below folders or addresses, found by patterns, named by lists."""

import os
from collections.abc import Iterable, Sequence
from fnmatch import fnmatch
from pathlib import Path

from importers.containers.file_bytes import storage_suffix
from navreplay.timeline import LogError
from pipelines.files.remote import below, is_address

__all__ = ["list_files"]

_LISTS = (".lst", ".list")
_BAG = "metadata.yaml"
"""What makes a folder a ROS 2 bag; a storage file without it is a log by itself."""


def list_files(sources: Sequence[str], match: str = "*") -> list[Path]:
    """The logs below folders and addresses, that patterns find, that list files name; bag folders as one. Raises LogError for a
    source that is not there. Links that lead round in a circle are followed once."""
    found: dict[Path, None] = {}
    for source in sources:
        for path in _expand(source):
            if path.match(match) and not path.name.startswith("."):
                found.setdefault(path)
    return sorted(found)


def _expand(source: str) -> Iterable[Path]:
    path = Path(source)
    if is_address(path):
        yield from _fetchable(path)
    elif path.suffix in _LISTS and path.is_file():
        yield from _listed(path)
    elif path.is_dir():
        yield from _walk(path)
    elif path.exists():
        yield path
    elif any(letter in source for letter in "*?["):
        base = Path(path.anchor) if path.is_absolute() else Path()
        yield from (one for one in base.glob(str(path.relative_to(path.anchor))) if one.is_file())
    else:
        raise LogError(f"{source}: there is no such file, folder or pattern; name the archive's folder, logs, or a list (.lst)")


def _listed(path: Path) -> Iterable[Path]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: the list cannot be read: {error}; it is a text with a source a line") from error
    for line in (line.strip() for line in lines):
        if line and not line.startswith("#"):
            yield from _expand(line if is_address(Path(line)) else str(path.parent / line))


def _fetchable(path: Path) -> Iterable[Path]:
    """Below an address, or of the pattern that it is."""
    text = str(path)
    at = min((text.find(letter) for letter in "*?[" if letter in text), default=-1)
    files = list(below(Path(text[:at].rpartition("/")[0]) if at >= 0 else path))
    if at >= 0:
        files = [one for one in files if fnmatch(str(one), text)]
    if not files:
        raise LogError(f"{source_text(path)}: nothing is there; name a folder, a log or a pattern")
    bags = {one.parent for one in files if one.name == _BAG}
    yield from sorted(bags)
    yield from (one for one in files if one.parent not in bags or not _of_bag(one))


def source_text(path: Path) -> str:
    """An address as it was given, whose second slash is lost in a path."""
    from importers.containers.remote import address_of

    return address_of(str(path)) or str(path)


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
        if _BAG in names:
            folders.clear()
            yield here
        yield from (here / name for name in sorted(names) if _BAG not in names or not _of_bag(Path(name)))


def _of_bag(path: Path) -> bool:
    """Whether a file beside a bag's metadata is a part of the bag."""
    return path.name == _BAG or bool(storage_suffix(path))
