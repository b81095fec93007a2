"""Decompression of chunks that may be damaged: bounded by the size they declare, and by the prefix that is there."""

import bz2

import lz4.frame
import zstandard

__all__ = ["DamagedDataError", "decompress", "decompress_prefix"]

MAX_CHUNK_BYTES = 1 << 30
_BLOCK = 1 << 20


class DamagedDataError(Exception):
    """Bytes that do not decompress to what they declare. The message is a short phrase."""


_ERRORS = (zstandard.ZstdError, RuntimeError, OSError, EOFError, ValueError, MemoryError)


def decompress(name: str, data: bytes, size: int) -> bytes:
    """The `size` bytes that `data` holds. name: ``none`` or empty, ``zstd``, ``lz4`` (frame), ``bz2``.

    Raises DamagedDataError when they do not come out, or are declared as more than a gibibyte.
    """
    if size > MAX_CHUNK_BYTES:
        raise DamagedDataError("declares an absurd size")
    try:
        content = _decompress(name, data, size)
    except _ERRORS as error:
        raise DamagedDataError("does not decompress") from error
    if len(content) != size:
        raise DamagedDataError("has another size than declared")
    return content


def _decompress(name: str, data: bytes, size: int) -> bytes:
    match name:
        case "" | "none":
            return data
        case "zstd":
            declared = zstandard.frame_content_size(data)
            if declared not in (-1, size):
                raise DamagedDataError("has another size than declared")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        case "lz4":
            return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
        case "bz2":
            return bz2.BZ2Decompressor().decompress(data, max_length=size)
    raise DamagedDataError(f"has the unknown compression {name[:20]!r}")


def decompress_prefix(name: str, data: bytes) -> bytes:
    """What can be had of compressed data that was cut off; empty when nothing."""
    try:
        match name:
            case "" | "none":
                return data
            case "zstd":
                return _zstd_prefix(data, MAX_CHUNK_BYTES)
            case "lz4":
                return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=MAX_CHUNK_BYTES)
            case "bz2":
                return bz2.BZ2Decompressor().decompress(data, max_length=MAX_CHUNK_BYTES)
    except _ERRORS:
        return b""
    return b""


def _zstd_prefix(data: bytes, most: int) -> bytes:
    """What comes out, up to damage and up to most bytes."""
    blocks, size = [], 0
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while size < most:
            try:
                block = reader.read(min(_BLOCK, most - size))
            except zstandard.ZstdError:
                if not blocks:
                    raise
                break
            if not block:
                break
            blocks.append(block)
            size += len(block)
    return b"".join(blocks)
