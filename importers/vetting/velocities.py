"""Velocities that lie: never filled, frozen, of another unit, sign, axis or frame, or late against the positions.

What is proven and has one cure is mended; what does not fit is left out. Both are told. A velocity without motion to compare it
with is believed.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from importers.findings import Finding
from importers.vetting.motion_fit import Fit, Windows, fit, gather_windows
from importers.vetting.vetted import Vetted, drop
from navreplay.timeline import Floats, GnssFixSeries

__all__ = ["vet_velocities"]

_UNITS = {
    1 / 0.514444: "knots",
    3.6: "km/h",
    2.236936: "miles per hour",
    3.280840: "feet per second",
    100.0: "cm/s",
    1000.0: "mm/s",
}
_LEAST_MOTION = 5.0
"""Displacement [m] over a window that velocities are judged by, and this many times its scatter."""
_TIMES_SCATTER = 6.0
_FITS = 0.05
"""Share of the displacements' power that may be left unexplained."""
_CONTRADICTS = 0.25
_SCALE = 0.04
_LEAST_DELAY = 0.02
_FROZEN_ROWS = 8
_FROZEN_SPEED = 0.5
_WIDE = 1e6
"""Variance [m^2/s^2] of a vertical velocity that is not used."""
_TURNS: tuple[tuple[Floats, str], ...] = tuple(
    (np.array(matrix, dtype=np.float64), words)
    for matrix, words in (
        (((1, 0), (0, -1)), "the east part has the opposite sign"),
        (((-1, 0), (0, 1)), "the north part has the opposite sign"),
        (((-1, 0), (0, -1)), "north and east parts have the opposite sign"),
        (((0, 1), (1, 0)), "north and east parts are exchanged"),
        (((0, 1), (-1, 0)), "the axes are turned by 90 degrees"),
        (((0, -1), (1, 0)), "the axes are turned by -90 degrees"),
        (((0, -1), (-1, 0)), "north and east parts are exchanged, with opposite signs"),
    )
)


def vet_velocities(fixes: GnssFixSeries) -> Vetted:
    """The fixes with the velocities that agree with their positions."""
    if not fixes.has_velocity.any():
        return Vetted(fixes)
    never = _never_filled(fixes)
    if never is not None:
        return never
    fixes, findings, out = _without_frozen(fixes)
    windows = gather_windows(fixes)
    if windows is None:
        return Vetted(fixes, findings, "velocity does not change", velocities_out=out)
    for step in (_horizontal, _vertical, _late):
        vetted = step(fixes, windows)
        findings += vetted.findings
        if vetted.velocities_out:
            return replace(vetted, findings=findings, velocities_out=vetted.velocities_out + out)
        if vetted.fixes is not fixes:
            fixes = vetted.fixes
            windows = gather_windows(fixes) or windows
    return Vetted(fixes, findings, "velocity does not change", velocities_out=out)


def _leave_out(fixes: GnssFixSeries, code: str, text: str, hint: str, reason: str) -> Vetted:
    rows = fixes.has_velocity
    kept = drop(fixes, np.zeros(len(fixes), dtype=np.bool_), rows) if fixes.has_position.any() else fixes
    alone = int((rows & ~fixes.has_position).sum())
    return Vetted(kept, (Finding("warning", code, text, hint),), reason, alone, 0, int(rows.sum()))


def _never_filled(fixes: GnssFixSeries) -> Vetted | None:
    """Velocities that are zero in every row of a log whose positions move."""
    vel = fixes.vel_n[fixes.has_velocity]
    rows = np.flatnonzero(fixes.has_position)
    if vel.any() or len(rows) < 4:
        return None
    lla = fixes.lla[rows]
    span = np.ptp(lla[:, :2], axis=0) * 6.37e6
    if max(span) < 4 * _LEAST_MOTION:
        return None
    text = f"The velocity is 0 in all {len(vel)} rows while the positions move by {max(span):.0f} m: it was never filled."
    return _leave_out(fixes, "velocity-zero", text, "It is not used; filter.use_velocity = false says so too.", "never filled")


def _without_frozen(fixes: GnssFixSeries) -> tuple[GnssFixSeries, tuple[Finding, ...], int]:
    """Without runs of the same moving velocity, to the last digit."""
    rows = np.flatnonzero(fixes.has_velocity)
    vel = fixes.vel_n[rows]
    equal = np.concatenate([[False], (np.diff(vel, axis=0) == 0).all(axis=1)])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    frozen = np.zeros(len(fixes), dtype=np.bool_)
    for first, behind in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if behind - first >= _FROZEN_ROWS and np.linalg.norm(vel[first]) > _FROZEN_SPEED:
            frozen[rows[first:behind]] = True
    count = int(frozen.sum())
    if not count:
        return fixes, (), 0
    text = f"{count} of {len(rows)} velocities repeat the one before to the last digit while moving: their driver froze."
    finding = Finding("warning", "velocity-frozen", text, "They are left out; nothing need be set.")
    return drop(fixes, np.zeros(len(fixes), dtype=np.bool_), frozen), (finding,), count


