"""Tables without a header: what their columns hold, by value alone.

Gravity is the surest mark there is: three columns whose length is steadily 1 (g) or 9.8. A time is what grows in every row,
angular rates are the three columns beside, and three columns as long as the radius of the Earth are positions.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from importers.text.times import unroll_32_bits
from navreplay.timeline import Floats

__all__ = ["Meaning", "understand"]

_LEAST_ROWS = 20
_STEADY = 0.6
"""Share of the length of accelerations that their median vector has: gravity stays, the rest points everywhere."""
_FORCES = {"g": (0.85, 1.15), "m/s2": (8.8, 10.8)}
_EARTH = (6.33e6, 6.39e6)
_DEGREES = 20.0
_QUIET_DEGREES = 0.02
_LATEST_UNIX_S = 4.1e9


@dataclass(frozen=True, slots=True)
class Meaning:
    """role: imu or fix. time: number of its column, and the keys of a mapping. columns: numbers (from 1) by quantity. units: of
    these. reasons: by key."""

    role: str
    time: Mapping[str, object]
    columns: Mapping[str, int]
    units: Mapping[str, str]
    reasons: Mapping[str, str]


def understand(columns: Mapping[int, Floats]) -> Meaning | None:
    """What the columns (n,), by their numbers from 1, hold; None where that is not plain."""
    if not columns or len(next(iter(columns.values()))) < _LEAST_ROWS:
        return None
    grows = [number for number, values in columns.items() if _grows(values)]
    if not grows:
        return None
    time, reason = _time(grows[0], columns[grows[0]])
    others = [number for number in columns if number not in grows]
    triples = [triple for triple in zip(others, others[1:], others[2:], strict=False) if triple[2] - triple[0] == 2]
    for triple in triples:
        values = np.column_stack([columns[number] for number in triple])
        if _EARTH[0] < np.median(np.linalg.norm(values, axis=1)) < _EARTH[1]:
            named = dict(zip(("ecef_x", "ecef_y", "ecef_z"), triple, strict=True))
            told = f"columns {triple[0]} to {triple[2]} are as long as the radius of the Earth"
            return Meaning("fix", time, named, {}, {"role": told, "time": reason})
    return _imu(columns, triples, time, reason)


def _imu(
    columns: Mapping[int, Floats], triples: list[tuple[int, int, int]], time: Mapping[str, object], reason: str
) -> Meaning | None:
    """An IMU: accelerations that hold gravity, and the first other three columns as rates."""
    for forces in triples:
        unit = _force_unit(np.column_stack([columns[number] for number in forces]))
        rates = next((triple for triple in triples if not set(triple) & set(forces)), None)
        if not unit or rates is None:
            continue
        turning = np.column_stack([columns[number] for number in rates])
        peak, middle = float(np.quantile(np.abs(turning), 0.999)), float(np.median(np.linalg.norm(turning, axis=1)))
        # at rest a gyro of the kind that is logged so shows hundredths of a radian at most
        rate_unit = "deg/s" if peak > _DEGREES or (middle > _QUIET_DEGREES and _quantised(turning)) else "rad/s"
        named = dict(zip([f"accel_{axis}" for axis in "xyz"] + [f"gyro_{axis}" for axis in "xyz"], forces + rates, strict=True))
        told = {
            "role": f"columns {forces[0]} to {forces[2]} hold gravity in {unit}, {rates[0]} to {rates[2]} are taken as rates",
            "units": f"the rates have a median length of {middle:.3g} and a peak of {peak:.3g}",
            "time": reason,
        }
        return Meaning("imu", time, named, {"accel": unit, "gyro": rate_unit}, told)
    return None


def _quantised(turning: Floats) -> bool:
    """Whether rates come in steps as coarse as a sensor's bits in degrees per second."""
    steps = np.diff(np.unique(turning))
    return bool(len(steps) and np.median(steps) > 1e-3)


def _grows(values: Floats) -> bool:
    whole, _ = unroll_32_bits(values)
    steps = np.diff(whole)
    return bool(np.isfinite(values).all() and (steps >= 0).all() and np.mean(steps > 0) > 0.5)


def _time(number: int, values: Floats) -> tuple[dict[str, object], str]:
    """The keys of a mapping's time, and why."""
    middle = float(np.median(values))
    scale = next(
        (unit for unit, size in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)) if 1e9 < middle / size < _LATEST_UNIX_S), ""
    )
    if scale:
        return {
            "column": number,
            "base": "utc",
            "unit": scale,
        }, f"column {number} grows, and as {scale} since 1970 it is a date"
    step = float(np.median(np.diff(values)))
    if middle <= 604_800 and step < 2 and values.min() >= 0 and np.any(values != np.rint(values)):
        return {"column": number, "base": "gps_tow", "unit": "s"}, f"column {number} grows, taken as seconds of the GPS week"
    return {"column": number, "base": "boot", "unit": "auto"}, f"column {number} grows: a count from power-on"


def _force_unit(values: Floats) -> str:
    size = float(np.median(np.linalg.norm(values, axis=1)))
    if np.linalg.norm(np.median(values, axis=0)) < _STEADY * size:
        return ""
    return next((unit for unit, (least, most) in _FORCES.items() if least < size < most), "")
