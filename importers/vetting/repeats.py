"""Fixes that repeat the one before, which a driver does when its receiver has nothing new: they are no measurements.

Equal to the last digit is no proof at rest. In motion it is: a vehicle that moved at v just before cannot have come to rest
within dt unless it brakes harder than any does, and one that stands does not jump to where it would have driven.
"""

import numpy as np
from numpy.typing import NDArray

from importers.findings import Finding
from importers.vetting.vetted import Vetted, drop
from navreplay.geodesy.earth import ned_between
from navreplay.timeline import Floats, GnssFixSeries, Times

__all__ = ["leave_out_repeats"]

_AT_ONCE_NS = 20_000_000
"""Two equal fixes within this time are one that was published twice."""
_HARDEST_BRAKING = 12.0
_LEAST_SPEED = 0.7
_LEAST_JUMP = 1.5


def leave_out_repeats(fixes: GnssFixSeries) -> Vetted:
    """The fixes without those that only repeat the position before in motion, or all of the fix before at once."""
    rows = np.flatnonzero(fixes.has_position)
    if len(rows) < 4:
        return Vetted(fixes)
    t_ns, lla = fixes.t_ns[rows], fixes.lla[rows]
    equal = np.concatenate([[False], (np.diff(lla, axis=0) == 0).all(axis=1)])
    at_once = equal & (np.diff(t_ns, prepend=t_ns[0]) < _AT_ONCE_NS)
    repeated = equal & (_in_motion(t_ns, lla, equal) | at_once)
    if not repeated.any():
        return Vetted(fixes)
    position, velocity = np.zeros(len(fixes), dtype=np.bool_), np.zeros(len(fixes), dtype=np.bool_)
    position[rows[repeated]] = True
    velocity[1:] = position[1:] & (fixes.vel_n[1:] == fixes.vel_n[:-1]).all(axis=1)
    kept = drop(fixes, position, velocity)
    count = int(repeated.sum())
    longest = _longest(t_ns, repeated)
    whole = int((position & (velocity | ~fixes.has_velocity)).sum())
    text = (
        f"{count} of {len(rows)} fixes repeat the one before to the last digit while the vehicle moves, for {longest:.1f} s "
        f"at the "
        "longest: the receiver had nothing new, and its driver published the old fix again."
    )
    if at_once.sum() == count:
        apart = f"{_AT_ONCE_NS / 1e6:.0f} ms"
        text = f"{count} of {len(rows)} fixes are published twice within {apart}: the second is no measurement."
    finding = Finding("warning" if longest > 1 else "info", "repeated-fixes", text, "They are left out; nothing need be set.")
    return Vetted(kept, (finding,), "repeats the fix before", whole, count, int(velocity.sum()))


def _in_motion(t_ns: Times, lla: Floats, equal: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n,) whether the run of equal fixes that a row belongs to lies in motion: by the speed of the fixes before it, or by
    where the first fix behind it is."""
    moving = np.zeros(len(equal), dtype=np.bool_)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    for first, behind in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        moving[first:behind] = _moved_into(t_ns, lla, first) or _moved_out(t_ns, lla, first, behind)
    return moving


def _moved_into(t_ns: Times, lla: Floats, first: int) -> bool:
    """Whether the vehicle was too fast just before the repeat at index first to stand there."""
    if first < 3:
        return False
    steps = ned_between(lla[first - 3 : first - 1], lla[first - 2 : first])[:, :2]
    dt = np.diff(t_ns[first - 3 : first + 1]) / 1e9
    speeds = np.linalg.norm(steps, axis=1) / dt[:2]
    same_way = float(steps[0] @ steps[1]) > 0.5 * float(np.linalg.norm(steps[0]) * np.linalg.norm(steps[1]))
    least = float(speeds.min()) - 0.5 * _HARDEST_BRAKING * float(dt[2] + dt[1])
    return same_way and float(speeds.min()) > _LEAST_SPEED and least * float(dt[2]) > _LEAST_JUMP / 10


def _moved_out(t_ns: Times, lla: Floats, first: int, behind: int) -> bool:
    """Whether the fix behind the repeats lies where standing from then on cannot have led."""
    if behind >= len(lla):
        return False
    jump = float(np.linalg.norm(ned_between(lla[behind - 1], lla[behind])[:2]))
    last, whole = (t_ns[behind] - t_ns[behind - 1]) / 1e9, (t_ns[behind] - t_ns[first - 1]) / 1e9
    usual = float(np.median(np.linalg.norm(ned_between(lla[:-1], lla[1:])[:, :2], axis=1)))
    from_rest = 0.5 * _HARDEST_BRAKING * last**2 + 3 * usual
    return jump > max(_LEAST_JUMP, from_rest) and jump / whole > _LEAST_SPEED / 3


def _longest(t_ns: Times, repeated: NDArray[np.bool_]) -> float:
    """Longest run of repeats [s], from the fix that is repeated."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], repeated, [False]]).astype(np.int8)))
    return max((t_ns[behind - 1] - t_ns[first - 1]) / 1e9 for first, behind in zip(edges[::2], edges[1::2], strict=True))
