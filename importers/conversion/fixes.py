"""GNSS rows as a series: positions and velocities of the antenna in NED with believable covariances."""

from dataclasses import replace

import numpy as np

from importers.conversion.position_units import mend_angles
from importers.conversion.velocity_frame import is_of_a_vehicle, turn_velocities
from importers.roles.sources import Joined, account
from importers.rows.screening import Screening
from importers.rows.tables import NO_FIX, Frame, Rows
from importers.settings import FixInput
from navreplay.timeline import ChannelUse, FixStatus, Floats, GnssFixSeries, LogError, Times

__all__ = ["clean_covariance", "convert_fixes", "screen_positions"]

_FARTHEST = (np.pi / 2, 2 * np.pi, 1e8)
_UNKNOWN_VARIANCE = 1e12
_SAME_EPOCH_NS = 10**6
_ORDER_OF_STATUS = ("unknown", "single", "differential", "float", "fixed")
_RANK = {FixStatus.DEAD_RECKONING: 1} | {FixStatus[name.upper()]: rank for rank, name in enumerate(_ORDER_OF_STATUS)}


def clean_covariance(name: str, cov: Floats | None, n: int) -> tuple[Floats, tuple[str, ...]]:
    """Covariances (n, 3, 3) that are positive definite or NaN for unknown, and sentences on those that were neither.

    A zero diagonal means unknown; with a negative one the whole matrix is unknown; impossible correlations are dropped.
    """
    if cov is None:
        return np.full((n, 3, 3), np.nan), ()
    cov = (cov + np.swapaxes(cov, 1, 2)) / 2
    diagonal = np.diagonal(cov, axis1=1, axis2=2)
    finite = (np.abs(cov) < _UNKNOWN_VARIANCE).all(axis=(1, 2))
    negative = finite & (diagonal < 0).any(axis=1)
    zero = finite & ~negative & (diagonal == 0).any(axis=1)
    known = finite & ~negative & ~zero
    impossible = known.copy()
    impossible[known] = np.linalg.eigvalsh(cov[known]).min(axis=1) <= 0
    cov[impossible] *= np.eye(3)
    cov[~known] = np.nan
    told = (
        (zero, "have a zero on the diagonal of their covariance, which is taken as unknown"),
        (negative, "have a negative variance; their covariance is taken as unknown"),
        (impossible, "have correlations beyond one; only their variances are used"),
    )
    return cov, tuple(f"{name}: {int(rows.sum())} of {n} rows {text}" for rows, text in told if rows.any())


def screen_positions(screening: Screening, rows: Rows, min_rank: int = 0) -> None:
    """Rejects rows without a fix or with an impossible position; rows that hold a velocity may lack the position."""
    n = len(screening.kept)
    lla = np.full((n, 3), np.nan) if rows.lla is None else rows.lla
    vel = np.full((n, 3), np.nan) if rows.vel is None else rows.vel
    if rows.status is not None:
        screening.reject(rows.status == NO_FIX, "no fix")
        rank = np.array([_RANK.get(FixStatus(code), 0) if code >= 0 else 0 for code in range(len(FixStatus))])[
            np.maximum(rows.status, 0)
        ]
        screening.reject(rank < min_rank, "status below min_status")
    without = np.isnan(lla).all(axis=1)
    screening.reject(~np.isfinite(lla).all(axis=1) & ~(without & np.isfinite(vel).all(axis=1)), "not finite")
    screening.reject(~without & (np.abs(lla) > _FARTHEST).any(axis=1), "no such position")
    screening.reject((lla[:, 0] == 0) & (lla[:, 1] == 0), "position 0, 0")


def convert_fixes(
    position: Joined | None, velocity: Joined | None, settings: FixInput
) -> tuple[GnssFixSeries, tuple[ChannelUse, ...], tuple[str, ...], dict[str, str]]:
    """The series, its accounting, what was assumed, and the settings recognised; velocities of another channel join the fix
    within a millisecond, or become rows of their own. Raises LogError where no row is usable."""
    uses: list[ChannelUse] = []
    notes: list[str] = []
    recognised: dict[str, str] = {}
    parts: list[GnssFixSeries] = []
    for joined in (position, velocity):
        if joined is None:
            continue
        joined = _in_degrees(joined)
        screening = Screening(joined.name, len(joined.t_ns))
        screen_positions(screening, joined.rows, _ORDER_OF_STATUS.index(settings.min_status))
        order = screening.order(joined.t_ns)
        if len(order) == 0 and joined is position:
            why = ", ".join(f"{count} {reason}" for reason, count in screening.rejected(slice(None)).items())
            raise LogError(f"{joined.name}: none of its {len(joined.t_ns)} fixes is usable ({why})")
        series, told, frame = _build(joined, order, settings, parts[0] if parts else None)
        notes += [*joined.notes, *screening.notes, *told]
        if series is None:
            uses += [_unused(use) for use in account(joined, screening)]
        else:
            parts.append(series)
            if frame is not None and settings.velocity_frame == "auto":
                recognised["input.fix.velocity_frame"] = frame
            uses += account(joined, screening)
    if not parts:
        raise LogError("neither positions nor velocities of a GNSS receiver are usable")
    return (parts[0] if len(parts) == 1 else _merge(*parts)), tuple(uses), tuple(notes), recognised


