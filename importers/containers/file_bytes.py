"""The bytes of a log file, mapped rather than read; scratch files beside it where that does not do."""

import mmap
import shutil
import tempfile
import weakref
from pathlib import Path

import numpy as np

from importers.decoding.blocks import Buffer
from navreplay.timeline import LogError

__all__ = ["map_file", "scratch_file"]


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
