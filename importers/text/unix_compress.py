"""Files of Unix compress (``.Z``), as archives of stations keep old RINEX. The package ``ncompress`` unpacks them."""

from io import BytesIO
from typing import Any

from navreplay.timeline import LogError

__all__ = ["is_compressed", "unpack"]

_MAGIC = b"\x1f\x9d"
_LARGEST = 1 << 28
_NEVER_ABSURD = 1 << 30
_LARGEST_RATIO = 200


class _TooLargeError(Exception):
    """What comes out is more than any log packs so small."""


class _Bounded(BytesIO):
    """Takes at most so many bytes."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self.most = most

    def write(self, data: Any) -> int:
        """Raises _TooLargeError beyond."""
        if self.tell() + len(data) > self.most:
            raise _TooLargeError
        return super().write(data)


def is_compressed(head: bytes) -> bool:
    """Whether the beginning of a file is that of Unix compress."""
    return head.startswith(_MAGIC)


def unpack(path: str, data: bytes) -> bytes:
    """The content of a file of Unix compress. Raises LogError where it is damaged or too large, or the package missing."""
    if len(data) > _LARGEST:
        raise LogError(
            f"{path}: {len(data) >> 20} MiB of Unix compress (.Z) are not unpacked in memory; unpack it with gzip -d"
        )
    try:
        import ncompress
    except ImportError as error:
        raise LogError(
            f"{path}: files of Unix compress (.Z) need the package ncompress: pip install 'navreplay[formats]', or unpack it "
            "with gzip -d"
        ) from error
    plain = _Bounded(max(_NEVER_ABSURD, _LARGEST_RATIO * len(data)))
    try:
        ncompress.decompress(data, plain)
    except _TooLargeError as error:
        raise LogError(
            f"{path}: unpacks to more than {plain.most >> 20} MiB from {len(data)} bytes, which no log does"
        ) from error
    except ValueError as error:
        raise LogError(f"{path}: is no intact file of Unix compress (.Z): {error}; copy the file again") from error
    return plain.getvalue()
