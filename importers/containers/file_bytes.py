"""The bytes of a log file, mapped rather than read; scratch files beside it where that does not do."""

import mmap
import shutil
import tempfile
import weakref
from pathlib import Path

import numpy as np

from importers.decoding.blocks import Buffer
from navreplay.timeline import LogError

__all__ = ["is_bag_folder", "map_file", "scratch_file", "storage_suffix"]

_STORAGES = (".db3", ".mcap")
_PACKED = (".zstd", ".zst", ".gz", ".bz2")


def storage_suffix(path: Path) -> str:
    """``.db3`` or ``.mcap`` where a file is a storage of a ROS 2 bag by its name, packed or not; else empty."""
    plain = Path(path.stem if path.suffix in _PACKED else path.name)
    return plain.suffix if plain.suffix in _STORAGES else ""


def is_bag_folder(folder: Path) -> bool:
    """Whether a folder is that of a ROS 2 bag, closed or not."""
    return (folder / "metadata.yaml").exists() or any(storage_suffix(path) for path in folder.iterdir())


def map_file(path: str, magic: bytes, format_name: str) -> Buffer:
    """All bytes of a file, read-only, paged in as they are touched.

    Raises LogError for a missing or unreadable file, an empty one, and one that does not begin with the format's magic.
    """
    try:
        with Path(path).open("rb") as file:
            size = file.seek(0, 2)
            if size == 0:
                raise LogError(f"{path}: the file is empty; was the recording stopped before anything was written?")
            file.seek(0)
            if file.read(len(magic)) != magic:
                raise LogError(
                    f"{path}: not {format_name}: the file does not begin as one; wrong file, or damaged in its first bytes"
                )
            return np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), dtype=np.uint8)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def scratch_file(owner: object, name: str) -> Path:
    """A path for a temporary file of this name, removed when the owner goes away."""
    directory = tempfile.mkdtemp(prefix="navreplay-")
    weakref.finalize(owner, shutil.rmtree, directory, ignore_errors=True)
    return Path(directory) / name
