"""The axes of an IMU that nobody told and that gravity refutes: found among all 24 by the way up and the way forward.

Gravity leaves four of them. Changes of speed tell these apart where they are felt along one clearly; else any of the four
will do, since the heading at the start is found by itself.
"""

from dataclasses import replace

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import match_forward, match_yaw
from importers.rows.axes import axes_matrix
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries

__all__ = ["turn_upright"]

_UP = 0.7
_LEAST_FORCE = 5.0
_SURE = 0.7
_TURNS = 0.6
_ASKEW = np.radians(25.0)
_OPPOSITE = {"f": "b", "b": "f", "r": "l", "l": "r", "u": "d", "d": "u"}


def turn_upright(imu: ImuSeries, fixes: GnssFixSeries | None, axes: str) -> tuple[ImuSeries, str, Finding] | None:
    """The IMU in axes whose z points down, their letters, and what was found; None where gravity fits the axes assumed, or
    lies on none of them."""
    force = np.median(imu.accel, axis=0)
    size = float(np.linalg.norm(force))
    place = int(np.argmax(np.abs(force)))
    down = place == 2 and force[2] < 0
    if size < _LEAST_FORCE or down or abs(float(force[place])) < _UP * size:
        return None
    yaw = None if fixes is None or not fixes.has_position.any() else match_yaw(imu, fixes)
    if yaw is not None and yaw.slope < 0 and abs(yaw.correlation) > _TURNS:
        return None  # forces and turns contradict each other, which no mounting mends
    turned, letters = _turned(imu, axes, _to_level(place, float(force[place])))
    ahead = _forward(turned, fixes, 0.0 if yaw is None or abs(yaw.correlation) < _SURE else yaw.offset_s)
    quarter = 0 if ahead is None else round(ahead / (np.pi / 2))
    if quarter:
        turned, letters = _turned(turned, letters, _about_down(-quarter * np.pi / 2))
    text = f"Gravity says that the IMU's axes are not {axes}, as was assumed, but {letters}" + (
        ", if its x axis points as far forward as it can; changes of speed do not tell." if ahead is None else "."
    )
    hint = f"They are taken so; input.imu.axes = '{letters}' says so too."
    return turned, letters, Finding("warning", "axes-found", text, hint)


def _to_level(place: int, along: float) -> Floats:
    """The rotation that brings the axis of gravity down: about the one forward where that can be."""
    up = np.sign(along)
    if place == 2:
        return np.diag([1.0, -1.0, -1.0])
    if place == 1:
        return np.array([[1.0, 0, 0], [0, 0, up], [0, -up, 0]])
    return np.array([[0, 0, up], [0, 1.0, 0], [-up, 0, 0]])


def _about_down(angle: float) -> Floats:
    c, s = np.round(np.cos(angle)), np.round(np.sin(angle))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _turned(imu: ImuSeries, axes: str, turn: Floats) -> tuple[ImuSeries, str]:
    """The IMU, and the letters of its sensor's axes, after a turn of what was taken for the vehicle."""
    matrix = turn @ axes_matrix(axes)
    letters = "".join("frd"[int(np.argmax(np.abs(column)))] for column in matrix.T)
    signs = matrix[np.argmax(np.abs(matrix), axis=0), range(3)]
    named = "".join(letter if sign > 0 else _OPPOSITE[letter] for letter, sign in zip(letters, signs, strict=True))
    return replace(imu, gyro=imu.gyro @ turn.T, accel=imu.accel @ turn.T), named


def _forward(imu: ImuSeries, fixes: GnssFixSeries | None, offset_s: float) -> float | None:
    """The direction in which changes of speed are felt, from x to the right [rad]; None where they do not tell, or it lies
    between two axes."""
    match = None if fixes is None or not fixes.has_position.any() else match_forward(imu, fixes, offset_s)
    if match is None or match.correlation < _SURE:
        return None
    off = (match.angle + np.pi / 4) % (np.pi / 2) - np.pi / 4
    return match.angle if abs(off) < _ASKEW else None
