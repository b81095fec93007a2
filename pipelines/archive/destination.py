"""Where a batch puts its results: a folder here, or an address, for which a scratch folder here stands in."""

import errno
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from importers.containers.file_bytes import scratch_file
from navreplay.timeline import LogError
from pipelines.archive.catalogue import NAME as CATALOGUE
from pipelines.archive.catalogue import write_catalogue
from pipelines.archive.index_page import NAME as INDEX
from pipelines.archive.index_page import write_index
from pipelines.archive.manifest import NAME as MANIFEST
from pipelines.archive.manifest import Entry, OpenManifest, read_manifest, write_manifest
from pipelines.archive.sources.seen import SOURCES, SeenFiles
from pipelines.files.remote import LAST, below, fetch_file, is_address, remove, store_file

__all__ = ["Destination"]

_PUSH_S = 10.0
"""How often the manifest of a batch that runs goes to an address; what ends in between is done again after a crash."""


class Destination:
    """out: as given, a folder or an address. here: the folder that holds the manifest and what is made of it. before: the
    entries of what was done there. Raises LogError where out is a batch of another version, or cannot be reached."""

    def __init__(self, out: Path) -> None:
        self.out, self.here = out, out
        self._whole: set[str] | None = None
        if is_address(out):
            self.here = scratch_file(self, "out")
            for name in (MANIFEST, SOURCES):
                fetch_file(out / name, self.here / name)
            self._whole = {str(path).partition("/drives/")[2] for path in below(out / "drives") if path.name == LAST}
        self.before = read_manifest(self.here)
        self._pushed = time.monotonic()

    def has(self, drive: str, method: str) -> bool:
        """Whether the outputs are there, and whole."""
        if self._whole is not None:
            return f"{drive}/{method}/{LAST}" in self._whole
        return (self.here / "drives" / drive / method / LAST).exists()

    @contextmanager
    def open(self) -> Iterator[OpenManifest]:
        """Clears what a batch that was killed left half done, and opens the manifest. An OSError inside, such as of a disk that
        is full, is a LogError."""
        try:
            (self.here / "drives").mkdir(parents=True, exist_ok=True)
            if self._whole is None:
                _check_renames(self.here)
                _clear_parts(self.here / "drives")
            else:
                self._clear_halves()
            manifest = OpenManifest(self.here)
            try:
                yield manifest
            finally:
                manifest.close()
        except OSError as error:
            raise LogError(
                f"{self.out}: cannot be written: {error.strerror or error}; make room or mend it, and go on with --resume"
            ) from error

    def push(self) -> None:
        """Brings the manifest to the address, now and then."""
        if self._whole is not None and time.monotonic() - self._pushed > _PUSH_S:
            store_file(self.here / MANIFEST, self.out / MANIFEST)
            self._pushed = time.monotonic()

    def finish(self, entries: Iterable[Entry], seen: SeenFiles) -> None:
        """Writes manifest, catalogue, index and the book of sources, each whole. Raises OSError or LogError."""
        entries = list(entries)
        write_manifest(self.here, entries)
        write_catalogue(self.here, entries)
        write_index(self.here, entries)
        seen.write(self.here / SOURCES)
        if self._whole is not None:
            for name in (MANIFEST, CATALOGUE, INDEX, SOURCES):
                store_file(self.here / name, self.out / name)
            for path in (self.here / "log").iterdir():
                store_file(path, self.out / "log" / path.name)

    def _clear_halves(self) -> None:
        folders = {path.parent for path in below(self.out / "drives")}
        for folder in folders:
            if f"{str(folder).partition('/drives/')[2]}/{LAST}" not in (self._whole or ()):
                remove(folder)


def _check_renames(folder: Path) -> None:
    """Raises LogError where folders cannot be renamed, since a result appears by that."""
    probe = Path(tempfile.mkdtemp(prefix=".probe-", suffix=".part", dir=folder))
    moved = probe.with_suffix(".old")
    try:
        (probe / "file").touch()
        probe.rename(moved)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise LogError(
            f"{folder}: its file system cannot rename folders ({error.strerror}), so results could not appear whole; choose "
            "another -o, or name the store's address instead of its mount"
        ) from error
    finally:
        shutil.rmtree(probe, ignore_errors=True)
        shutil.rmtree(moved, ignore_errors=True)


def _clear_parts(folder: Path) -> None:
    for name in ("*.part", "*.old"):
        for path in folder.rglob(f".{name}"):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
