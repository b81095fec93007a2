"""Files packed by gzip, bzip2, xz, zstd or zip, unpacked into a scratch file, bounded against what is no log."""

import bz2
import gzip
import lzma
import shutil
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import zstandard

from importers.containers.file_bytes import scratch_file
from navreplay.timeline import LogError

__all__ = ["packing_of", "plain_name", "unpack_file"]

_MAGICS = {"gzip": b"\x1f\x8b", "bzip2": b"BZh", "xz": b"\xfd7zXZ\0", "zstd": b"\x28\xb5\x2f\xfd", "zip": b"PK\x03\x04"}
_SUFFIXES = (".gz", ".bz2", ".xz", ".zst", ".zstd", ".zip")
_OPENERS: dict[str, Callable[..., Any]] = {
    "gzip": gzip.open,
    "bzip2": bz2.open,
    "xz": lzma.open,
    "zstd": zstandard.open,
}
_DAMAGE = (EOFError, zlib.error, lzma.LZMAError, zstandard.ZstdError, zipfile.BadZipFile, gzip.BadGzipFile)
_BLOCK = 1 << 20
_NEVER_ABSURD = 1 << 30
_LARGEST_RATIO = 200
_STORAGES = (".db3", ".mcap", ".zstd")
_TAR_AT, _TAR = 257, b"ustar"


def packing_of(head: bytes) -> str:
    """How a file that begins so is packed: a name, empty where it is not."""
    return next((name for name, magic in _MAGICS.items() if head.startswith(magic)), "")


def plain_name(name: str) -> str:
    """The name of a file without the ending of its packing."""
    return name.removesuffix(next((suffix for suffix in _SUFFIXES if name.endswith(suffix)), ""))


def unpack_file(path: str, packing: str, owner: object) -> tuple[Path, str]:
    """The unpacked file (of a zip that holds a ROS 2 bag: its folder), and a sentence on damage, empty where there is none.

    It goes away with the owner. Raises LogError where nothing comes out, where it is no log (a tar archive, a workbook, several
    files), and where it grows beyond a gibibyte and 200 times its packed size.
    """
    try:
        if packing == "zip":
            return _unpack_zip(path, owner)
        plain = scratch_file(owner, plain_name(Path(path).name))
        with _OPENERS[packing](path, "rb") as source:
            note = _copy(path, source, plain, Path(path).stat().st_size)
        if packing == "zstd" and not note:
            note = _short_of_declared(Path(path), plain.stat().st_size)
    except _DAMAGE as error:
        raise LogError(f"{path}: is packed by {packing}, but does not unpack ({error}); copy the file again") from error
    except OSError as error:
        raise LogError(f"{path}: cannot be unpacked: {error.strerror or error}") from error
    _refuse_tar(path, plain)
    return plain, note


def _copy(path: str, source: IO[bytes], plain: Path, packed_size: int, before: int = 0) -> str:
    """Copies what comes out, up to damage or to an absurd size; a sentence on damage. before: bytes that came out already."""
    limit = max(_NEVER_ABSURD, _LARGEST_RATIO * packed_size)
    written = 0
    with plain.open("wb") as target:
        while True:
            try:
                block = source.read(_BLOCK)
            except _DAMAGE:
                if not written:
                    raise
                return f"it is cut off or damaged: {written} bytes could be unpacked and were read"
            if not block:
                return ""
            written += target.write(block)
            if before + written > limit:
                raise LogError(
                    f"{path}: unpacks to more than {limit >> 20} MiB from {packed_size} bytes, which no log does; if it is "
                    "one, unpack it and name what comes out"
                )


def _short_of_declared(path: Path, size: int) -> str:
    """A sentence where a frame of zstd, whose reader ends silently where the file is cut off, declares more than came out."""
    with path.open("rb") as file:
        declared = zstandard.frame_content_size(file.read(18))
    return f"it is cut off: {size} of {declared} bytes could be unpacked and were read" if declared > size else ""


def _refuse_tar(path: str, plain: Path) -> None:
    with plain.open("rb") as file:
        file.seek(_TAR_AT)
        if file.read(len(_TAR)) == _TAR:
            raise LogError(f"{path}: holds a tar archive; unpack it (tar xf) and name the logs in it")


def _unpack_zip(path: str, owner: object) -> tuple[Path, str]:
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir() and not _is_hidden(member.filename)]
        names = [Path(member.filename).name for member in members]
        if any(member.filename == "[Content_Types].xml" for member in archive.infolist()):
            raise LogError(f"{path}: is a workbook or document; save the table as CSV")
        bag = len({Path(member.filename).parent for member in members}) == 1 and any(name.endswith(_STORAGES) for name in names)
        if not members or (len(members) > 1 and not bag):
            listed = ", ".join(names[:6]) or "nothing"
            raise LogError(f"{path}: holds {len(members)} files ({listed}); unpack it and name the logs among them")
        if any(member.flag_bits & 1 for member in members):
            raise LogError(f"{path}: is locked by a password; unpack it and name what comes out")
        first = scratch_file(owner, names[0])
        notes, size, written = [], Path(path).stat().st_size, 0
        for member, name in zip(members, names, strict=True):
            with archive.open(member) as source:
                notes.append(_copy(path, source, first.with_name(name), size, written))
            written += first.with_name(name).stat().st_size
        shutil.copystat(path, first)
        return (first.parent if len(members) > 1 else first), next((note for note in notes if note), "")


def _is_hidden(name: str) -> bool:
    return name.startswith("__MACOSX") or Path(name).name.startswith(".")
