"""From messages that hold an epoch each to a table that holds an observation in each row."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from importers.rows.log import Table

__all__ = ["flatten_epochs"]

_NO_SATELLITES = "epoch without satellites"


def flatten_epochs(
    table: Table, epochs: Sequence[Sequence[Any]], columns: Callable[[list[Any], np.ndarray], dict[str, np.ndarray]]
) -> Table:
    """A table of n messages with a row per observation. epochs: (n,) the observations of each message. columns: makes the
    columns of the rows, given all m observations and the message (m,) that each is of."""
    counts = np.array([len(epoch) for epoch in epochs], dtype=np.int64)
    message = np.repeat(np.arange(len(epochs)), counts)
    flat = columns([item for epoch in epochs for item in epoch], message)
    rejected = dict(table.rejected)
    if (counts == 0).any():
        rejected[_NO_SATELLITES] = int((counts == 0).sum())
    return Table(flat["t_gps_ns"], flat, len(flat["t_gps_ns"]) + sum(rejected.values()), rejected)
