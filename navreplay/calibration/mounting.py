"""How an IMU sits in a land vehicle, from a solution without constraints: the velocity in body axes while fixes hold it.

At the middle of the rear axle a vehicle moves straight ahead but for its tyres' slip, so that, with l from the IMU to it,
    v_y = yaw v_x - l_x w_z + s w_z v_x^2,    v_z = -pitch v_x + l_x w_y,
where s is the slip angle per lateral acceleration (Rajamani, Vehicle Dynamics and Control, 2nd ed. (2012), 2.3: constant for a
tyre that is far from its limits). Both are linear in what is asked for. Huber's weights keep skids, bumps and moments of a bad
heading from counting. The scatter of means over a minute, not that of rows, tells the standard deviations: a heading that is
off stays so for a while.
"""

from typing import NamedTuple

import numpy as np

from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.mean_rates import mean_rates
from navreplay.solution import RowStatus, Solution
from navreplay.timeline import Floats, ImuSeries

__all__ = ["Mounting", "find_mounting"]

_SLOWEST = 3.0
"""Speed [m/s] below which a row says little of the axes."""
_VELOCITY_STD = 0.3
"""Of a row that counts, horizontal [m/s], at most."""
_BLOCK_NS = 60_000_000_000
_FEWEST_BLOCKS = 4
_FEWEST_ROWS = 100
_AVERAGED_NS = 250_000_000
_LEAST_TURNING = 0.05
"""Of the yaw rates [rad/s], root mean square, without which nothing is known of the place of the axle."""
_STEPS = 20
_HUBER = 1.345
_MOST_PITCH_YAW = np.radians(20)


class Mounting(NamedTuple):
    """pitch, yaw [rad]: of the vehicle's axes in the body's, std [rad] of the worse. arm [m]: from the IMU forward to the
    rear axle, NaN where there were too few turns. rows: how many told it."""

    pitch: float
    yaw: float
    std: float
    arm: float
    rows: int


def find_mounting(solution: Solution, imu: ImuSeries, forward: float) -> Mounting | None:
    """About axes that are turned from the body's by forward [rad] about down. None where the solution does not show it: too
    short, too slow, or without fixes."""
    std = np.sqrt(np.trace(solution.cov[:, 3:5, 3:5], axis1=1, axis2=2) / 2)
    good = (std < _VELOCITY_STD) & np.isin(solution.status, (RowStatus.UPDATED, RowStatus.SMOOTHED))
    turn = np.array([[np.cos(forward), np.sin(forward), 0.0], [-np.sin(forward), np.cos(forward), 0.0], [0.0, 0.0, 1.0]])
    velocity = np.einsum("kji,kj->ki", matrix_from_quat(solution.q_nb), solution.vel_n) @ turn.T
    rows = np.flatnonzero(good & (velocity[:, 0] > _SLOWEST))
    if len(rows) < _FEWEST_ROWS:
        return None
    t_ns, velocity = solution.t_ns[rows], velocity[rows]
    rates = (mean_rates(imu, t_ns - _AVERAGED_NS, t_ns + _AVERAGED_NS) - solution.gyro_bias[rows]) @ turn.T
    ahead, zero = velocity[:, 0], np.zeros(len(rows))
    across = np.column_stack([ahead, -rates[:, 2], rates[:, 2] * ahead**2])
    turning = float(np.sqrt(np.mean(rates[:, 2] ** 2))) > _LEAST_TURNING
    lateral = _fit(across if turning else across[:, :1], velocity[:, 1])
    lifted = velocity[:, 2] - (lateral[1] * rates[:, 1] if turning else zero)
    vertical = _fit(ahead[:, None], lifted)
    yaw, pitch = float(np.arctan(lateral[0])), float(np.arctan(-vertical[0]))
    explained = across[:, 1:] @ lateral[1:] if turning else zero
    stds = [_block_std(t_ns, left, ahead) for left in (velocity[:, 1] - explained, lifted)]
    if max(abs(yaw), abs(pitch)) > _MOST_PITCH_YAW or not np.isfinite(stds).all():
        return None
    return Mounting(pitch, yaw, max(stds), float(lateral[1]) if turning else float("nan"), len(rows))


def _fit(columns: Floats, values: Floats) -> Floats:
    """(p,) of values (k,) by columns (k, p), with Huber's weights about the median deviation."""
    weights = np.ones(len(values))
    slopes: np.ndarray = np.zeros(columns.shape[1])
    for _ in range(_STEPS):
        root = np.sqrt(weights)
        slopes = np.asarray(np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0])
        left = np.abs(values - columns @ slopes)
        scale = max(1.4826 * float(np.median(left)), 1e-9)
        weights = np.minimum(1.0, _HUBER * scale / np.maximum(left, 1e-12))
    return slopes


def _block_std(t_ns: np.ndarray, left: Floats, ahead: Floats) -> float:
    """Of the slope of left over ahead (k,), by the scatter of the slopes of a minute each; NaN of too few."""
    blocks = (t_ns - t_ns[0]) // _BLOCK_NS
    slopes = np.array([float(np.median(left[blocks == b] / ahead[blocks == b])) for b in np.unique(blocks)])
    if len(slopes) < _FEWEST_BLOCKS:
        return float("nan")
    return float(np.std(slopes, ddof=1) / np.sqrt(len(slopes)))
