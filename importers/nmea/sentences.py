"""Sentences of NMEA 0183 in files and streams: where each begins and ends, whether it is intact, and its fields.

A sentence begins at each dollar sign, whatever a logger wrote before it on the line, and ends behind its checksum or with its
line.
"""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from importers.text.table import parse_text, select_columns

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Sentences", "find_sentences", "is_nmea"]

_SENTENCE = re.compile(rb"\$[A-Z]{2}[A-Z0-9]{3},[\x20-\x7e]{0,100}\*[0-9A-Fa-f]{2}")
_KNOWN = re.compile(
    r"\$[A-Z]{2}(GGA|RMC|GNS|ZDA|GST|VTG|GLL|GSA|GSV|GRS|GBS|HDT|THS|ROT|DTM),[^\r\n$]*|\$P[A-Z]{3,}[A-Z0-9]*,[^\r\n$]*\*[0-9A-F]{2}"
)
_DOLLAR, _STAR, _RETURN, _NEWLINE = (ord(mark) for mark in "$*\r\n")
_FEW = 0.1


def is_nmea(head: str) -> bool:
    """Whether the beginning of a file holds a sentence of a receiver."""
    return _KNOWN.search(head) is not None


def find_sentences(stream: bytes | memoryview) -> bytes:
    """The sentences that stand in a stream of other messages, a line each."""
    return b"\n".join(_SENTENCE.findall(stream))


class Sentences:
    """Sentences of a text. count: of them, and of the lines that hold none. kind: (count,) three letters, empty where one
    is not intact by form and checksum; where hardly any has a checksum, by form alone. talker: (count,) two letters."""

    def __init__(self, data: bytes) -> None:
        self._buffer = np.frombuffer(data, dtype=np.uint8)
        self._starts, self._ends = _split(self._buffer)
        self.count = len(self._starts)
        self.intact = _intact(self._buffer, self._starts, self._ends)
        self.kind = self._letters(3, 6)
        self.talker = self._letters(1, 3)

    def _letters(self, first: int, last: int) -> NDArray[np.str_]:
        names = np.full(self.count, "", dtype=f"U{last - first}")
        letters = self._buffer[self._starts[self.intact, None] + np.arange(first, last)]
        names[self.intact] = letters.astype(np.uint32).view(f"U{last - first}").ravel()
        return names

    def fields(self, chosen: NDArray[np.bool_], numbers: Mapping[str, int], texts: tuple[int, ...]) -> "pd.DataFrame":
        """Fields of the chosen sentences, by name or number; the index is the place of the sentence."""
        import pandas as pd

        width = max(*numbers.values(), *texts, 0) + 1
        lines = [b"%d," % line + b",".join(self._fields_of(line, width)) for line in np.flatnonzero(chosen)]
        text = parse_text(b"\n".join(lines), delimiter=",", header=False)
        if text.frame.empty:
            return pd.DataFrame({name: np.empty(0) for name in (*numbers, *texts)})
        selection = select_columns(
            text, {name: i + 1 for name, i in numbers.items()} | {"line": 0}, {str(i): i + 1 for i in texts}
        )
        frame = pd.DataFrame(dict(selection.columns)).rename(columns={str(i): i for i in texts})
        return frame.set_index("line")

    def _fields_of(self, line: int, width: int) -> list[bytes]:
        """The first fields of a sentence without its checksum; those that it lacks are empty."""
        body = bytes(self._buffer[self._starts[line] : self._ends[line]]).partition(b"*")[0].replace(b'"', b"")
        fields = body.split(b",")[:width]
        return fields + [b""] * (width - len(fields))


def _split(buffer: NDArray[np.uint8]) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends of sentences, and of the non-blank lines without any."""
    newlines = np.flatnonzero((buffer == _NEWLINE) | (buffer == _RETURN))
    lines = np.concatenate([[0], newlines + 1])
    line_ends = np.concatenate([newlines, [len(buffer)]])
    dollars = np.flatnonzero(buffer == _DOLLAR)
    held = np.searchsorted(dollars, line_ends) > np.searchsorted(dollars, lines)
    bare = lines[~held & (line_ends > lines)]
    starts = np.sort(np.concatenate([dollars, bare]))
    ends = line_ends[np.searchsorted(line_ends, starts)] if len(starts) else starts
    ends = np.minimum(ends, np.append(starts[1:], len(buffer)))
    stars = np.append(np.flatnonzero(buffer == _STAR), len(buffer))
    star = stars[np.searchsorted(stars, starts)]
    return starts, np.where(star + 3 <= ends, star + 3, ends)


def _intact(buffer: NDArray[np.uint8], starts: np.ndarray, ends: np.ndarray) -> NDArray[np.bool_]:
    formed = (ends - starts > 10) & (buffer[np.minimum(starts, len(buffer) - 1)] == _DOLLAR) if len(starts) else starts > 0
    summed = formed.copy()
    summed[formed] = buffer[ends[formed] - 3] == _STAR
    intact = summed.copy()
    if summed.any():
        edges = np.column_stack([starts[summed] + 1, ends[summed] - 3]).ravel()
        parity = np.bitwise_xor.reduceat(buffer, edges)[::2]
        intact[summed] = parity == 16 * _hex(buffer[ends[summed] - 2]) + _hex(buffer[ends[summed] - 1])
    return intact | formed if summed.sum() <= _FEW * formed.sum() else intact


def _hex(digit: np.ndarray) -> np.ndarray:
    value = digit.astype(np.int64)
    return np.where(value <= ord("9"), value - ord("0"), (value | 0x20) - ord("a") + 10)
