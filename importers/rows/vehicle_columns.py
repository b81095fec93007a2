"""Columns of wheels and barometers, as a mapping names them."""

from collections.abc import Mapping

import numpy as np

from navreplay.timeline import Floats

__all__ = ["baro_columns", "pressure_height", "wheel_columns"]

_SIDES = ("", "_left", "_right")


def wheel_columns(values: Mapping[str, np.ndarray]) -> dict[str, Floats]:
    """``wheels`` (n, 3), ``ticks`` (n, 3) and ``turn`` (n,) of columns (n,) by quantity, NaN where one is missing; without what
    has none at all. One side alone stands for the vehicle only together with the other."""
    out: dict[str, Floats] = {}
    for key, name in (("wheels", "speed"), ("ticks", "ticks")):
        names = [name + side for side in _SIDES]
        if name in values or values.keys() >= set(names[1:]):
            n = len(next(values[one] for one in names if one in values))
            parts = [np.asarray(values[one], dtype=np.float64) if one in values else np.full(n, np.nan) for one in names]
            out[key] = np.column_stack(parts)
    if "turn_rate" in values:
        out["turn"] = np.asarray(values["turn_rate"], dtype=np.float64)
    return out


def baro_columns(values: Mapping[str, np.ndarray]) -> dict[str, Floats]:
    """``baro`` (n,) [m] of columns (n,) by quantity, by the height that is told or else by pressure."""
    if "baro_height" in values:
        return {"baro": np.asarray(values["baro_height"], dtype=np.float64)}
    return {"baro": pressure_height(np.asarray(values["pressure"], dtype=np.float64))} if "pressure" in values else {}


def pressure_height(pressure: Floats) -> Floats:
    """Height [m] in the standard atmosphere (ISO 2533, troposphere) of pressure [Pa]; NaN where it is no air's."""
    air = np.where((pressure > 1e4) & (pressure < 1.2e5), pressure, np.nan)
    return np.asarray(44_330.77 * (1 - (air / 101_325.0) ** 0.190263))
