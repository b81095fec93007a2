"""Bits of broadcast navigation data: fields out of many subframes at once, and subframes that belong together."""

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats, Times

__all__ = ["Bits", "complete_sets", "last_klobuchar", "nearest_time"]

_WEEK_NS = 604_800 * 10**9
_KLOBUCHAR_EXPONENTS = (-30, -27, -24, -24, 11, 14, 16, 16)


class Bits:
    """Fields of n messages. bits: (n, width) of 0 and 1, the first sent first."""

    def __init__(self, bits: NDArray[np.uint8]) -> None:
        self._bits = bits

    @classmethod
    def of_words(cls, words: NDArray[np.int64], widths: Sequence[int], skipped: Sequence[int]) -> "Bits":
        """From words (n, k): of each, the given number of bits in front of the last ones skipped (parity)."""
        parts = [
            (words[:, i : i + 1] >> np.arange(width + skip - 1, skip - 1, -1)) & 1
            for i, (width, skip) in enumerate(zip(widths, skipped, strict=True))
        ]
        return cls(np.concatenate(parts, axis=1).astype(np.uint8))

    @classmethod
    def side_by_side(cls, parts: Sequence["Bits"]) -> "Bits":
        """Messages made of the parts, each of n."""
        return cls(np.concatenate([part._bits for part in parts], axis=1))

    def __len__(self) -> int:
        return len(self._bits)

    def rows(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Bits":
        """Some of the messages."""
        return Bits(self._bits[rows])

    def columns(self, *spans: tuple[int, int]) -> "Bits":
        """Messages made of spans (first, width)."""
        return Bits(np.concatenate([self._bits[:, first : first + width] for first, width in spans], axis=1))

    def whole(self, first: int, width: int) -> NDArray[np.int64]:
        """Unsigned numbers (n,)."""
        return self._bits[:, first : first + width].astype(np.int64) @ (1 << np.arange(width - 1, -1, -1, dtype=np.int64))

    def signed(self, first: int, width: int) -> NDArray[np.int64]:
        """Numbers (n,) in two's complement."""
        return self.whole(first, width) - (self._bits[:, first].astype(np.int64) << width)

    def sign_magnitude(self, first: int, width: int) -> NDArray[np.int64]:
        """Numbers (n,) whose first bit is the sign."""
        return np.where(self._bits[:, first] == 1, -1, 1) * self.whole(first + 1, width - 1)

    def scaled(self, first: int, width: int, exponent: int, factor: float = 1.0, signed: bool = True) -> Floats:
        """Numbers (n,) times factor times 2 to the exponent."""
        values = self.signed(first, width) if signed else self.whole(first, width)
        return values * (2.0**exponent * factor)

    def packed(self) -> NDArray[np.uint8]:
        """Bytes (n, k), zeros in front where the width is no multiple of eight."""
        missing = -self._bits.shape[1] % 8
        return np.packbits(np.pad(self._bits, ((0, 0), (missing, 0))), axis=1)


def complete_sets(
    sat: Sequence[Hashable], part: Sequence[int], issue: Sequence[Hashable], wanted: Sequence[int]
) -> NDArray[np.intp]:
    """Rows (m, len(wanted)) of messages that make a whole: of one satellite, one of each wanted part, of one issue, in the
    order in which they become complete. Each issue is told once until another follows."""
    latest: dict[Hashable, dict[int, int]] = {}
    told: dict[Hashable, Hashable] = {}
    sets = []
    for row, (name, number, version) in enumerate(zip(sat, part, issue, strict=True)):
        parts = latest.setdefault(name, {})
        parts[number] = row
        rows = [parts.get(other, -1) for other in wanted]
        whole = number in wanted and min(rows) >= 0 and all(issue[other] == version for other in rows)
        if whole and told.get(name) != version:
            told[name] = version
            sets.append(rows)
    return np.array(sets, dtype=np.intp).reshape(-1, len(wanted))


def last_klobuchar(pages: Bits, first: int) -> Floats | None:
    """The ionosphere's coefficients (8,) alpha0..3, beta0..3 [s and powers of semicircles], which begin at bit first, of the
    last of pages; None where there is no page. GPS, QZSS and BeiDou scale them alike."""
    if len(pages) == 0:
        return None
    last = pages.rows(np.array([len(pages) - 1]))
    return np.concatenate([last.scaled(first + 8 * i, 8, exponent) for i, exponent in enumerate(_KLOBUCHAR_EXPONENTS)])


def nearest_time(sow_s: NDArray[np.int64] | Floats, near_ns: Times) -> Times:
    """Times (n,) [ns] with seconds of week sow_s (n,), nearest to near_ns (n,)."""
    sow_ns = np.rint(np.asarray(sow_s) * 1e9).astype(np.int64)
    return near_ns + (sow_ns - near_ns + _WEEK_NS // 2) % _WEEK_NS - _WEEK_NS // 2
