"""Files at addresses (s3://, gs://, sftp:// and whatever else fsspec knows) beside files here: listed, fetched, stored whole.

A path may be an address; one of its slashes is lost where it went through `pathlib`, and is put back here.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from importers.containers.file_bytes import scratch_file
from importers.containers.remote import address_of
from navreplay.timeline import LogError

__all__ = ["below", "fetch_file", "is_address", "local", "remove", "status_of", "store_file", "store_folder"]

LAST = "report.json"
"""The file of a folder that is stored last: a folder without it is not whole."""
_TIMES = ("mtime", "LastModified", "last_modified", "updated", "modified", "created")


def is_address(path: Path) -> bool:
    """Whether it is an address rather than a file here."""
    return address_of(str(path)) is not None


def _open(path: Path) -> tuple[Any, str]:
    address = address_of(str(path)) or str(path)
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise LogError(f"{address}: for addresses fsspec is needed: pip install 'navreplay[remote]'") from error
    with _told(address, "cannot be reached"):
        system, inside = url_to_fs(address)
    return system, inside


@contextmanager
def _told(address: object, what: str) -> Iterator[None]:
    """Whatever the package of a scheme raises, as a LogError with the address."""
    try:
        yield
    except LogError:
        raise
    except FileNotFoundError as error:
        raise LogError(f"{address}: nothing is there") from error
    except Exception as error:  # each scheme's package has errors of its own, and most of them no common base
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = " (with pip, beside fsspec)" if isinstance(error, ImportError) else ""
        raise LogError(f"{address}: {what}: {reason}{hint}") from error


def below(path: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of change [ns, 0 where unknown] of each file at or below an address. Raises LogError."""
    system, inside = _open(path)
    with _told(path, "cannot be listed"):
        system.invalidate_cache()
        found = system.find(inside, detail=True)
    return {Path(system.unstrip_protocol(name)): _status(entry) for name, entry in found.items()}


def _status(entry: dict[str, Any]) -> tuple[int, int]:
    told = next((entry[key] for key in _TIMES if entry.get(key) is not None), 0)
    if isinstance(told, str):
        told = datetime.fromisoformat(told)
    if isinstance(told, datetime):
        told = (told if told.tzinfo else told.replace(tzinfo=UTC)).timestamp()
    return int(entry.get("size") or 0), int(round(float(told), 6) * 1e9)


def status_of(path: Path) -> tuple[int, int]:
    """Size and time of change [ns] of a file, or of all files of a folder together. Raises OSError or LogError."""
    if is_address(path):
        parts = list(below(path).values())
        if not parts:
            raise LogError(f"{path}: nothing is there")
    else:
        files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
        parts = [(status.st_size, status.st_mtime_ns) for status in (one.stat() for one in files)]
    return sum(size for size, _ in parts), max((time for _, time in parts), default=0)


def fetch_file(path: Path, target: Path) -> bool:
    """Copies the file at an address, whole or not at all; False where there is none. Raises LogError."""
    system, inside = _open(path)
    with _told(path, "cannot be fetched"):
        system.invalidate_cache()
        if not system.exists(inside):
            return False
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f".{target.name}.part")
        system.get_file(inside, str(part))
        part.replace(target)
    return True


@cache
def _scratch(folder: Path) -> Path:
    """One of each folder, for the life of this process."""
    return scratch_file(_open, folder.name)


def local(folder: Path, name: str) -> Path:
    """Where a file of a folder can be read here; of an address it is fetched first, each time anew. Raises LogError."""
    if not is_address(folder):
        return folder / name
    target = _scratch(folder) / name
    target.unlink(missing_ok=True)
    fetch_file(folder / name, target)
    return target


def store_file(source: Path, path: Path) -> None:
    """Puts a file at an address; it appears there whole. Raises LogError."""
    system, inside = _open(path)
    parent, _, name = inside.rpartition("/")
    with _told(path, "cannot be written"):
        system.makedirs(parent, exist_ok=True)
        system.put_file(str(source), f"{parent}/.{name}.part")
        system.mv(f"{parent}/.{name}.part", inside)


def store_folder(source: Path, path: Path) -> None:
    """Puts the files of a folder at an address in place of what is there. No store renames folders, so its `LAST` file goes
    first and comes last: without it a folder is not whole. Raises LogError, and takes back what was put."""
    system, inside = _open(path)
    remove(path)
    files = sorted((one for one in source.rglob("*") if one.is_file()), key=lambda one: (one.name == LAST, one))
    try:
        with _told(path, "cannot be written"):
            for one in files[:-1]:
                target = f"{inside}/{one.relative_to(source).as_posix()}"
                system.makedirs(target.rpartition("/")[0], exist_ok=True)
                system.put_file(str(one), target)
        store_file(files[-1], path / files[-1].relative_to(source))
    except BaseException:
        remove(path)
        raise


def remove(path: Path) -> None:
    """Removes what is at an address, a folder's `LAST` file first. Raises LogError where that fails."""
    system, inside = _open(path)
    with _told(path, "cannot be removed"):
        system.invalidate_cache()
        if system.exists(f"{inside}/{LAST}"):
            system.rm_file(f"{inside}/{LAST}")
        if system.exists(inside):
            system.rm(inside, recursive=True)