def _in_degrees(joined: Joined) -> Joined:
    """The rows of messages with their positions in the unit that they are in, and told so."""
    if joined.rows.lla is None or not any(source.channel.encoding != "text" for source in joined.sources):
        return joined
    lla, note = mend_angles(joined.name, joined.t_ns, joined.rows.lla)
    return replace(joined, rows=replace(joined.rows, lla=lla), notes=(*joined.notes, note)) if note else joined


def _unused(use: ChannelUse) -> ChannelUse:
    return ChannelUse(use.name, use.file, use.type, "unused", 0, 0)


def _build(
    joined: Joined, order: np.ndarray, settings: FixInput, positions: GnssFixSeries | None
) -> tuple[GnssFixSeries | None, tuple[str, ...], Frame | None]:
    """One channel as a series, what was assumed, and the frame of its velocities; no series where that cannot be recognised."""
    rows, n = joined.rows, len(order)
    t_ns = joined.t_ns[order]
    lla = np.full((n, 3), np.nan) if rows.lla is None else rows.lla[order]
    notes: list[str] = []
    if settings.height == "msl" and settings.geoid_separation_m is not None and rows.lla is not None:
        lla = lla + [0.0, 0.0, settings.geoid_separation_m]
        notes.append(f"{joined.name}: {settings.geoid_separation_m:g} m were added to its heights above mean sea level")
    cov_pos, told = clean_covariance(f"{joined.name} position", None if rows.cov_pos is None else rows.cov_pos[order], n)
    notes += told
    vel, cov_vel, found = np.full((n, 3), np.nan), None, None
    if rows.vel is not None:
        path = (
            (t_ns, lla)
            if positions is None
            else (positions.t_ns[positions.has_position], positions.lla[positions.has_position])
        )
        frame = rows.vel_frame if settings.velocity_frame == "auto" or rows.vel_frame != "auto" else settings.velocity_frame
        cov = None if rows.cov_vel is None else rows.cov_vel[order]
        own = frame == "auto" and is_of_a_vehicle(rows.vel[order])
        turned = None if own else turn_velocities(joined.name, t_ns, rows.vel[order], cov, frame, *path)
        if turned is None:
            why = _COMMANDED if own else _FOREIGN
            if settings.velocity_channel is not None:
                raise LogError(f"{joined.name}: {why}; set input.fix.velocity_frame, or leave the channel out")
            return None, (f"{joined.name}: {why}, so it is not used",), None
        vel, cov_vel, found, told = turned
        notes += told
    cov_vel, told = clean_covariance(f"{joined.name} velocity", cov_vel, n)
    status = np.zeros(n, dtype=np.int8) if rows.status is None else rows.status[order].astype(np.int8)
    return (GnssFixSeries(t_ns, lla, vel, cov_pos, cov_vel, status) if n else None), (*notes, *told), found


_COMMANDED = "one of the horizontal parts of its velocity is exactly 0 while the other moves, as of wheels or of a command"
_FOREIGN = "its velocities agree with the motion of the fixes in neither ENU nor NED (a vehicle-frame velocity?)"


def _merge(position: GnssFixSeries, velocity: GnssFixSeries) -> GnssFixSeries:
    nearest = _nearest(position.t_ns, velocity.t_ns)
    same = np.abs(position.t_ns[nearest] - velocity.t_ns) <= _SAME_EPOCH_NS
    vel, cov_vel = position.vel_n.copy(), position.cov_vel.copy()
    vel[nearest[same]] = velocity.vel_n[same]
    cov_vel[nearest[same]] = velocity.cov_vel[same]
    alone = ~same
    t_ns = np.concatenate([position.t_ns, velocity.t_ns[alone]])
    order = np.argsort(t_ns, kind="stable")
    return GnssFixSeries(
        t_ns[order],
        np.concatenate([position.lla, velocity.lla[alone]])[order],
        np.concatenate([vel, velocity.vel_n[alone]])[order],
        np.concatenate([position.cov_pos, velocity.cov_pos[alone]])[order],
        np.concatenate([cov_vel, velocity.cov_vel[alone]])[order],
        np.concatenate([position.status, velocity.status[alone]])[order],
    )


def _nearest(times: Times, wanted: Times) -> np.ndarray:
    after = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    return np.where(wanted - times[before] <= times[after] - wanted, before, after)
