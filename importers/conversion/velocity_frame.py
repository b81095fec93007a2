"""Velocities of an unsaid frame: told apart by comparing them with the motion of the positions, and turned to NED."""

import numpy as np

from importers.rows.tables import Frame
from navreplay.geodesy.earth import ecef_from_lla, lla_from_ecef, matrix_en
from navreplay.timeline import Floats, Times

__all__ = ["interpolate_lla", "is_of_a_vehicle", "turn_velocities"]

_SPAN_NS = 10**9
_LEAST_SPEED = 0.5
_LEAST_MOVING = 20
_AGREEMENT = 0.5
_NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def is_of_a_vehicle(vel: Floats) -> bool:
    """Whether velocities (n, 3) have one horizontal part that is exactly 0 while the other moves: those of wheels or commanded
    ones, along a vehicle's own axes. A receiver's are never that, whatever the way it is driven."""
    moving = np.isfinite(vel).all(axis=1) & (np.abs(vel[:, :2]).max(axis=1) > _LEAST_SPEED)
    return bool(moving.sum() >= _LEAST_MOVING and (vel[moving, :2] == 0).all(axis=0).any())


def interpolate_lla(t_ns: Times, path_t_ns: Times, path_lla: Floats) -> Floats:
    """Positions (n, 3) at times (n,) on a path, straight between its points and held beyond its ends."""
    seconds, path_seconds = (t_ns - path_t_ns[0]) / 1e9, (path_t_ns - path_t_ns[0]) / 1e9
    ecef = ecef_from_lla(path_lla)
    return lla_from_ecef(np.column_stack([np.interp(seconds, path_seconds, ecef[:, i]) for i in range(3)]))


def turn_velocities(
    name: str, t_ns: Times, vel: Floats, cov: Floats | None, frame: Frame, path_t_ns: Times, path_lla: Floats
) -> tuple[Floats, Floats | None, Frame, tuple[str, ...]] | None:
    """Velocities (n, 3) and covariances (n, 3, 3) in NED, the frame they were in, and what was assumed; None where it cannot
    be recognised."""
    notes: tuple[str, ...] = ()
    known = np.isfinite(path_lla).all(axis=1)
    path_t_ns, path_lla = path_t_ns[known], path_lla[known]
    if frame == "auto":
        found, note = _recognise(name, t_ns, vel, path_t_ns, path_lla)
        if found is None:
            return None
        frame, notes = found, (note,)
    if frame == "ned":
        return vel, cov, frame, notes
    if frame == "enu":
        turn = np.broadcast_to(_NED_OF_ENU, (len(vel), 3, 3))
    else:
        if len(path_t_ns) == 0:
            return None
        lla = interpolate_lla(t_ns, path_t_ns, path_lla)
        turn = np.swapaxes(matrix_en(lla[:, 0], lla[:, 1]), 1, 2)
    turned = np.einsum("nij,nj->ni", turn, vel)
    return turned, None if cov is None else turn @ cov @ np.swapaxes(turn, 1, 2), frame, notes


def _recognise(name: str, t_ns: Times, vel: Floats, path_t_ns: Times, path_lla: Floats) -> tuple[Frame | None, str]:
    """The frame, ENU or NED, in which velocities agree with the differences of the positions around them."""
    assumed: tuple[Frame, str] = ("enu", f"{name}: velocities are taken as east, north, up (too little motion to verify it)")
    if len(path_t_ns) < 3:
        return assumed
    inside = (t_ns - _SPAN_NS >= path_t_ns[0]) & (t_ns + _SPAN_NS <= path_t_ns[-1]) & np.isfinite(vel).all(axis=1)
    if inside.sum() < 3:
        return assumed
    ends = [interpolate_lla(t_ns[inside] + step, path_t_ns, path_lla) for step in (-_SPAN_NS, _SPAN_NS)]
    c_en = matrix_en(ends[0][:, 0], ends[0][:, 1])
    moved = np.einsum("nji,nj->ni", c_en, ecef_from_lla(ends[1]) - ecef_from_lla(ends[0])) / (2e-9 * _SPAN_NS)
    moving = np.linalg.norm(moved[:, :2], axis=1) > _LEAST_SPEED
    if moving.sum() < 3:
        return assumed
    moved, seen = moved[moving, :2], vel[inside][moving]
    misfit = {
        "ned": float(np.median(np.linalg.norm(seen[:, [0, 1]] - moved, axis=1))),
        "enu": float(np.median(np.linalg.norm(seen[:, [1, 0]] - moved, axis=1))),
    }
    best: Frame = "ned" if misfit["ned"] < misfit["enu"] else "enu"
    speed = float(np.median(np.linalg.norm(moved, axis=1)))
    if misfit[best] > _AGREEMENT * speed:
        return None, ""
    words = "north, east, down" if best == "ned" else "east, north, up"
    return best, f"{name}: velocities were recognised as {words} by the motion of the fixes"
