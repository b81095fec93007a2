"""Stamps as a clock or a driver makes them, made again what they were meant to be: batches spread, steps of a clock taken back.

A driver that stamps a batch of samples with one time gives runs of equal stamps; a clock that is set while a log is written
gives one step behind which everything goes on as before. Neither is a disorder of single stamps.
"""

import numpy as np

from navreplay.timeline import Times

__all__ = ["mend_stamps"]

_LEAST_ROWS = 40
_MOST_STEPS = 5
_BESIDE = 20
_REGULAR = 3.0
_LONGEST_STEP_NS = 60_000_000_000
_LEAST_BATCH = 3.0
_SECOND_NS = 10**9
_LEAST_STEP_NS = 2 * 10**8


def mend_stamps(t_ns: Times, log_time_ns: Times | None = None) -> tuple[Times, tuple[str, ...]]:
    """Stamps (n,) in the order of the file, with batches spread and steps of the clock undone, and sentences on what was done.
    log_time_ns: (n,) by the clock of the recorder, where there is one."""
    if len(t_ns) < _LEAST_ROWS:
        return t_ns, ()
    notes: list[str] = []
    t_ns = _spread_batches(t_ns, notes)
    if log_time_ns is not None:
        t_ns = _undo_against_recorder(t_ns, log_time_ns, notes)
    return _undo_steps(t_ns, notes), tuple(notes)


def _spread_batches(t_ns: Times, notes: list[str]) -> Times:
    """Where most stamps repeat the one before and batches are of one size, each batch evenly over the time since the one
    before."""
    first = np.flatnonzero(np.diff(t_ns, prepend=t_ns[0] - 1) != 0)
    sizes = np.diff(np.append(first, len(t_ns)))
    usual = float(np.median(sizes))
    if usual < _LEAST_BATCH or len(first) < _BESIDE or np.mean(np.abs(sizes - usual) <= 0.25 * usual) < 0.8:
        return t_ns
    stamps = t_ns[first]
    gap = np.diff(stamps, prepend=stamps[0] - round(float(np.median(np.diff(stamps)))))
    gap = np.minimum(gap, round(2 * float(np.median(gap))))
    if (gap <= 0).any():
        return t_ns
    batch = np.repeat(np.arange(len(first)), sizes)
    place = np.arange(len(t_ns)) - first[batch]
    if (stamps % _SECOND_NS == stamps[0] % _SECOND_NS).all():
        ahead = np.rint(_SECOND_NS * place / np.maximum(sizes[batch], usual)).astype(np.int64)
        notes.append(
            f"stamps are whole seconds for {usual:.0f} rows each; the rows were spread over the second that begins there"
        )
        return np.asarray(stamps[batch] + ahead)
    behind = sizes[batch] - 1 - place
    spread = stamps[batch] - np.rint(gap[batch] * behind / sizes[batch]).astype(np.int64)
    notes.append(
        f"stamps come in batches of {usual:.0f}; each batch was spread over the time since the one before, its stamp being "
        f"that of "
        "its last sample"
    )
    return spread


def _undo_against_recorder(t_ns: Times, log_time_ns: Times, notes: list[str]) -> Times:
    """Steps of the stamps that the recorder's clock, which ran on evenly, did not see: every stretch gets the delay against it
    of the one that agrees with it best."""
    delay = (log_time_ns - t_ns).astype(np.float64)
    steps, logged = np.diff(t_ns).astype(np.float64), np.diff(log_time_ns).astype(np.float64)
    odd = np.abs(logged - steps) > max(_LEAST_STEP_NS, 20 * float(np.median(np.abs(np.diff(delay)))))
    at = np.flatnonzero(odd & (np.abs(steps - np.median(steps)) > np.abs(logged - np.median(logged))))
    if not 0 < len(at) <= _MOST_STEPS:
        return t_ns
    pieces = np.split(np.arange(len(t_ns)), at + 1)
    middle = np.array([np.median(delay[piece]) for piece in pieces])
    spread = max(float(np.median(np.abs(delay[piece] - level))) for piece, level in zip(pieces, middle, strict=True))
    apart = np.abs(np.diff(middle))
    if min(map(len, pieces)) < _BESIDE or not (_LEAST_STEP_NS + 10 * spread < apart).all() or apart.max() > _LONGEST_STEP_NS:
        return t_ns
    right = float(middle[np.argmin(np.abs(middle))])
    mended = t_ns.copy()
    for piece, level in zip(pieces, middle, strict=True):
        mended[piece] += round(level - right)
    for row, step in zip(at.tolist(), np.diff(middle).tolist(), strict=True):
        way = "back" if step > 0 else "forward"
        notes.append(
            f"the clock of its stamps was set {way} by {abs(step) / 1e9:.3f} s behind row {row + 1}, against the clock of the "
            "recorder; all are stamped as where the two agree best"
        )
    return mended


def _undo_steps(t_ns: Times, notes: list[str]) -> Times:
    """A few steps back, each between stretches that run evenly, are those of a clock that was set: the rest is moved on by
    them."""
    steps = np.diff(t_ns)
    back = np.flatnonzero(steps < 0)
    usual = float(np.median(steps))
    if not 0 < len(back) <= _MOST_STEPS or usual <= 0:
        return t_ns
    mended = t_ns.copy()
    for at in back.tolist():
        around = np.concatenate([steps[max(at - _BESIDE, 0) : at], steps[at + 1 : at + 1 + _BESIDE]])
        even = np.mean((around > 0) & (around < _REGULAR * usual)) if len(around) else 0.0
        if len(around) and around.max() > max(-steps[at] / 2, _REGULAR * usual):
            return t_ns  # there and back again: a few stamps that are wrong, not a clock
        if even < 0.95 or len(around) < _BESIDE // 2 or -steps[at] > _LONGEST_STEP_NS or -steps[at] < 2 * usual:
            return t_ns
        shift = round(usual) - int(steps[at])
        mended[at + 1 :] += shift
        notes.append(
            f"the clock of its stamps was set back by {shift / 1e9:.3f} s behind row {at + 1}; what follows is stamped on "
            f"by the "
            "clock as it was before"
        )
    return mended
