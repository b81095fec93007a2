"""Logs at an address (s3://, https://, gs:// and whatever else fsspec knows), fetched into a scratch file."""

import re
from pathlib import Path

from importers.containers.file_bytes import scratch_file
from navreplay.timeline import LogError

__all__ = ["fetch", "is_address"]

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(::[A-Za-z][A-Za-z0-9+.-]+)*://.+")


def is_address(path: str) -> bool:
    """Whether a path is an address rather than a file here."""
    return _ADDRESS.fullmatch(path) is not None


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
