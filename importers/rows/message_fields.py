"""Fields of messages as arrays, whatever a recorder made of optional ones: absent, empty, too short, or spelt otherwise."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["codes", "covariances", "either_spelling", "find_field", "numbers", "numbers_of", "vectors"]

Codes = NDArray[np.int64]
_LARGEST_CODE = 2**31
_CAPITAL = re.compile(r"(?<=[a-z0-9])[A-Z]")
_ELEMENT = re.compile(r"(.*)(?:\.([xyzw])|\[(\d+)\])$")


def either_spelling(columns: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """The columns, those in camel case (protobuf's own JSON form) also under the names with underscores."""
    extra = {_CAPITAL.sub(lambda letter: "_" + letter.group().lower(), name): column for name, column in columns.items()}
    return columns if extra.keys() <= columns.keys() else {**extra, **columns}


def find_field(columns: Mapping[str, np.ndarray], path: str) -> np.ndarray | None:
    """The column (n, ...) of a field, or of one element of a field: ``linear.x``, ``gyro[0]``; None where there is none."""
    columns = either_spelling(columns)
    if path in columns:
        return columns[path]
    element = _ELEMENT.match(path)
    if element is None or element.group(1) not in columns:
        return None
    place = "xyzw".index(element.group(2)) if element.group(2) else int(element.group(3))
    whole = columns[element.group(1)]
    if whole.dtype == object:
        return np.array([_element(row, place) for row in whole.tolist()], dtype=np.float64)
    return whole[:, place] if whole.ndim == 2 and place < whole.shape[1] else None


def _element(row: Any, place: int) -> float:
    return float(row[place]) if isinstance(row, (list, np.ndarray)) and place < len(row) else np.nan


def numbers_of(column: np.ndarray) -> Floats:
    """A column of scalars (n,), NaN for what is no number."""
    if column.ndim == 1 and column.dtype.kind in "fiub":
        return column.astype(np.float64)
    return np.array([_number(value) for value in column.tolist()], dtype=np.float64)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return np.nan


def numbers(columns: Mapping[str, np.ndarray], name: str, n: int) -> Floats:
    """A field of scalars (n,), NaN where a message has none."""
    column = columns.get(name)
    return np.full(n, np.nan) if column is None else numbers_of(column)


def codes(
    columns: Mapping[str, np.ndarray], name: str, n: int, missing: int, meaning: Mapping[str, int] | None = None
) -> Codes:
    """A field of whole numbers (n,), or of texts with a meaning (enumerations by name); missing where a message has none."""
    column = columns.get(name)
    if column is None:
        return np.full(n, missing, dtype=np.int64)
    if column.dtype.kind == "O" and meaning is not None:
        texts = [meaning.get(value, value) if isinstance(value, str) else value for value in column.tolist()]
        column = np.fromiter(texts, dtype=object, count=len(texts))
    values = numbers_of(column)
    return np.where(np.abs(values) < _LARGEST_CODE, values, missing).astype(np.int64)


def vectors(columns: Mapping[str, np.ndarray], name: str, width: int, n: int) -> Floats:
    """A field of vectors (n, width), NaN where a message has none, or one of another length."""
    column = columns.get(name)
    if column is not None and column.dtype.kind in "fiu" and column.shape[1:] == (width,):
        return column.astype(np.float64)
    whole = np.full((n, width), np.nan)
    for row, value in enumerate(() if column is None else column.tolist()):
        if isinstance(value, (list, np.ndarray)) and len(value) == width:
            whole[row] = [_number(part) for part in value]
    return whole


def covariances(columns: Mapping[str, np.ndarray], name: str, size: int, n: int) -> Floats:
    """A field of matrices (n, size, size), NaN where a message has none."""
    return vectors(columns, name, size * size, n).reshape(n, size, size)
