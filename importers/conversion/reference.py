"""Rows of a reference as a trajectory."""

import numpy as np

from importers.conversion.attitudes import unit_quaternions
from importers.conversion.fixes import clean_covariance, screen_positions
from importers.conversion.velocity_frame import turn_velocities
from importers.roles.sources import Joined, account
from importers.rows.screening import Screening
from importers.rows.tables import Rows, drop_absurd
from importers.settings import ReferenceInput
from navreplay.geodesy.earth import ecef_from_lla, lla_from_ecef, matrix_en
from navreplay.geodesy.rotation import frd_ned_from_flu_enu
from navreplay.timeline import ChannelUse, FixStatus, Floats, GnssFixSeries, LogError, Times, Trajectory

__all__ = ["convert_reference", "reference_from_fixes"]

_NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def convert_reference(joined: Joined, settings: ReferenceInput) -> tuple[Trajectory, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The trajectory, its accounting, and what was assumed. Raises LogError where no row is usable or an origin is missing."""
    rows, n = joined.rows, len(joined.t_ns)
    lla = rows.lla if rows.lla is not None else _place(joined, settings)
    notes = [*joined.notes]
    screening = Screening(joined.name, n)
    screen_positions(screening, Rows(lla=lla, status=rows.status))
    _reject_status(screening, rows.status, settings, joined.name)
    order = screening.order(joined.t_ns)
    if settings.max_speed_jump_mps is not None:
        order = _reject_jumps(screening, order, joined.t_ns, lla, settings.max_speed_jump_mps)
    if len(order) == 0:
        raise LogError(f"{joined.name}: none of its {n} rows can serve as reference: {screening.rejected(slice(None))}")
    t_ns, lla = joined.t_ns[order], lla[order]
    vel = np.full((len(order), 3), np.nan)
    if rows.vel is not None:
        turned = turn_velocities(joined.name, t_ns, rows.vel[order], None, rows.vel_frame, t_ns, lla)
        vel = vel if turned is None else turned[0]
        notes += () if turned is None else turned[3]
    q_nb = np.full((len(order), 4), np.nan) if rows.q is None else _attitude(rows, settings.convention)[order]
    cov, told = clean_covariance(joined.name, None if rows.cov_pos is None else rows.cov_pos[order], len(order))
    return Trajectory(t_ns, lla, vel, q_nb, cov), account(joined, screening), (*notes, *screening.notes, *told)


def reference_from_fixes(fixes: GnssFixSeries, settings: ReferenceInput) -> Trajectory:
    """The fixes themselves as a reference, for assessments in which some are withheld from the filter. Raises LogError."""
    chosen = fixes.has_position
    if settings.status:
        chosen = chosen & np.isin(fixes.status, [_status_code(name) for name in settings.status])
    if not chosen.any():
        raise LogError(f"reference: none of the {len(fixes)} fixes has a status of {', '.join(settings.status) or 'any kind'}")
    q_nb = np.full((int(chosen.sum()), 4), np.nan)
    return Trajectory(fixes.t_ns[chosen], fixes.lla[chosen], fixes.vel_n[chosen], q_nb, fixes.cov_pos[chosen])


def _attitude(rows: Rows, convention: str) -> Floats:
    """q_nb (n, 4) of unit length, NaN where the log has none."""
    assert rows.q is not None
    q = unit_quaternions(rows.q)
    return frd_ned_from_flu_enu(q) if rows.ros_attitude and convention == "ros" else q


def _place(joined: Joined, settings: ReferenceInput) -> Floats:
    """Positions (n, 3) [rad, rad, m] of local east, north, up ones."""
    if joined.rows.local is None:
        raise LogError(f"{joined.name}: holds no positions, so it cannot serve as reference")
    if settings.origin_deg_m is None:
        raise LogError(
            f"{joined.name}: its positions are local; set input.reference.origin_deg_m to the latitude [deg], longitude [deg] "
            "and height [m] of their origin"
        )
    origin = np.array(settings.origin_deg_m) * [np.pi / 180, np.pi / 180, 1.0]
    to_earth = matrix_en(origin[0], origin[1]) @ _NED_OF_ENU
    return lla_from_ecef(ecef_from_lla(origin) + drop_absurd(joined.rows.local) @ to_earth.T)


def _status_code(name: str) -> int:
    return int(FixStatus[name.upper()]) if name != "none" else -1


def _reject_status(screening: Screening, status: np.ndarray | None, settings: ReferenceInput, name: str) -> None:
    if not settings.status:
        return
    if status is None:
        raise LogError(f"{name}: has no status, so input.reference.status = {list(settings.status)} would reject all of it")
    wanted = [_status_code(kind) for kind in settings.status]
    screening.reject(~np.isin(status, wanted), f"status not {' or '.join(settings.status)}")


def _reject_jumps(screening: Screening, order: np.ndarray, t_ns: Times, lla: Floats, limit: float) -> np.ndarray:
    """Rejects the rows on both sides of a step whose implied speed exceeds the limit; returns the order without them."""
    steps = np.linalg.norm(np.diff(ecef_from_lla(lla[order]), axis=0), axis=1)
    fast = np.flatnonzero(steps > limit * np.diff(t_ns[order]) / 1e9)
    bad = np.zeros(len(t_ns), dtype=bool)
    bad[order[fast]] = True
    bad[order[fast + 1]] = True
    screening.reject(bad, "beside a speed jump")
    return np.asarray(order[~bad[order]])