def _both(windows: Windows, axes: tuple[int, ...]) -> Fit:
    parts = (part[:, axes].T.ravel() for part in (windows.moved, windows.summed, windows.changed))
    return fit(*parts, windows.apart)


def _moves(windows: Windows, axes: tuple[int, ...]) -> bool:
    """Whether there is enough motion along axes to judge velocities by."""
    size = float(np.sqrt(np.mean(np.sum(windows.moved[:, axes] ** 2, axis=1))))
    return size > max(_LEAST_MOTION, _TIMES_SCATTER * float(np.linalg.norm(windows.scatter[list(axes)])))


def _horizontal(fixes: GnssFixSeries, windows: Windows) -> Vetted:
    """Sign, axes, unit and scale of the horizontal parts."""
    if not _moves(windows, (0, 1)):
        return Vetted(fixes)
    found = _both(windows, (0, 1))
    fits = found.left < _FITS
    if fits and abs(found.scale - 1) < _SCALE + 3 * found.scale_std:
        return Vetted(fixes)
    turned = _best_turn(windows)
    if turned is not None and turned[2] < _FITS and (found.left > _CONTRADICTS or found.scale < 0):
        turn, words, left = turned
        matrix = np.eye(3)
        matrix[:2, :2] = turn
        text = f"Of the velocities {words}, by the motion of the positions ({100 * (1 - left):.1f} % of it explained)."
        finding = Finding(
            "warning", "velocity-axes", text, "They are turned; set input.fix.velocity_frame if it was told wrong."
        )
        cov = matrix @ fixes.cov_vel @ matrix.T
        return Vetted(replace(fixes, vel_n=fixes.vel_n @ matrix.T, cov_vel=cov), (finding,))
    if fits:
        return _scaled(fixes, found)
    if found.left < _CONTRADICTS:
        return Vetted(fixes)
    text = (
        f"The velocities explain only {100 * max(0.0, 1 - found.left):.0f} % of the motion of the positions, along no axes: "
        "velocities of the vehicle's own axes, a commanded velocity, or another time base."
    )
    hint = "They are not used; set input.fix.velocity_frame or input.fix.velocity_channel if the log holds true ones."
    return _leave_out(fixes, "velocity-contradicts", text, hint, "contradicts the motion of the fixes")


def _best_turn(windows: Windows) -> tuple[Floats, str, float] | None:
    """The turn of the horizontal axes after which velocities explain the motion best, with what it leaves."""
    best = None
    for turn, words in _TURNS:
        summed, changed = windows.summed[:, :2] @ turn.T, windows.changed[:, :2] @ turn.T
        found = fit(windows.moved[:, :2].T.ravel(), summed.T.ravel(), changed.T.ravel(), windows.apart)
        # a scale of -1 is another turn
        if found.scale > 0 and abs(found.scale - 1) < 0.2 and (best is None or found.left < best[2]):
            best = turn, words, found.left
    return best


def _scaled(fixes: GnssFixSeries, found: Fit) -> Vetted:
    """Velocities along the motion but of another size."""
    figure = f"{found.scale:.3f} +- {found.scale_std:.3f} times the motion of the positions"
    for factor, unit in _UNITS.items():
        for scale, words in ((factor, f"seem to be in {unit}"), (1 / factor, f"were divided as if they had been in {unit}")):
            if abs(found.scale / scale - 1) < 0.02 + 3 * found.scale_std / scale and found.left < _FITS:
                finding = Finding(
                    "warning",
                    "velocity-unit",
                    f"The velocities are {figure}: they {words}.",
                    "They are divided by that factor; convert the column to m/s where the log is made.",
                )
                return Vetted(replace(fixes, vel_n=fixes.vel_n / scale), (finding,))
    text = f"The velocities are {figure}: a wheel or a scale that nobody calibrated, or another unit."
    return _leave_out(
        fixes, "velocity-scale", text, "They are not used; convert them to m/s where the log is made.", "of another scale"
    )


