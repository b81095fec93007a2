"""Positions that jump away and come back, against their own velocities: wrong fixes, which their accuracy does not tell.

A step of the position that the velocity did not see is a fault of the one or the other. Where a step back of the same size
follows, the positions in between were wrong; where none does, the positions before may have been, and both are kept.
"""

import numpy as np
from numpy.typing import NDArray

from importers.findings import Finding
from importers.vetting.vetted import Vetted, drop
from navreplay.geodesy.earth import ned_between
from navreplay.timeline import Floats, GnssFixSeries

__all__ = ["leave_out_jumps"]

_LONGEST_S = 120.0
_LONGEST_STEP_S = 2.5
_SIGNIFICANT = 7.0
_LEAST_STEP = 0.5
_ALIKE = 0.25
_LEAST_ROWS = 12
_MOST = 0.25
"""Share of the fixes that may be wrong; beyond it nobody knows which are."""
_HARDEST = 15.0
"""Acceleration [m/s^2] that a vehicle may have."""


def leave_out_jumps(fixes: GnssFixSeries) -> Vetted:
    """The fixes without positions between a step away and the step back."""
    rows = np.flatnonzero(fixes.has_position)
    if len(rows) < _LEAST_ROWS:
        return Vetted(fixes)
    t = (fixes.t_ns[rows] - fixes.t_ns[rows[0]]) / 1e9
    dt = np.diff(t)
    moved = ned_between(fixes.lla[rows[:-1]], fixes.lla[rows[1:]])[:, :2]
    steps, unseen = _unexplained(fixes, rows, t, moved)
    least = np.maximum(_threshold(fixes, rows, steps), unseen) * np.where(dt < _LONGEST_STEP_S, 1.0, np.inf)
    if unseen.any():  # what is no jump is the vehicle's own change of speed
        steps = np.where((np.linalg.norm(steps, axis=1) > least)[:, None], steps, 0.0)
    wrong = np.zeros(len(rows), dtype=np.bool_)
    for first, behind in _excursions(t, steps, least):
        wrong[first:behind] = True
    count = int(wrong.sum())
    if not 0 < count <= _MOST * len(rows):
        return Vetted(fixes)
    position = np.zeros(len(fixes), dtype=np.bool_)
    position[rows[wrong]] = True
    largest = float(np.linalg.norm(steps, axis=1).max())
    text = (
        f"{count} of {len(rows)} fixes lie between a jump of the position and the jump back, up to {largest:.3g} m, of "
        f"which their "
        "velocities saw nothing, or that no vehicle makes: wrong fixes, told as accurate."
    )
    finding = Finding("warning", "fix-jumps", text, "Their positions are left out, their velocities used; nothing need be set.")
    return Vetted(drop(fixes, position, np.zeros(len(fixes), dtype=np.bool_)), (finding,), "jumps away and back", 0, count)


def _unexplained(fixes: GnssFixSeries, rows: NDArray[np.intp], t: Floats, moved: Floats) -> tuple[Floats, Floats]:
    """Of the steps moved (k - 1, 2) [m], the part (k - 1, 2) that velocities do not explain; and how much of it a change of
    speed may be (k - 1,) [m], zero where velocities are known throughout. Without them the steps before tell the speed."""
    dt = np.diff(t)
    known = np.flatnonzero(fixes.has_velocity)
    if len(known) >= 0.8 * len(rows):
        at = (fixes.t_ns[known] - fixes.t_ns[rows[0]]) / 1e9
        vel = np.column_stack([np.interp(t, at, fixes.vel_n[known, axis]) for axis in (0, 1)])
        return moved - (vel[1:] + vel[:-1]) / 2 * dt[:, None], np.zeros(len(dt))
    speed = moved / dt[:, None]
    before = np.stack([np.roll(speed, shift, axis=0) for shift in (1, 2, 3)])
    usual = np.median(before, axis=0)
    usual[:3] = speed[:3]
    return moved - usual * dt[:, None], _HARDEST * dt * 2 * float(np.median(dt))


def _threshold(fixes: GnssFixSeries, rows: NDArray[np.intp], steps: Floats) -> Floats:
    """(k - 1,) least step [m] that is no noise: by the scatter of all steps and by what is told."""
    scatter = 1.4826 * float(np.median(np.abs(steps)))
    variance = np.trace(fixes.cov_pos[rows, :2, :2], axis1=1, axis2=2) / 2
    told = np.sqrt(np.where(np.isfinite(variance), variance, 0.0))
    return np.maximum(_SIGNIFICANT * max(scatter, 1e-3), np.maximum(_LEAST_STEP, 3 * np.hypot(told[1:], told[:-1])))


def _stays_away(steps: Floats, away: int, back: int) -> bool:
    """Whether all fixes between two jumps are off."""
    offsets = np.linalg.norm(np.cumsum(steps[away:back], axis=0), axis=1)
    return bool((offsets > 0.5 * float(offsets[0])).all())


def _excursions(t: Floats, steps: Floats, least: Floats) -> list[tuple[int, int]]:
    """Rows (first, behind) of each excursion: from a step to the first that undoes it."""
    jumps = np.flatnonzero(np.linalg.norm(steps, axis=1) > least).tolist()
    found: list[tuple[int, int]] = []
    at = 0
    while at < len(jumps):
        away = jumps[at]
        total = steps[away].copy()
        back = None
        for later in range(at + 1, len(jumps)):
            if t[jumps[later]] - t[away] > _LONGEST_S:
                break
            total += steps[jumps[later]]
            if np.linalg.norm(total) < max(_ALIKE * float(np.linalg.norm(steps[away])), float(least[away])):
                back = later
                break
        if back is None or not _stays_away(steps, away, jumps[back]):
            at += 1
            continue
        if jumps[back] - away >= 2:  # a single outlier is the gate's
            found.append((away + 1, jumps[back] + 1))
        at = back + 1
    return found
