"""Columns of a mapped table in SI and radians, and those that speed and course make."""

from collections.abc import Mapping

import numpy as np

from importers.quantities import unit_factor
from importers.rows.field_names import guess_angle_unit
from importers.settings import CsvMapping
from navreplay.timeline import Floats

__all__ = ["in_si"]

_FAMILIES = {"gyro": ("gyro_",), "accel": ("accel_",), "vel": ("vel_", "speed", "std_v")}
_ANGLES = ("course", "roll", "pitch", "yaw", "std_att_x", "std_att_y", "std_att_z")


def in_si(columns: Mapping[str, np.ndarray], mapping: CsvMapping) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """The columns (n,) with angles in radians and told units as SI, and what was recognised of them."""
    out = dict(columns)
    notes: list[str] = []
    for name in [name for name in out if out[name].dtype.kind in "fiu" and (unit := _told(mapping, name))]:
        out[name] = out[name] * unit_factor(_told(mapping, name))
    for name in [name for name in _ANGLES if name in out and not _told(mapping, name)]:
        out[name] = out[name] if mapping.angle_unit == "rad" else np.radians(out[name].astype(np.float64))
    if out.keys() >= {"lat", "lon"} and not _told(mapping, "lat"):
        lat, lon = (out[name].astype(np.float64) for name in ("lat", "lon"))
        unit, reason = (mapping.angle_unit, "") if mapping.angle_unit != "auto" else guess_angle_unit(lat, lon)
        notes += [f"angle_unit of latitude and longitude taken as {unit} ({reason})"] if reason and unit != "deg" else []
        out |= {"lat": _angle(lat, unit), "lon": _angle(lon, unit)}
    for name, letters, negative in (("lat", "ns", "S"), ("lon", "ew", "W")):
        if letters in out and name in out:
            other = np.char.startswith(np.char.upper(np.char.strip(out.pop(letters).astype(str))), negative)
            out[name] = np.where(other, -np.abs(out[name]), out[name])
    return _with_parts(out), tuple(notes)


def _told(mapping: CsvMapping, name: str) -> str:
    family = next((key for key, starts in _FAMILIES.items() if name.startswith(starts)), name)
    return mapping.units.get(name) or mapping.units.get(family) or ""


def _angle(values: Floats, unit: str) -> Floats:
    """Radians of angles (n,) in a unit of `guess_angle_unit`."""
    if unit == "ddmm":
        size = np.abs(values)
        return np.copysign(np.radians(size // 100 + size % 100 / 60), values)
    return values if unit == "rad" else np.asarray(values * unit_factor(unit))


def _with_parts(out: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Velocities of speed and course, and deviations of all axes of those told together. An unknown vertical velocity is 0:
    vetting tells one that is never filled."""
    if out.keys() >= {"speed", "course"}:
        out |= {"vel_n": out["speed"] * np.cos(out["course"]), "vel_e": out["speed"] * np.sin(out["course"])}
    if out.keys() >= {"vel_n", "vel_e"} and not out.keys() & {"vel_d", "vel_u"}:
        out["vel_d"] = np.zeros(len(out["vel_n"]))
    out |= {name: out["std_h"] for name in ("std_n", "std_e") if "std_h" in out}
    out |= {name: out["std_vel"] for name in ("std_vn", "std_ve", "std_vd") if "std_vel" in out}
    if "height" not in out and out.keys() >= {"lat", "lon"}:
        out["height"] = np.full(len(out["lat"]), np.nan)
    return out
