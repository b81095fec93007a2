"""Leaves: the named columns that a message type flattens into, and columns made of decoded message objects."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from operator import attrgetter
from typing import Any

import numpy as np

__all__ = ["Kind", "Leaf", "columns_of_messages", "stack_lists"]


class Kind(Enum):
    """What a leaf holds: one value, several parts of one dtype (x, y, z), a time, text, a fixed array, a variable one, an
    array of messages."""

    NUMBER = "number"
    VECTOR = "vector"
    TIME = "time"
    TEXT = "text"
    ARRAY = "array"
    LIST = "list"
    MESSAGES = "messages"


@dataclass(frozen=True, slots=True)
class Leaf:
    """One column of a message type.

    path: name of the column. parts: attribute paths in the decoded message (x, y, z of a vector; seconds and nanoseconds of
    a time; else one). dtype: of one element (of the pair for a time, object for text). count: elements per message.
    """

    path: str
    parts: tuple[str, ...]
    kind: Kind
    dtype: np.dtype
    count: int = 1


def columns_of_messages(leaves: Sequence[Leaf], messages: Sequence[object]) -> dict[str, np.ndarray]:
    """Columns (n,), (n, k) or object (n,) of n decoded messages, by attribute access: slow, and right for every type."""
    names = [part for leaf in leaves for part in leaf.parts]
    values: dict[str, list[Any]] = {name: [] for name in names}
    getters = [(attrgetter(name), values[name].append) for name in names]
    for message in messages:
        for get, append in getters:
            append(get(message))
    return {leaf.path: _column(leaf, values) for leaf in leaves}


def _column(leaf: Leaf, values: Mapping[str, list[Any]]) -> np.ndarray:
    first = values[leaf.parts[0]]
    if leaf.kind is Kind.TIME:
        nanoseconds = values[leaf.parts[1]]
        return np.array([s * 1_000_000_000 + ns for s, ns in zip(first, nanoseconds, strict=True)], dtype=np.int64)
    if leaf.kind is Kind.VECTOR:
        return np.column_stack([np.array(values[part], dtype=leaf.dtype) for part in leaf.parts])
    if leaf.kind is Kind.LIST:
        return stack_lists(first, leaf.dtype)
    if leaf.kind is Kind.ARRAY:
        return np.array(first, dtype=leaf.dtype).reshape(len(first), leaf.count)
    column = np.empty(len(first), dtype=leaf.dtype)
    column[:] = first
    return column


def stack_lists(lists: Sequence[Iterable[Any]], dtype: np.dtype) -> np.ndarray:
    """(n, k) where all lists are of one length k > 0, else an object column of arrays."""
    arrays = [np.array(list(values), dtype=dtype) for values in lists]
    if len({len(array) for array in arrays}) == 1 and len(arrays[0]):
        return np.stack(arrays)
    column = np.empty(len(arrays), dtype=object)
    for row, array in enumerate(arrays):
        column[row] = array
    return column
