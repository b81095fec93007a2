"""Whether measured attitudes turn as the gyros do: their direction, their axes, and whether their frame is the Earth's."""

from typing import NamedTuple

import numpy as np

from importers.findings import Finding
from navreplay.geodesy.earth import EARTH_RATE
from navreplay.geodesy.rotation import matrix_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat
from navreplay.timeline import AttitudeSeries, Floats, ImuSeries

__all__ = ["check_attitudes"]

_SPAN_S = 1.0
_LEAST_PAIRS = 5
_LEAST_TURN = (0.002, 0.05)
"""Root mean square turn [rad] between the compared attitudes from which their axes can be told, at the best and at the worst;
in between it is many times their standard deviation."""
_MANY = 30.0
_BAD_SHARE = 0.5
_GOOD_SHARE = 0.2


class _Pairs(NamedTuple):
    """Attitudes about a second apart. before, after: (m, 4). gyro: (m, 3) what the gyros turned between them [rad], and
    seconds (m,)."""

    before: Floats
    after: Floats
    gyro: Floats
    seconds: Floats


def check_attitudes(attitude: AttitudeSeries, imu: ImuSeries) -> list[Finding]:
    """Findings on attitudes beside an IMU."""
    inside = (attitude.t_ns >= imu.t_ns[0]) & (attitude.t_ns <= imu.t_ns[-1])
    if not inside.any():
        text = "The attitudes and the IMU do not overlap in time: other logs, or other time bases."
        hint = "Set input.attitude.time_base or input.attitude.time_offset_s."
        return [Finding("error", "no-attitude-overlap", text, hint)]
    pairs = _pair(attitude, imu)
    if attitude.heading_only or pairs is None:
        return []
    std = float(np.sqrt(np.nanmedian(attitude.cov[:, 0, 0]))) if np.isfinite(attitude.cov[:, 0, 0]).any() else np.inf
    return _check_axes(pairs, float(np.clip(_MANY * std, *_LEAST_TURN))) or _check_frame(attitude, pairs)


def _pair(attitude: AttitudeSeries, imu: ImuSeries) -> _Pairs | None:
    """None where there are too few."""
    step = max(1, round(_SPAN_S / (float(np.median(np.diff(attitude.t_ns))) / 1e9))) if len(attitude) > 1 else 1
    rows = np.arange(0, len(attitude), step)
    rows = rows[(attitude.t_ns[rows] >= imu.t_ns[0]) & (attitude.t_ns[rows] <= imu.t_ns[-1])]
    if len(rows) < _LEAST_PAIRS + 1:
        return None
    seconds = np.diff(imu.t_ns) / 1e9
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(imu.gyro[1:] * seconds[:, None], axis=0)])
    origin = imu.t_ns[0]
    at = (attitude.t_ns[rows] - origin) / 1e9
    angle = np.stack([np.interp(at, (imu.t_ns - origin) / 1e9, turned[:, axis]) for axis in range(3)], axis=-1)
    near = np.diff(at) < 2 * max(_SPAN_S, step * float(np.median(np.diff(attitude.t_ns))) / 1e9)
    q = attitude.q[rows]
    return _Pairs(q[:-1][near], q[1:][near], np.diff(angle, axis=0)[near], np.diff(at)[near])


def _turn(before: Floats, after: Floats) -> Floats:
    """Rotation vectors (m, 3) of the body between attitudes, in body axes."""
    return rotvec_from_quat(quat_multiply(quat_conjugate(before), after))


def _rms(vectors: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def _check_axes(pairs: _Pairs, least: float) -> list[Finding]:
    size = _rms(pairs.gyro)
    if size < least or _rms(_turn(pairs.before, pairs.after) - pairs.gyro) < _BAD_SHARE * size:
        return []
    flip = np.array([1.0, -1.0, -1.0])
    inverse = _turn(quat_conjugate(pairs.before), quat_conjugate(pairs.after))
    guesses = {
        "Set input.attitude.direction: the quaternions turn the other way.": inverse,
        "Set input.attitude.convention: the body's y and z axes point the other way.": _turn(pairs.before, pairs.after) * flip,
        "Set input.attitude.direction and input.attitude.convention: both are the other way.": inverse * flip,
    }
    hint = "Set input.attitude.direction, input.attitude.boresight_deg or input.attitude.time_offset_s."
    for guess, turn in guesses.items():
        if _rms(turn - pairs.gyro) < _GOOD_SHARE * size:
            hint = guess
    text = "The measured attitudes do not turn as the gyros do."
    return [Finding("error", "attitude-axes", text, hint)]


def _check_frame(attitude: AttitudeSeries, pairs: _Pairs) -> list[Finding]:
    """Between Earth-fixed axes and those of space the Earth's rotation is missing or counted twice."""
    if attitude.frame != "earth":
        return []
    axis_b = np.swapaxes(matrix_from_quat(pairs.before), 1, 2) @ np.array([0.0, 0.0, EARTH_RATE])
    rest = pairs.gyro - _turn(pairs.before, pairs.after)
    own = axis_b * pairs.seconds[:, None]
    # expected 1; 0 where the frame does not turn with the Earth, 2 where its turning was taken out twice
    share = float(np.sum(rest * own) / np.sum(own**2))
    scatter = float(np.sqrt(np.sum((rest - share * own) ** 2) / np.sum(own**2) / len(rest)))
    if scatter > 0.1 or min(abs(share), abs(share - 2)) > 0.3:
        return []
    frame = "inertial" if share < 1 else "earth"
    text = f"Between the measured attitudes the Earth turns {share:.1f} times as fast as it should: their frame is another one."
    return [Finding("warning", "attitude-frame", text, f"Set input.attitude.frame = '{frame}'.")]
