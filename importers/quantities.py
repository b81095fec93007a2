"""What settings of the input are made of: quantities, units, axes, names of statuses and time bases."""

from math import pi
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "Column",
    "MessageQuantity",
    "Positive",
    "Quantity",
    "Settings",
    "Signal",
    "Stamp",
    "StatusName",
    "System",
    "TimeBase",
    "Vector",
    "check_axes",
    "unit_factor",
]

TimeBase = Literal["auto", "utc", "gps", "tai", "boot"]
Stamp = Literal["header", "log"]
StatusName = Literal["unknown", "single", "differential", "float", "fixed", "dead_reckoning", "none"]
Column = str | Annotated[int, Field(ge=1)]
Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
System = Literal["G", "R", "E", "C", "J"]
Signal = Annotated[str, Field(pattern="^[1-9][A-Z]$")]

Quantity = Literal[
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "accel_x",
    "accel_y",
    "accel_z",
    "lat",
    "lon",
    "height",
    "ns",
    "ew",
    "ecef_x",
    "ecef_y",
    "ecef_z",
    "vel_n",
    "vel_e",
    "vel_d",
    "vel_u",
    "vel_ecef_x",
    "vel_ecef_y",
    "vel_ecef_z",
    "std_n",
    "std_e",
    "std_d",
    "std_vn",
    "std_ve",
    "std_vd",
    "roll",
    "pitch",
    "yaw",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "std_att_x",
    "std_att_y",
    "std_att_z",
    "speed",
    "speed_left",
    "speed_right",
    "turn_rate",
    "ticks",
    "ticks_left",
    "ticks_right",
    "pressure",
    "baro_height",
    "course",
    "std_h",
    "std_vel",
    "status",
    "sat",
    "signal",
    "pseudorange",
    "range_rate",
    "doppler_hz",
    "pseudorange_std",
    "range_rate_std",
    "cn0",
    "sat_x",
    "sat_y",
    "sat_z",
    "sat_vx",
    "sat_vy",
    "sat_vz",
    "sat_clock_s",
    "sat_clock_m",
    "relativity_m",
    "group_delay_m",
    "ionosphere_m",
    "troposphere_m",
]
"""What a column of a text file can hold. ``speed`` and ``course`` (clockwise from north) are over ground; of the role
``speed``, ``speed`` and ``ticks`` (a count that grows) are those of wheels, or of those on the left and the right,
``turn_rate`` is to the right; ``pressure`` [Pa] and ``baro_height`` are of the role ``baro``; ``std_h`` stands for
both horizontal axes, ``std_vel`` for all of a velocity; ``yaw`` is clockwise from north; ``q_*`` is the quaternion body (FRD)
to NED, or to the frame that ``input.attitude`` names, ``std_att_*`` the standard deviations about the axes of that frame. Of
ranges, ``sat_clock_*`` and ``relativity_m`` are added to the pseudorange, ``group_delay_m``, ``ionosphere_m`` and
``troposphere_m`` (delays) are subtracted from it."""

_ALONG = {"f": (1, 0, 0), "b": (-1, 0, 0), "r": (0, 1, 0), "l": (0, -1, 0), "d": (0, 0, 1), "u": (0, 0, -1)}

MessageQuantity = (
    Quantity
    | Literal[
        "east",
        "north",
        "up",
        "var_n",
        "var_e",
        "var_d",
        "var_vn",
        "var_ve",
        "var_vd",
        "lat_plus",
        "lon_plus",
        "height_plus",
    ]
)
"""What a field of a message can hold, besides: ``east``, ``north``, ``up`` of ``origin_deg_m``; variances; and what is added to
latitude, longitude and height (finer digits, the geoid separation of a height above mean sea level)."""


class Settings(BaseModel):
    """A table of settings: no unknown keys, no changes."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def check_axes(axes: str, right_handed: bool = True) -> str:
    """The axes as they are. Raises ValueError unless they are ``auto``, or three letters that make a triad, right-handed where
    that is asked for."""
    if axes == "auto":
        return axes
    if len(axes) != 3 or any(letter not in _ALONG for letter in axes):
        raise ValueError("axes must be 'auto' or three letters of f, b, r, l, u, d, such as 'flu' or 'frd'")
    x, y, z = (_ALONG[letter] for letter in axes)
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    if not any(cross) or cross not in (z, tuple(-part for part in z)):
        raise ValueError(f"axes '{axes}' are no triad; each of forward, right and down (or its opposite) is needed once")
    if right_handed and cross != z:
        raise ValueError(f"axes '{axes}' are not a right-handed triad; one of the letters points the wrong way")
    return axes


_UNITS = {
    "rad": 1.0,
    "deg": pi / 180,
    "arcsec": pi / 648_000,
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1000.0,
    "ft": 0.3048,
    "m/s": 1.0,
    "cm/s": 0.01,
    "mm/s": 0.001,
    "km/h": 1 / 3.6,
    "kn": 1852 / 3600,
    "ft/s": 0.3048,
    "mph": 0.44704,
    "rad/s": 1.0,
    "deg/s": pi / 180,
    "m/s2": 1.0,
    "g": 9.80665,
    "mg": 9.80665e-3,
    "Pa": 1.0,
    "hPa": 100.0,
    "kPa": 1000.0,
    "mbar": 100.0,
    "m2": 1.0,
    "m2/s2": 1.0,
}


def unit_factor(text: str) -> float:
    """What a number in a unit (``mm``, ``1e-7 deg``, ``0.5 g``) is multiplied by to get it in SI and radians. Raises
    ValueError."""
    factor, _, unit = text.strip().rpartition(" ")
    try:
        return float(factor or 1) * _UNITS[unit]
    except (KeyError, ValueError) as error:
        raise ValueError(
            f"no unit '{text}'; known are {', '.join(_UNITS)}, each with a factor before it, as '1e-7 deg'"
        ) from error
