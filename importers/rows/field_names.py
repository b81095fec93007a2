"""What fields and columns hold, by their names, the units in these, and the size of their values."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from navreplay.timeline import Floats

__all__ = ["Guess", "guess_angle_unit", "guess_counter", "guess_quantities", "guess_time", "unit_in"]


@dataclass(frozen=True, slots=True)
class Guess:
    """A field for a quantity, the unit its values are in, and why."""

    path: str
    unit: str
    reason: str
    backwards: bool = False
    """Whether the name says that it points against its axis (up of down, left of right)."""


_UNIT_ENDS = {
    "deg": "deg", "rad": "rad", "e7": "1e-7 deg", "degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "rads": "rad/s",
    "rps": "rad/s",
    "mps": "m/s", "ms": "m/s", "cmps": "cm/s", "mmps": "mm/s", "kmh": "km/h", "kmph": "km/h", "kn": "kn", "knots": "kn",
    "mph": "mph", "mps2": "m/s2", "ms2": "m/s2", "mg": "mg", "m": "m", "cm": "cm", "mm": "mm", "ft": "ft",
}  # fmt: skip
_BRACKET = re.compile(r"(.*?)\s*[\[(]([^\[\]()]*[^\[\]()\d][^\[\]()]*|m/s2)[\])]\s*")
_BRACKET_UNITS = {
    unit: unit
    for unit in (
        "deg",
        "rad",
        "deg/s",
        "rad/s",
        "m/s",
        "cm/s",
        "mm/s",
        "km/h",
        "kn",
        "m/s2",
        "g",
        "mg",
        "m",
        "cm",
        "mm",
        "km",
        "ft",
    )
} | {
    "dps": "deg/s",
    "mps": "m/s",
    "kmh": "km/h",
    "kph": "km/h",
    "knots": "kn",
    "kt": "kn",
    "mph": "mph",
    "ft/s": "ft/s",
    "fps": "ft/s",
    "mps2": "m/s2",
    "feet": "ft",
    "meters": "m",
    "metres": "m",
    "meter": "m",
    "1e-7deg": "1e-7 deg",
}
_SCALARS = {
    "lat": r"(gps|gnss|pos)?lat(itude)?",
    "lon": r"(gps|gnss|pos)?(lon|long|longitude|lng)",
    "height": r"(gps|gnss|pos)?(height|hgt|hae|alt|altitude|elevation)(ell|ellipsoid|ellipsoidal|wgs84)?",
    "vel_n": r"(vel|velocity|v|speed)(n|north)|north(vel|velocity|speed)",
    "vel_e": r"(vel|velocity|v|speed)(e|east)|east(vel|velocity|speed)",
    "vel_d": r"(vel|velocity|v|speed)(d|down)|down(vel|velocity|speed)",
    "vel_u": r"(vel|velocity|v|speed)(u|up)|up(vel|velocity|speed)|climb|climbrate",
    "speed": r"(ground|g)?speed|sog|speedoverground",
    "course": r"course|cog|track|headingofmotion|headmot|courseoverground",
    "std_h": r"(h|horizontal)(acc|accuracy)|eph",
    "std_d": r"(v|vertical)(acc|accuracy)|epv|(std|sd|sigma)(d|down|u|up|h|height|alt|altitude)|"
    r"(height|alt|altitude|up)(std|stdev|sd|sigma)",
    "std_n": r"(std|sd|sigma)(n|north|lat|latitude)|(lat|latitude|north)(std|stdev|stddev|sd|sigma)",
    "std_e": r"(std|sd|sigma)(e|east|lon|longitude)|(lon|longitude|east)(std|stdev|stddev|sd|sigma)",
} | {
    f"{kind}_{axis}": rf"({names})({axis}|axis{axis})"
    for axis in "xyz"
    for kind, names in (
        ("gyro", r"gyro|gyroscope|gyr|g|w|omega|rate|angvel|angularrate|angularvelocity|angularvel|angrate"),
        ("accel", r"acc|accel|acceleration|accelerometer|a|f|linearacceleration|linacc|specificforce"),
    )
}  # fmt: skip
_DIRECTIONS = {"x": r"(fwd|forward|front)|(back|backward|rear)", "y": r"(right|rgt)|(left)", "z": r"(down|dn)|(up)"}
_SENSORS = {
    "gyro": r"(?:gyro|gyroscope|gyr|w|omega|rate|angvel|angularrate|angularvelocity)",
    "accel": r"(?:acc|accel|acceleration|a|f|force|specificforce)",
}
_VECTORS = {
    "gyro": r"gyro|gyroscope|gyr|omega|rates?|angvel|angularrates?|angularvelocity|angularvel|angrate",
    "accel": r"acc|accel|acceleration|accelerometer|linearacceleration|linacc|specificforce",
}
_VELOCITY = ("vel_n", "vel_e", "vel_d", "vel_u")
_FAMILY = {
    "lat": "angle",
    "lon": "angle",
    "course": "angle",
    "speed": "speed",
    "gyro": "rate",
    "accel": "force",
    "vel": "speed",
}
_DEFAULT = {"angle": "deg", "rate": "rad/s", "force": "m/s2", "speed": "m/s"}
_TIME = re.compile(r".*(time|stamp|tow|utc|unix|epoch|clock).*|t(ns|us|ms|s)?")
_COUNTER = re.compile(r".*(time|stamp|uptime|micros|millis|nanos|ticks|elapsed|clock).*|t(ns|us|ms|s)?|us|ms|ns|sec(onds?)?")
_COUNTER_UNITS = {"micros": "us", "millis": "ms", "nanos": "ns", "us": "us", "ms": "ms", "ns": "ns", "s": "s", "sec": "s"}


def guess_angle_unit(lat: Floats, lon: Floats) -> tuple[str, str]:
    """Unit of latitudes and longitudes (n,), and why: ``deg``, ``rad``, ``ddmm`` (degrees and minutes written together) or
    ``1e-7 deg``. Radians are told by values that in degrees would all lie in the sea off Africa."""
    largest = [float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0 for values in (lat, lon)]
    seen = f"the largest are {largest[0]:.9g} and {largest[1]:.9g}"
    if largest[0] <= np.pi / 2 and largest[1] <= np.pi and max(largest) > 0:
        return "rad", f"{seen}: radians"
    if largest[0] <= 90 and largest[1] <= 360:
        return "deg", f"{seen}: degrees"
    minutes = np.concatenate([np.abs(values[np.isfinite(values)]) % 100 for values in (lat, lon)])
    if largest[0] <= 9000 and largest[1] <= 18_000 and (minutes < 60).all():
        return "ddmm", f"{seen}: degrees and minutes written together"
    return ("1e-7 deg", f"{seen}: degrees times 1e7") if largest[0] <= 9e8 and largest[0] > 18_000 else ("deg", seen)


def guess_quantities(fields: Mapping[str, Floats]) -> dict[str, Guess]:
    """By quantity the first field whose name means it; vectors (n, 3) give three quantities."""
    found: dict[str, Guess] = {}
    for path, values in fields.items():
        names, unit = _names_and_unit(path)
        if values.ndim == 2:
            kind = _match(_VECTORS, names)
            told = unit or (_unit_of(f"{kind}_x", values) if kind else "")
            for place, axis in enumerate("xyz" if kind else ""):
                found.setdefault(f"{kind}_{axis}", Guess(f"{path}[{place}]", told, _reason(path, values, told)))
            continue
        quantity = _match(_SCALARS, names)
        if quantity is not None:
            told = unit or _unit_of(quantity, values)
            found.setdefault(quantity, Guess(path, told, _reason(path, values, told)))
            continue
        along = _direction(names)
        if along is not None:
            told = unit or _unit_of(along[0], values)
            found.setdefault(along[0], Guess(path, told, _reason(path, values, told), along[1]))
    return _with_receiver_units(_with_family_units(found, fields), fields)


def _with_receiver_units(found: dict[str, Guess], fields: Mapping[str, Floats]) -> dict[str, Guess]:
    """Whole accuracies beside latitudes in 1e-7 degrees are millimetres, as receivers count both."""
    if "lat" not in found or found["lat"].unit != "1e-7 deg":
        return found
    for name in [name for name in found if name.startswith("std") and not _names_and_unit(found[name].path)[1]]:
        values = np.nan_to_num(fields[found[name].path])
        if np.all(values == np.rint(values)):
            found[name] = replace(found[name], unit="mm", reason=_reason(found[name].path, values, "mm"))
    return found


def _direction(names: list[str]) -> tuple[str, bool] | None:
    """The axis of a sensor that a name tells by its direction in the vehicle, and whether it is the opposite one."""
    for name in names:
        for kind, sensor in _SENSORS.items():
            for axis, ways in _DIRECTIONS.items():
                match = re.fullmatch(f"{sensor}(?:{ways})", name)
                if match is not None:
                    return f"{kind}_{axis}", match.group(2) is not None
    return None


def _match(patterns: Mapping[str, str], names: list[str]) -> str | None:
    """What the longest of the names means, None where none of them means anything."""
    return next((key for name in names for key, pattern in patterns.items() if re.fullmatch(pattern, name)), None)


def unit_in(path: str) -> str:
    """The unit that a name ends with, empty where it tells none."""
    return _names_and_unit(path)[1]


def _names_and_unit(path: str) -> tuple[list[str], str]:
    """The last words of a path run together, three of them first, then its first and last, and the unit that it ends with,
    which may stand in brackets."""
    bracket = _BRACKET.fullmatch(path)
    path, unit = (path, "") if bracket is None else (bracket.group(1), _bracket_unit(bracket.group(2)))
    words = [word for word in re.split(r"[^A-Za-z0-9]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", path).lower()) if word] or [""]
    if not unit and len(words) > 1 and words[-1] in _UNIT_ENDS:
        unit, words = _UNIT_ENDS[words[-1]], words[:-1]
    return ["".join(words[-count:]) for count in (3, 2, 1)] + [words[0] + words[-1]], unit


def _bracket_unit(text: str) -> str:
    plain = re.sub(r"[\s*·^]", "", text.lower()).replace("²", "2").replace("°", "deg").replace("degrees", "deg")
    plain = plain.replace("/sec", "/s").replace("s-2", "/s2").replace("s-1", "/s").replace("/s/s", "/s2").replace("//", "/")
    return _BRACKET_UNITS.get(plain, "")


def _unit_of(quantity: str, values: Floats) -> str:
    """The unit that the size of values suggests."""
    family = _FAMILY.get(quantity) or _FAMILY.get(quantity.partition("_")[0], "length")
    size = float(np.nanmedian(np.abs(values))) if values.ndim == 1 else float(np.nanmedian(np.linalg.norm(values, axis=1)))
    whole = bool(np.all(np.nan_to_num(values) == np.rint(np.nan_to_num(values))))
    if family == "angle":
        return "1e-7 deg" if whole and size > 1000 else "deg"
    if family == "rate":
        return "deg/s" if float(np.nanmax(np.abs(values))) > 20 else "rad/s"
    if family == "force":
        return "g" if 0.5 < size < 1.5 else "mg" if 500 < size < 1500 else "m/s2"
    if family == "speed":  # no vehicle on a road or in the air does 500 m/s
        return "mm/s" if whole and (size > 200 or float(np.nanmax(np.abs(values))) > 500) else "m/s"
    return "mm" if whole and size > (500 if quantity.startswith("std") else 20_000) else "m"


def _with_family_units(found: dict[str, Guess], fields: Mapping[str, Floats]) -> dict[str, Guess]:
    """Scalar accelerations, rates and velocities: the unit of all axes together."""
    for kind in ("gyro", "accel", "vel"):
        axes = [f"{kind}_{axis}" for axis in "xyz"] if kind != "vel" else [axis for axis in _VELOCITY if axis in found]
        if axes and all(axis in found and fields.get(found[axis].path, np.empty((0, 0))).ndim == 1 for axis in axes):
            whole = np.column_stack([fields[found[axis].path] for axis in axes])
            if not any(_names_and_unit(found[axis].path)[1] for axis in axes):
                unit = _unit_of(axes[0], whole)
                found |= {axis: replace(found[axis], unit=unit, reason=_reason(found[axis].path, whole, unit)) for axis in axes}
    return found


def _reason(path: str, values: Floats, unit: str) -> str:
    size = np.nanmedian(np.abs(values)) if values.ndim == 1 else np.nanmedian(np.linalg.norm(values, axis=1))
    return f"{'median' if values.ndim == 1 else 'median length'} {size:.6g}, so taken as {unit}"


def guess_time(fields: Mapping[str, Floats]) -> tuple[str, str, str, str] | None:
    """Field, unit, base and reason of a time, by the size of its values."""
    for path, values in fields.items():
        plain = path.replace("_", "").lower().rpartition(".")[2]
        if values.ndim != 1 or not _TIME.fullmatch(plain):
            continue
        middle = float(np.nanmedian(values))
        for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
            if 6.3e8 < middle / scale < 4.1e9:
                base = "utc" if middle / scale > 1.5e9 else "gps"
                return path, unit, base, f"median {middle:.6g}: {unit} since {'1970' if base == 'utc' else '1980'}"
        if "tow" in plain and 0 <= middle < 604_800_000:
            unit = "ms" if middle > 604_800 else "s"
            return path, unit, "gps_tow", f"median {middle:.6g}: {unit} of the GPS week"
    return None


def guess_counter(fields: Mapping[str, Floats]) -> tuple[str, str, str, str] | None:
    """Field, unit (``auto`` where the name tells none), base and reason of a count from power-on: named as a time, and growing
    but for turns of its 32 bits."""
    for path, values in fields.items():
        plain = path.replace("_", "").lower().rpartition(".")[2]
        first = re.split(r"[^a-z]", path.lower())[0]
        named = _COUNTER.fullmatch(re.sub(r"[^a-z]", "", plain)) or first in ("t", "time")
        if values.ndim != 1 or not named or len(values) < 2:
            continue
        steps = np.diff(values)
        grows = (steps >= 0) | (steps < -(2.0**31))
        if np.isfinite(values).all() and (values >= 0).all() and grows.all() and (steps > 0).any():
            words = re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", path).lower())
            unit = _COUNTER_UNITS.get(words[-1], "auto")
            return path, unit, "boot", f"it grows from {values[0]:.9g}: a count from power-on"
    return None
