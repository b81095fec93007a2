"""RAWIMU and its relatives: increments of the IMU of SPAN receivers as mean rates and specific forces.

Source of the scales: NovAtel OEM7 Commands and Logs Reference Manual, RAWIMUSX, table "Raw IMU Scale Factors". IMUs whose scale
is given in another way there (KVH) are refused rather than guessed.
"""

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import LogError, Times

__all__ = ["RAW", "RAW_EXTENDED", "raw_samples"]

_INCREMENTS = [("status", "<u4"), ("accel_z", "<i4"), ("accel_minus_y", "<i4"), ("accel_x", "<i4")]
_INCREMENTS += [("gyro_z", "<i4"), ("gyro_minus_y", "<i4"), ("gyro_x", "<i4")]
RAW = np.dtype([("week", "<u4"), ("seconds", "<f8"), *_INCREMENTS])
RAW_EXTENDED = np.dtype([("info", "u1"), ("type", "u1"), ("week", "<u2"), ("seconds", "<f8"), *_INCREMENTS])
_FOOT = 0.3048
_DEGREE, _ARCSEC, _MILLI_G = np.pi / 180, np.pi / 180 / 3600, 9.80665e-3
_HONEYWELL = (2.0**-33, _FOOT * 2.0**-27)
_SCALES: dict[int, tuple[float, float]] = {
    **dict.fromkeys((1, 5, 11, 20, 27, 28), _HONEYWELL),
    **dict.fromkeys((4, 12), (2.0**-33, _FOOT * 2.0**-26)),
    8: (2.0**-19, 2.0**-14),
    13: (0.1 * 2.0**-8 * _ARCSEC, 0.05 * 2.0**-15),
    **dict.fromkeys((26, 52), (1e-9, 2e-8)),
    31: (720.0 * 2.0**-31 * _DEGREE, 200.0 * 2.0**-31),
    **dict.fromkeys((32, 56), (2.0**-21 * _DEGREE, 2.0**-22)),
    **dict.fromkeys((58, 68, 69), (2.0**-33, 2.0**-29)),
}
"""By IMU type, radians and metres per second of a count."""
_RATE_SCALES: dict[int, tuple[float, float]] = {
    **dict.fromkeys((41, 62), (0.008 * 2.0**-16 * _DEGREE, 0.2 * 2.0**-16 * _MILLI_G)),
    61: (0.0151515 * 2.0**-16 * _DEGREE, 0.4 * 2.0**-16 * _MILLI_G),
}
"""Where counts are rates: radians per second and metres per second squared of a count."""


def raw_samples(rows: NDArray[np.void], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns of samples (n,), means over the intervals that end at their stamps, in the axes of the IMU as its case shows them
    (x right, y forward, z up where it is mounted so). Raises LogError where the scale of the IMU is not known."""
    if "type" not in (rows.dtype.names or ()):
        raise LogError(
            "RAWIMU and RAWIMUS do not tell which IMU made them, so their scale is not known; log RAWIMUSX (or RAWIMUX) instead"
        )
    kinds = np.unique(rows["type"])
    if len(kinds) != 1 or not (int(kinds[0]) in _SCALES or int(kinds[0]) in _RATE_SCALES):
        raise LogError(f"RAWIMUSX of IMU type {', '.join(map(str, kinds)) or 'none'}, whose scale is not known here")
    kind = int(kinds[0])
    seconds = np.where((rows["seconds"] >= 0) & (rows["seconds"] < 604_801), rows["seconds"], -1e9)
    own_ns = gps_from_week_tow(rows["week"].astype(np.int64), seconds)
    step = np.diff(np.sort(own_ns))
    interval = float(np.median(step[step > 0])) / 1e9 if (step > 0).any() else np.nan
    scales = _RATE_SCALES[kind] if kind in _RATE_SCALES else tuple(scale / interval for scale in _SCALES[kind])
    columns: dict[str, np.ndarray] = {"t_gps_ns": own_ns}
    for name, scale in zip(("gyro", "accel"), scales, strict=True):
        counts = np.column_stack([rows[f"{name}_x"], -rows[f"{name}_minus_y"].astype(np.int64), rows[f"{name}_z"]])
        columns[name] = counts * scale
    return columns