def _vertical(fixes: GnssFixSeries, windows: Windows) -> Vetted:
    """The vertical part: never filled, or of the other sign."""
    down = fixes.vel_n[fixes.has_velocity, 2]
    if not down.any():
        text = "The vertical velocity is 0 in every row: it was never filled."
        finding = Finding("info", "velocity-no-vertical", text, "Only the horizontal parts are used.")
        return Vetted(_widened(fixes), (finding,))
    if not _moves_vertically(windows):
        return Vetted(fixes)
    found = _both(windows, (2,))
    flipped = found._replace(scale=-found.scale)
    if found.left < 2 * _FITS and abs(found.scale - 1) < 0.2 + 3 * found.scale_std:
        return Vetted(fixes)
    if flipped.left < 2 * _FITS and abs(flipped.scale - 1) < 0.2 + 3 * found.scale_std:
        text = "The vertical velocity has the opposite sign of the change of height: up was taken for down, or down for up."
        finding = Finding("warning", "velocity-vertical-sign", text, "It is turned; nothing need be set.")
        vel_n = fixes.vel_n * np.array([1.0, 1.0, -1.0])
        return Vetted(replace(fixes, vel_n=vel_n), (finding,))
    if found.left > _CONTRADICTS:
        text = f"The vertical velocity explains {100 * max(0.0, 1 - found.left):.0f} % of the changes of height."
        finding = Finding("warning", "velocity-vertical", text, "Only the horizontal parts are used.")
        return Vetted(_widened(fixes), (finding,))
    return Vetted(fixes)


def _moves_vertically(windows: Windows) -> bool:
    size = float(np.sqrt(np.mean(windows.moved[:, 2] ** 2)))
    return size > max(2.0, _TIMES_SCATTER * float(windows.scatter[2]))


def _widened(fixes: GnssFixSeries) -> GnssFixSeries:
    """The fixes with a vertical velocity that says nothing."""
    cov = np.where(np.isnan(fixes.cov_vel), np.eye(3) * 0.04, fixes.cov_vel)
    cov[:, 2, :] = cov[:, :, 2] = 0.0
    cov[:, 2, 2] = _WIDE
    cov[~fixes.has_velocity] = np.nan
    return replace(fixes, cov_vel=cov)


def _late(fixes: GnssFixSeries, windows: Windows) -> Vetted:
    """A delay of the velocities against the positions, where both halves of the log show the same."""
    if not _moves(windows, (0, 1)):
        return Vetted(fixes)
    whole = _both(windows, (0, 1))
    half = windows.start_s < np.median(windows.start_s)
    halves = [_both(_part(windows, rows), (0, 1)) for rows in (half, ~half)]
    apart = abs(halves[0].delay - halves[1].delay)
    agree = apart < 3 * np.hypot(halves[0].delay_std, halves[1].delay_std) + _LEAST_DELAY
    if whole.left > _FITS or not agree or abs(whole.delay) < max(_LEAST_DELAY, 5 * whole.delay_std):
        return Vetted(fixes)
    way = "behind" if whole.delay > 0 else "ahead of"
    text = (
        f"The velocities are {abs(whole.delay):.2f} +- {whole.delay_std:.2f} s {way} the positions, by the motion of both: the "
        "receiver smooths or predicts them."
    )
    finding = Finding("info", "velocity-delay", text, "They are taken at the time they belong to; nothing need be set.")
    return Vetted(_moved_in_time(fixes, whole.delay), (finding,))


def _part(windows: Windows, rows: NDArray[np.bool_]) -> Windows:
    moved, summed, changed, start_s = (part[rows] for part in windows[:4])
    return Windows(moved, summed, changed, start_s, windows.apart, windows.scatter)


def _moved_in_time(fixes: GnssFixSeries, delay: float) -> GnssFixSeries:
    """The fixes with velocities delay [s] earlier, as rows of their own where no position has that time."""
    rows = np.flatnonzero(fixes.has_velocity)
    earlier = fixes.t_ns[rows] - round(delay * 1e9)
    t_ns = np.union1d(fixes.t_ns[fixes.has_position], earlier)
    n = len(t_ns)
    lla, vel_n = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    cov_pos, cov_vel = np.full((n, 3, 3), np.nan), np.full((n, 3, 3), np.nan)
    status = np.zeros(n, dtype=np.int8)
    at_p, at_v = np.searchsorted(t_ns, fixes.t_ns[fixes.has_position]), np.searchsorted(t_ns, earlier)
    vel_n[at_v], cov_vel[at_v], status[at_v] = fixes.vel_n[rows], fixes.cov_vel[rows], fixes.status[rows]
    placed = fixes.has_position
    lla[at_p], cov_pos[at_p], status[at_p] = fixes.lla[placed], fixes.cov_pos[placed], fixes.status[placed]
    return GnssFixSeries(t_ns, lla, vel_n, cov_pos, cov_vel, status)
