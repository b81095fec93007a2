"""Where results go: told to be unusable before the work, not after it."""

import tempfile
from pathlib import Path

from navreplay.timeline import LogError

__all__ = ["check_file", "check_folder"]


def check_folder(folder: Path, force: bool) -> None:
    """Raises LogError unless results can be written to folder: it is new, empty or to be overwritten, and writable."""
    if folder.exists() and not folder.is_dir():
        raise LogError(f"{folder}: is a file, but -o names a folder for the results")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise LogError(f"{folder}: exists already and is not empty; choose another -o, or overwrite it with --force")
    _check_writable(_existing(folder))


def check_file(path: Path, force: bool) -> None:
    """Raises LogError unless path can be written: it is new or to be overwritten, and its folder is writable."""
    if path.is_dir():
        raise LogError(f"{path}: is a folder, but -o names a file to write")
    if path.exists() and not force:
        raise LogError(f"{path}: exists already; choose another name, or overwrite it with --force")
    _check_writable(_existing(path.parent))


def _existing(folder: Path) -> Path:
    """The nearest folder at or above the given one that is there; what is missing will be made in it."""
    while not folder.exists():
        folder = folder.parent
    return folder


def _check_writable(folder: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise LogError(f"{folder}: cannot write there: {error.strerror}; choose another -o") from error
