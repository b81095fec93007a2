"""Decoder of JSON messages, whatever their schema: nested objects become columns named by their path."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from importers.decoding.blocks import Buffer, Decoded, Offsets
from importers.decoding.leaves import stack_lists

__all__ = ["JsonDecoder"]

_TIME_KEYS = (("sec", "nsec"), ("sec", "nanosec"), ("secs", "nsecs"), ("seconds", "nanos"))
_VECTOR_KEYS = (("x", "y", "z"), ("x", "y", "z", "w"))


class JsonDecoder:
    """Decodes the messages of one channel.

    Objects {sec, nsec} (and their relatives) are times, {x, y, z} and {x, y, z, w} vectors, lists of numbers arrays; lists
    of objects stay as they are, in an object column; other lists are left out. A number column is int64 where all its values
    are whole numbers, else float64 with NaN for null and for what is missing.
    """

    def decode(self, buffer: Buffer, start: Offsets, stop: Offsets) -> Decoded:
        """See `Decoder`."""
        kept, rows = [], []
        for place, (a, b) in enumerate(zip(start, stop, strict=True)):
            message = _parse(buffer[a:b].tobytes())
            if message is not None:  # the others are counted by their absence from kept
                rows.append(_flatten(message, ""))
                kept.append(place)
        paths = dict.fromkeys(path for row in rows for path in row)
        columns = {path: _column([row.get(path) for row in rows]) for path in paths}
        return Decoded(columns, np.array(kept, dtype=np.intp), reason="not a JSON object")


def _parse(text: bytes) -> dict[str, Any] | None:
    """The object that the text holds; None where it holds none."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _flatten(message: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for key, value in message.items():
        path = prefix + key
        if isinstance(value, dict):
            merged = _merged(value)
            row.update({path: merged} if merged is not None else _flatten(value, f"{path}."))
        elif not isinstance(value, list):
            row[path] = value
        elif all(_is_number(item) or item is None for item in value):
            row[path] = [np.nan if item is None else float(item) for item in value]
        elif all(isinstance(item, dict) for item in value):
            row[path] = value
    return row


def _merged(value: Mapping[str, Any]) -> int | list[float] | None:
    """A time in nanoseconds or a vector; None where the object is neither."""
    for seconds, nanoseconds in _TIME_KEYS:
        if value.keys() == {seconds, nanoseconds} and all(isinstance(part, int) for part in value.values()):
            return value[seconds] * 1_000_000_000 + value[nanoseconds]
    for keys in _VECTOR_KEYS:
        if value.keys() == set(keys) and all(_is_number(part) for part in value.values()):
            return [float(value[key]) for key in keys]
    return None


def _column(values: list[Any]) -> np.ndarray:
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return np.array(values, dtype=bool)
    if kinds == {int} and all(abs(value) < 2**63 for value in values):
        return np.array(values, dtype=np.int64)
    if kinds <= {int, float, type(None)} and kinds != {type(None)}:
        return np.array([np.nan if value is None else float(value) for value in values])
    if kinds <= {list, type(None)} and list in kinds and not any(value and isinstance(value[0], dict) for value in values):
        width = max(len(value) for value in values if value is not None)
        return stack_lists([[np.nan] * width if value is None else value for value in values], np.dtype(float))
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column
