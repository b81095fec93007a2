"""Equal pieces of a buffer as rows: what all readers of binary streams do with the messages they have found."""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["gather", "records"]


def gather(buffer: Buffer, start: Offsets, width: int) -> NDArray[np.uint8]:
    """Bytes (n, width) from each start (n,); zeros beyond the end of the buffer."""
    place = start[:, None] + np.arange(width)
    inside = place < len(buffer)
    return np.where(inside, buffer[np.where(inside, place, 0)], np.uint8(0)) if len(buffer) else np.zeros((0, width), np.uint8)


def records(buffer: Buffer, start: Offsets, layout: np.dtype[np.void]) -> NDArray[np.void]:
    """Records (n,) of a layout from each start (n,)."""
    return np.ascontiguousarray(gather(buffer, start, layout.itemsize)).view(layout)[:, 0]
