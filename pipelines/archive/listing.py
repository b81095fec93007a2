"""The files of an archive: below folders, found by patterns, named by lists."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from navreplay.timeline import LogError

__all__ = ["list_files"]

_LISTS = (".lst", ".list")


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
