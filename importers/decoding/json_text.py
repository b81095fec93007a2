"""Decoder of JSON messages, whatever their schema: nested objects become columns named by their path."""

import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

from importers.decoding.blocks import Buffer, Decoded, Offsets
from importers.decoding.leaves import stack_lists

__all__ = ["JsonDecoder"]

_TIME_KEYS = (("sec", "nsec"), ("sec", "nanosec"), ("secs", "nsecs"), ("seconds", "nanos"))
_NOT_FINITE = ("NaN", "Infinity", "-Infinity")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_RFC_3339 = re.compile(r"(\d{4}-\d{2}-\d{2}[Tt ]\d{2}:\d{2}:\d{2})(?:\.(\d+))?([Zz]|[-+]\d{2}:\d{2})")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class JsonDecoder:
    """Decodes the messages of one channel.

    Objects {sec, nsec} (and their relatives) are times, {x, y, z} and {x, y, z, w} vectors, lists of numbers arrays; lists
    of objects stay as they are, in an object column; other lists are left out. Texts in RFC 3339 are times, texts of numbers
    numbers, where a whole column is. A number column is int64 where all its values
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
        elif all(_is_number(item) or item is None or item in _NOT_FINITE for item in value):
            row[path] = [np.nan if item is None else float(item) for item in value]
        elif all(isinstance(item, dict) for item in value):
            row[path] = value
    return row


def _merged(value: Mapping[str, Any]) -> int | list[float] | None:
    """A time in nanoseconds or a vector; None where the object is neither. Parts that are zero may be missing (protobuf's JSON
    form leaves them out), and whole numbers may be texts."""
    for seconds, nanoseconds in _TIME_KEYS:
        if seconds in value and value.keys() <= {seconds, nanoseconds}:
            parts = [_whole(value.get(key, 0)) for key in (seconds, nanoseconds)]
            if parts[0] is not None and parts[1] is not None:
                return parts[0] * 1_000_000_000 + parts[1]
    keys = "xyzw" if "w" in value else "xyz"
    if value.keys() & set("xyz") and value.keys() <= set(keys):
        parts_of_vector = [value.get(key, 0.0) for key in keys]
        if all(_is_number(part) or part in _NOT_FINITE for part in parts_of_vector):
            return [float(part) for part in parts_of_vector]
    return None


def _whole(value: Any) -> int | None:
    if isinstance(value, str) and value.lstrip("-").isdecimal():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _plain(values: list[Any]) -> list[Any]:
    """Values of one column with texts that are numbers (as protobuf's JSON form writes 64-bit integers, NaN and infinities) as
    numbers, and times in RFC 3339 as nanoseconds since 1970; unchanged where another text is among them."""
    texts = [value for value in values if isinstance(value, str)]
    if not texts:
        return values
    if all(_RFC_3339.fullmatch(text) for text in texts):
        return [_nanoseconds(value) if isinstance(value, str) else value for value in values]
    if all(text in _NOT_FINITE or _NUMBER.fullmatch(text) for text in texts):
        return [_as_number(value) if isinstance(value, str) else value for value in values]
    return values


def _as_number(text: str) -> int | float:
    whole = _whole(text)
    return float(text) if whole is None else whole


def _nanoseconds(text: str) -> int | None:
    """Of a time in RFC 3339; None for a date that is none."""
    day, fraction, zone = _RFC_3339.fullmatch(text).groups()  # type: ignore[union-attr]
    try:
        moment = datetime.fromisoformat(day.upper().replace(" ", "T") + (zone.upper().replace("Z", "+00:00")))
    except ValueError:
        return None
    return int((moment - _EPOCH).total_seconds()) * 1_000_000_000 + int((fraction or "0")[:9].ljust(9, "0"))


def _column(values: list[Any]) -> np.ndarray:
    values = _plain(values)
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
