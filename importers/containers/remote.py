"""Logs at an address (s3://, https://, gs:// and whatever else fsspec knows), fetched into a scratch file."""

import re
from pathlib import Path

from importers.containers.file_bytes import scratch_file
from navreplay.timeline import LogError

__all__ = ["address_of", "fetch"]

_ADDRESS = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+(?:::[A-Za-z][A-Za-z0-9+.-]+)*):/{1,3}(.+)")


def address_of(path: str) -> str | None:
    """The address that a path is, rather than a file here; None where it is none. One of the two slashes may be missing, as
    where it went through a file's path."""
    parts = _ADDRESS.fullmatch(path)
    if parts is None or Path(path).exists():
        return None
    scheme, rest = parts.groups()
    return path if "://" in path else f"{scheme}://{'/' if scheme == 'file' else ''}{rest}"


def fetch(address: str, owner: object) -> Path:
    """The file or folder at the address, copied to a scratch place that goes away with the owner. Raises LogError where the
    package for it is missing, or it cannot be had."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise LogError(f"{address}: to read addresses fsspec is needed: pip install 'navreplay[remote]'") from error
    try:
        system, path = url_to_fs(address)
        place = scratch_file(owner, path.rstrip("/").rpartition("/")[2].partition("?")[0] or "log")
        system.get(path, str(place), recursive=system.isdir(path))
    except FileNotFoundError as error:
        raise LogError(f"{address}: nothing is there") from error
    except ImportError as error:
        raise LogError(f"{address}: {' '.join(str(error).split())} (with pip, beside fsspec)") from error
    except (OSError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise LogError(f"{address}: cannot be fetched: {reason}") from error
    return place
