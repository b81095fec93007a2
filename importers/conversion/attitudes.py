"""Rows of an attitude sensor as a series: direction, axes, boresight, frame and accuracy settled."""

import numpy as np

from importers.roles.sources import Joined, account
from importers.rows.screening import Screening
from importers.rows.tables import Rows, drop_absurd
from importers.settings import AttitudeInput
from navreplay.geodesy.rotation import (
    frd_from_flu_body,
    frd_ned_from_flu_enu,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_multiply,
)
from navreplay.geodesy.time_scales import earth_rotation_angle
from navreplay.timeline import AttitudeFrame, AttitudeSeries, ChannelUse, Floats, LogError, Times

__all__ = ["convert_attitude", "unit_quaternions"]

_NEAR_UNIT = 0.1
_ARCSEC = np.pi / 180 / 3600
_NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def convert_attitude(joined: Joined, settings: AttitudeInput) -> tuple[AttitudeSeries, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The series, its accounting, and what was assumed. Raises LogError where no row is usable."""
    rows, name = joined.rows, joined.name
    if rows.q is None:
        raise LogError(f"{name}: holds no attitude")
    frame = settings.frame if settings.frame != "auto" else rows.q_frame or "navigation"
    if settings.heading_only and frame != "navigation":
        raise LogError(f"{name}: input.attitude.heading_only tells a heading against north; it needs frame = 'navigation'")
    q = unit_quaternions(rows.q)
    screening = Screening(name, len(q))
    screening.reject(~np.isfinite(q).all(axis=1), "not finite or not a quaternion")
    screening.reject(rows.q_missing if rows.q_missing is not None else np.zeros(len(q), dtype=bool), "no orientation")
    order = screening.order(joined.t_ns)
    if len(order) == 0:
        raise LogError(f"{name}: none of its {len(q)} attitudes is usable: {screening.rejected(slice(None))}")
    t_ns = joined.t_ns[order]
    turned, cov = _turn(rows, q[order], None if rows.cov_att is None else rows.cov_att[order], frame, settings)
    notes = [f"{name}: its attitudes are taken as those of the body in {_FRAMES[frame]}"]
    if settings.frame == "auto" and rows.q_frame is None:
        notes[0] += " (input.attitude.frame says otherwise where they are not)"
    if frame == "inertial":
        turned, cov = _stop_the_earth(t_ns, turned, cov, settings.ut1_utc_s)
    kind: AttitudeFrame = "navigation" if frame == "navigation" else "earth"
    series = AttitudeSeries(t_ns, turned, cov, kind, settings.heading_only)
    return series, account(joined, screening), (*joined.notes, *notes, *screening.notes)


_FRAMES = {
    "navigation": "north, east, down",
    "earth": "Earth-fixed axes",
    "inertial": "axes that do not turn with the Earth (equator and origin of longitude of date)",
}


def unit_quaternions(q: Floats) -> Floats:
    """(n, 4) of unit length; NaN for what is not finite or far from it."""
    q = drop_absurd(q)
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    usable = np.abs(norm - 1) < _NEAR_UNIT
    return np.where(usable, q / np.where(usable, norm, 1.0), np.nan)


def _turn(rows: Rows, q: Floats, cov: Floats | None, frame: str, settings: AttitudeInput) -> tuple[Floats, Floats]:
    """q (n, 4) body to frame and its covariance (n, 3, 3) about the axes of frame, NaN where unknown."""
    if settings.direction == "frame_to_body":
        q = quat_conjugate(q)
    cov = np.full((len(q), 3, 3), np.nan) if cov is None else _known(cov)
    if rows.ros_attitude and settings.convention == "ros":
        if frame == "navigation":
            q, cov = frd_ned_from_flu_enu(q), _NED_OF_ENU @ cov @ _NED_OF_ENU.T
        else:
            q = frd_from_flu_body(q)
    if settings.sigma_arcsec is not None:
        c_fs = matrix_from_quat(q)
        cov = c_fs @ np.diag(np.square(np.array(settings.sigma_arcsec) * _ARCSEC)) @ np.swapaxes(c_fs, 1, 2)
    boresight = quat_from_euler(*np.radians(settings.boresight_deg))
    return quat_multiply(q, np.broadcast_to(quat_conjugate(boresight), q.shape)), cov


def _known(cov: Floats) -> Floats:
    """Covariances (n, 3, 3), all NaN where the diagonal is not finite and positive: zero means unknown."""
    cov = drop_absurd(cov)
    unknown = ~((np.diagonal(cov, axis1=1, axis2=2) > 0).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)))
    return np.where(unknown[:, None, None], np.nan, (cov + np.swapaxes(cov, 1, 2)) / 2)


def _stop_the_earth(t_ns: Times, q_ib: Floats, cov: Floats, ut1_utc: float) -> tuple[Floats, Floats]:
    """From inertial to Earth-fixed axes."""
    half = earth_rotation_angle(t_ns, ut1_utc) / 2
    zero = np.zeros_like(half)
    q_ei = np.stack([np.cos(half), zero, zero, -np.sin(half)], axis=-1)
    c_ei = matrix_from_quat(q_ei)
    return quat_multiply(q_ei, q_ib), c_ei @ cov @ np.swapaxes(c_ei, 1, 2)
