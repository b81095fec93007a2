"""Which rows are used, which are rejected and why: one verdict per row, so that the counts always balance."""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import LogError, Times

__all__ = ["Screening", "longest_increasing"]

NOT_INCREASING = "time not increasing"
_EARLIEST_NS = 315_000_000 * 10**9
_SMALL_DISORDER_NS = 10**9


class Screening:
    """Verdicts on n rows; a row keeps the first reason it is rejected for. notes: what was done to the order, in sentences."""

    def __init__(self, name: str, n: int) -> None:
        self.name = name
        self.notes: list[str] = []
        self._code = np.zeros(n, dtype=np.int8)
        self._reasons: list[str] = ["used"]

    @property
    def kept(self) -> NDArray[np.bool_]:
        """(n,) rows without a reason against them."""
        return np.asarray(self._code == 0)

    def reject(self, bad: np.ndarray, reason: str) -> None:
        """Rejects the rows of bad (n,) that are still kept."""
        if reason not in self._reasons:
            self._reasons.append(reason)
        self._code[bad & self.kept] = self._reasons.index(reason)

    def rejected(self, part: slice) -> dict[str, int]:
        """Counts per reason among a part of the rows."""
        counts = np.bincount(self._code[part], minlength=len(self._reasons))
        return {reason: int(count) for reason, count in zip(self._reasons[1:], counts[1:], strict=True) if count}

    def order(self, t_ns: Times) -> NDArray[np.intp]:
        """Rejects rows whose time is before 1990 or does not increase; returns the rows kept, in the order of time.

        Steps back of at most a second are sorted; behind longer ones the longest increasing run of stamps is kept.
        Raises LogError where most stamps lie before 1990.
        """
        early = t_ns < _EARLIEST_NS
        if early.any() and early.sum() * 2 > len(t_ns):
            raise LogError(
                f"{self.name}: {int(early.sum())} of {len(t_ns)} stamps lie before 1990, so the clock that made them was never "
                "set (they begin near 1970 or count from power-on); use the recorder's time with stamp = 'log', or "
                "time_base = 'boot'"
            )
        self.reject(early, "stamp before 1990")
        index = np.flatnonzero(self.kept)
        steps = np.diff(t_ns[index])
        if (steps < 0).any():
            index = self._sort(t_ns, index, steps)
        same = np.flatnonzero(np.diff(t_ns[index]) == 0)
        if len(same):
            self._reject_rows(index[same + 1], NOT_INCREASING)
            index = np.delete(index, same + 1)
        return index

    def _sort(self, t_ns: Times, index: NDArray[np.intp], steps: Times) -> NDArray[np.intp]:
        worst, count = -int(steps.min()), int((steps < 0).sum())
        if worst <= _SMALL_DISORDER_NS:
            stamps = "1 stamp was" if count == 1 else f"{count} stamps were"
            self.notes.append(f"{self.name}: {stamps} out of order by at most {worst / 1e9:.3g} s; the samples were sorted")
            return index[np.argsort(t_ns[index], kind="stable")]
        kept = longest_increasing(t_ns[index])
        self._reject_rows(np.delete(index, kept), NOT_INCREASING)
        often = "once" if count == 1 else f"{count} times"
        self.notes.append(
            f"{self.name}: time jumps back {often}, by up to {worst / 1e9:.6g} s; the longest increasing run of stamps was kept"
        )
        return index[kept]

    def _reject_rows(self, rows: NDArray[np.intp], reason: str) -> None:
        bad = np.zeros(len(self._code), dtype=bool)
        bad[rows] = True
        self.reject(bad, reason)


def longest_increasing(t_ns: Times) -> NDArray[np.intp]:
    """Indices of a longest strictly increasing subsequence (patience sorting; Fredman, Discrete Mathematics 11 (1975) 29)."""
    tails: list[int] = []
    tail_rows: list[int] = []
    previous = np.full(len(t_ns), -1, dtype=np.intp)
    for row, value in enumerate(t_ns.tolist()):
        place = bisect_left(tails, value)
        if place == len(tails):
            tails.append(value)
            tail_rows.append(row)
        elif value < tails[place]:
            tails[place] = value
            tail_rows[place] = row
        previous[row] = tail_rows[place - 1] if place else -1
    chain = np.empty(len(tails), dtype=np.intp)
    row = tail_rows[-1] if tail_rows else -1
    for place in range(len(tails) - 1, -1, -1):
        chain[place] = row
        row = int(previous[row])
    return chain
