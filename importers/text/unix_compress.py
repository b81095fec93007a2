"""Files of Unix compress (``.Z``), as archives of stations keep old RINEX. The package ``ncompress`` unpacks them."""

from navreplay.timeline import LogError

__all__ = ["is_compressed", "unpack"]

_MAGIC = b"\x1f\x9d"
_LARGEST = 1 << 28


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
    try:
        return bytes(ncompress.decompress(data))
    except ValueError as error:
        raise LogError(f"{path}: is no intact file of Unix compress (.Z): {error}; copy the file again") from error
