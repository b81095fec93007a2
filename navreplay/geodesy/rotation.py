"""Rotations: quaternions (scalar first), matrices, Euler angles, rotation vectors; all broadcast over leading dimensions.

Euler angles are roll, pitch, yaw: body to navigation is Rz(yaw) Ry(pitch) Rx(roll). Formulas: Diebel, Representing Attitude
(2006); Markley and Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014), chapter 2.
"""

from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from navreplay.timeline import Floats

__all__ = [
    "enu_from_ned",
    "euler_from_quat",
    "flu_from_frd",
    "frd_from_flu_body",
    "frd_ned_from_flu_enu",
    "matrix_from_euler",
    "matrix_from_quat",
    "quat_conjugate",
    "quat_from_euler",
    "quat_from_matrix",
    "quat_from_rotvec",
    "quat_multiply",
    "rotvec_from_quat",
    "scalar_first_from_last",
    "scalar_last_from_first",
    "skew",
    "wrap_angle",
]

_ROOT_HALF = np.sqrt(0.5)
_NED_FROM_ENU = np.array([0.0, _ROOT_HALF, _ROOT_HALF, 0.0])
"""Half a turn about the line between east and north: exchanges the horizontal axes and turns the vertical one."""
_FLU_FROM_FRD = np.array([0.0, 1.0, 0.0, 0.0])


def skew(vector: Floats) -> Floats:
    """Matrix (..., 3, 3) of the cross product with vector (..., 3) from the left."""
    vector = np.asarray(vector, dtype=np.float64)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def wrap_angle(angle: ArrayLike) -> Floats:
    """Angle (...) [rad] brought into [-pi, pi)."""
    return np.asarray((np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi)


def quat_multiply(p: Floats, q: Floats) -> Floats:
    """Hamilton product (..., 4); as rotations, q first, then p."""
    if np.ndim(p) == np.ndim(q) == 1:
        return np.array(_multiply(*np.asarray(p).tolist(), *np.asarray(q).tolist()))
    pw, px, py, pz = np.moveaxis(np.asarray(p, dtype=np.float64), -1, 0)
    qw, qx, qy, qz = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    return np.stack(_multiply(pw, px, py, pz, qw, qx, qy, qz), axis=-1)


def quat_conjugate(q: Floats) -> Floats:
    """Inverse (..., 4) of unit quaternions (..., 4)."""
    return np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def quat_from_rotvec(rotvec: Floats) -> Floats:
    """Unit quaternion (..., 4) of rotation vectors (..., 3) [rad]."""
    rotvec = np.asarray(rotvec, dtype=np.float64)
    if rotvec.ndim == 1:
        x, y, z = rotvec.tolist()
        half = hypot(x, y, z) / 2
        scale = sin(half) / half / 2 if half > 0 else 0.5
        return np.array([cos(half), scale * x, scale * y, scale * z])
    angle = np.linalg.norm(rotvec, axis=-1, keepdims=True)
    vector = 0.5 * np.sinc(angle / (2 * np.pi)) * rotvec
    return np.concatenate([np.cos(angle / 2), vector], axis=-1)


def rotvec_from_quat(q: Floats) -> Floats:
    """Rotation vector (..., 3) [rad] of at most half a turn of unit quaternions (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    if q.ndim == 1:
        w, x, y, z = q.tolist() if q[0] >= 0 else (-q).tolist()
        length = hypot(x, y, z)
        scale = 2 * atan2(length, w) / length if length > 0 else 2.0
        return np.array([scale * x, scale * y, scale * z])
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    return np.asarray(2 * q[..., 1:] / np.sinc(half / np.pi))


def matrix_from_quat(q: Floats) -> Floats:
    """Rotation matrix (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    if q.ndim == 1:
        return np.array(_rows(*q.tolist()))
    return np.stack([np.stack(row, axis=-1) for row in _rows(*np.moveaxis(q, -1, 0))], axis=-2)


def quat_from_matrix(matrix: Floats) -> Floats:
    """Unit quaternion (..., 4) with non-negative scalar of rotation matrices (..., 3, 3).

    Of the four algebraic solutions the one with the largest pivot is taken, row by row (Markley and Crassidis, 2.135).
    """
    m = np.asarray(matrix, dtype=np.float64)
    d0, d1, d2 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    candidates = np.stack(
        [
            np.stack([1 + d0 + d1 + d2, a, b, c], axis=-1),
            np.stack([a, 1 + d0 - d1 - d2, xy, xz], axis=-1),
            np.stack([b, xy, 1 - d0 + d1 - d2, yz], axis=-1),
            np.stack([c, xz, yz, 1 - d0 - d1 + d2], axis=-1),
        ],
        axis=-2,
    )
    pivot = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, pivot[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0, -q, q))


def quat_from_euler(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Floats:
    """q_nb (..., 4) of roll, pitch, yaw (...) [rad]."""
    half = [np.asarray(angle, dtype=np.float64) / 2 for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = [np.cos(h) for h in half], [np.sin(h) for h in half]
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def euler_from_quat(q: Floats) -> Floats:
    """Roll, pitch, yaw (..., 3) [rad] of q_nb (..., 4); yaw in [-pi, pi]."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - x * z), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def matrix_from_euler(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Floats:
    """C_nb (..., 3, 3) of roll, pitch, yaw (...) [rad]."""
    return matrix_from_quat(quat_from_euler(roll, pitch, yaw))


def scalar_first_from_last(q: Floats) -> Floats:
    """(..., 4) w, x, y, z from x, y, z, w."""
    return np.roll(np.asarray(q, dtype=np.float64), 1, axis=-1)


def scalar_last_from_first(q: Floats) -> Floats:
    """(..., 4) x, y, z, w from w, x, y, z."""
    return np.roll(np.asarray(q, dtype=np.float64), -1, axis=-1)


def flu_from_frd(vector: Floats) -> Floats:
    """Forward-left-up components (..., 3) of forward-right-down ones; its own inverse."""
    return np.asarray(vector, dtype=np.float64) * np.array([1.0, -1.0, -1.0])


def enu_from_ned(vector: Floats) -> Floats:
    """East-north-up components (..., 3) of north-east-down ones; its own inverse."""
    return np.asarray(vector, dtype=np.float64)[..., [1, 0, 2]] * np.array([1.0, 1.0, -1.0])


def frd_ned_from_flu_enu(q: Floats) -> Floats:
    """q_nb (..., 4), FRD body in NED, from the quaternion of an FLU body in ENU (as ROS REP 103 has it); its own inverse."""
    return quat_multiply(quat_multiply(_NED_FROM_ENU, q), _FLU_FROM_FRD)


def frd_from_flu_body(q: Floats) -> Floats:
    """Quaternion (..., 4) to any axes of an FRD body, from that of the FLU body; its own inverse but for the sign."""
    return quat_multiply(q, np.broadcast_to(_FLU_FROM_FRD, np.shape(q)))


# Written once for floats and arrays: single quaternions, as filters have them at epochs, go through plain floats, which is
# many times faster than broadcasting.


def _multiply(pw: Any, px: Any, py: Any, pz: Any, qw: Any, qx: Any, qy: Any, qz: Any) -> list[Any]:
    return [
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    ]


def _rows(w: Any, x: Any, y: Any, z: Any) -> list[list[Any]]:
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
