"""What a pass tells of the vehicle for the next one: how the IMU sits in it, and which stops were none.

A standstill that is false in an outage bends the solution, and nothing says so before the next fixes. Those contradict it then,
and the pass is made again without the stops behind which they did; where they contradict that one less, it stands. So a false
standstill costs nothing but time.
"""

from dataclasses import replace
from math import degrees, isnan

import numpy as np

from navreplay.calibration.mounting import Mounting, find_mounting
from navreplay.options import VehicleOptions
from navreplay.solution import Event, InnovationSeries, Solution
from navreplay.timeline import ImuSeries, Times

__all__ = ["contradiction", "doubtful_stops", "sit_in_vehicle"]

_LEAST_STD = np.radians(0.2)
"""Of a mounting: a vehicle's body moves on its springs."""
_ARM_STD = 0.3
_SAME_STOP_NS = 3_000_000_000
_OUTAGE_NS = 3_000_000_000
"""Without a fix before, and with a stop in it: then a fix judges the stop."""
_LATEST_NS = 120_000_000_000
"""Behind a stop, of a fix that judges it."""
_JUDGES = 3
"""Fixes behind an outage."""
_CONTRADICTED = 5.0
"""Mean square per component of their innovations that speaks against the stops before them."""
_KINDS = ("position", "velocity")


def sit_in_vehicle(vehicle: VehicleOptions, solution: Solution, imu: ImuSeries, forward: float) -> tuple[VehicleOptions, Event]:
    """The options with the mounting that a solution without constraints shows, and what was found; as told where it shows
    none."""
    found = find_mounting(solution, imu, forward)
    t_ns = int(solution.t_ns[0])
    if found is None:
        text = (
            "how the IMU sits in the vehicle cannot be found: too short, too slow or without fixes; its axes are taken as they "
            "are named (vehicle.mounting_deg)"
        )
        return vehicle, Event(t_ns, "warning", text)
    placed = replace(vehicle, mounting=(found.pitch, forward + found.yaw), mounting_std=max(found.std, _LEAST_STD))
    if vehicle.rear_axle is None and not isnan(found.arm):
        placed = replace(placed, rear_axle=(found.arm * np.cos(forward), found.arm * np.sin(forward), 0.0), arm_std=_ARM_STD)
    return placed, Event(t_ns, "info", _tell(found, forward))


def _tell(found: Mounting, forward: float) -> str:
    arm = (
        "" if isnan(found.arm) else f", its rear axle {abs(found.arm):.1f} m {'behind' if found.arm < 0 else 'before'} the IMU"
    )
    return (
        f"the vehicle's axes lie in the IMU's at pitch {degrees(found.pitch):.2f}, yaw {degrees(forward + found.yaw):.2f} deg "
        f"(standard deviation {degrees(max(found.std, _LEAST_STD)):.2f}){arm}, as {found.rows} epochs in motion show"
    )


def doubtful_stops(solution: Solution) -> tuple[tuple[int, int], ...]:
    """(start, end) [GPS ns] of the stops used in outages at whose end the fixes contradict the solution."""
    standing = next((series for series in solution.innovations if series.kind == "standstill"), None)
    if standing is None or not standing.used.any():
        return ()
    stops = _stops(standing.t_ns[standing.used])
    doubted = set()
    for series in _judges(solution):
        for last, judges in _ends_of_outages(series):
            inside = [stop for stop in stops if last < stop[1] <= series.t_ns[judges[0]] <= stop[1] + _LATEST_NS]
            if inside and _mean_square(series, judges) > _CONTRADICTED:
                doubted.update(inside)
    return tuple(sorted(doubted))


def contradiction(solution: Solution, stops: tuple[tuple[int, int], ...]) -> float:
    """Mean square per component of the innovations of the fixes that judge these stops; 0 where there are none."""
    squares = []
    for series in _judges(solution):
        for last, judges in _ends_of_outages(series):
            if any(last < end <= series.t_ns[judges[0]] <= end + _LATEST_NS for _, end in stops):
                squares.append(_mean_square(series, judges))
    return float(np.mean(squares)) if squares else 0.0


def _judges(solution: Solution) -> list[InnovationSeries]:
    return [series for series in solution.innovations if series.kind in _KINDS and not series.sources]


def _stops(t_ns: Times) -> list[tuple[int, int]]:
    """Runs of the times (k,) as (first, last)."""
    edges = np.flatnonzero(np.diff(t_ns) > _SAME_STOP_NS) + 1
    return [(int(run[0]), int(run[-1])) for run in np.split(t_ns, edges)]


def _ends_of_outages(series: InnovationSeries) -> list[tuple[int, np.ndarray]]:
    """By outage, the time of the last measurement before it and the index of the first ones behind."""
    behind = np.flatnonzero(np.diff(series.t_ns) > _OUTAGE_NS) + 1
    return [(int(series.t_ns[i - 1]), np.arange(i, min(i + _JUDGES, len(series.t_ns)))) for i in behind.tolist()]


def _mean_square(series: InnovationSeries, rows: np.ndarray) -> float:
    return float(np.mean(series.nis[rows]) / series.residual.shape[1])
