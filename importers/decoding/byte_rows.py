"""Equal pieces of a buffer as rows: what all readers of binary streams do with the messages they have found."""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets

__all__ = ["gather", "records"]


def gather(buffer: Buffer, start: Offsets, width: int) -> NDArray[np.uint8]:
    """Bytes (n, width) from each start (n,); zeros beyond the end of the buffer. Column by column, for memory's sake."""
    rows = np.zeros((len(start), width), np.uint8)
    for column in range(width):
        place = start + column
        inside = place < len(buffer)
        if inside.all():
            rows[:, column] = buffer[place]
        else:
            rows[inside, column] = buffer[place[inside]]
    return rows


def records(buffer: Buffer, start: Offsets, layout: np.dtype[np.void]) -> NDArray[np.void]:
    """Records (n,) of a layout from each start (n,)."""
    return gather(buffer, start, layout.itemsize).view(layout)[:, 0]
