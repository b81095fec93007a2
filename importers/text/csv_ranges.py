"""Columns of a mapped table as pseudoranges: satellites, signals, and the corrections that columns hold."""

from collections.abc import Mapping, Sequence

import numpy as np

from importers.rows.ranges import Applied, satellite_names
from importers.rows.signals import DEFAULT_SIGNALS, SPEED_OF_LIGHT, carrier_hz
from importers.settings import CsvMapping, CsvTime, RangeCorrections
from navreplay.timeline import Floats, LogError

__all__ = ["OWN_RANGES", "range_columns"]

OWN_RANGES = CsvMapping(
    match="*",
    role="range",
    delimiter=",",
    header=True,
    comment="#",
    time=CsvTime(column="t_gps_ns", unit="ns"),
    columns={
        "sat": "sat",
        "signal": "signal",
        "pseudorange": "pseudorange_m",
        "range_rate": "range_rate_mps",
        "pseudorange_std": "pseudorange_std_m",
        "range_rate_std": "range_rate_std_mps",
        "cn0": "cn0_dbhz",
        "sat_x": "sat_x_m",
        "sat_y": "sat_y_m",
        "sat_z": "sat_z_m",
        "sat_vx": "sat_vx_mps",
        "sat_vy": "sat_vy_mps",
        "sat_vz": "sat_vz_mps",
    },
    corrections=RangeCorrections(satellite_clock=True, relativity=True, group_delay=True, sagnac="applied"),
)
"""This program's own table of ranges (docs/formats.md)."""

_PLAIN = ("pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0")
_ADDED = {
    "sat_clock_s": (SPEED_OF_LIGHT, Applied.SATELLITE_CLOCK),
    "sat_clock_m": (1.0, Applied.SATELLITE_CLOCK),
    "relativity_m": (1.0, Applied.RELATIVITY),
    "group_delay_m": (-1.0, Applied.GROUP_DELAY),
    "ionosphere_m": (-1.0, Applied.IONOSPHERE),
    "troposphere_m": (-1.0, Applied.TROPOSPHERE),
}
"""Factor and meaning of the columns that correct a pseudorange."""


def range_columns(columns: Mapping[str, np.ndarray], mapping: CsvMapping, place: str) -> dict[str, np.ndarray]:
    """Columns as `importers.rows.ranges.range_rows` takes them. Raises LogError where satellite or pseudorange is missing."""
    if not columns.keys() >= {"sat", "pseudorange"}:
        raise LogError(f"{place} has the role range, which needs the columns sat and pseudorange")
    sat = _satellites(columns["sat"], mapping)
    default = {system: signals[0] for system, signals in DEFAULT_SIGNALS.items()}
    signal = np.char.strip(columns["signal"].astype(str)) if "signal" in columns else _by_system(sat, default)
    out = {name: columns[name].astype(np.float64) for name in _PLAIN if name in columns}
    out |= {"sat": sat, "signal": signal.astype("U2")}
    if "doppler_hz" in columns and "range_rate" not in columns:
        out["range_rate"] = -columns["doppler_hz"] * SPEED_OF_LIGHT / carrier_hz(sat, out["signal"])
    for key, names in (("sat_pos_e", ("sat_x", "sat_y", "sat_z")), ("sat_vel_e", ("sat_vx", "sat_vy", "sat_vz"))):
        if columns.keys() >= set(names):
            out[key] = np.column_stack([columns[name] for name in names]).astype(np.float64)
    applied = _stated(mapping.corrections)
    correction: Floats = np.zeros(len(sat))
    for name, (factor, meaning) in _ADDED.items():
        if name in columns:
            correction = correction + factor * columns[name]
            applied |= meaning
    out["pseudorange"] = out["pseudorange"] + correction
    out["applied"] = np.full(len(sat), int(applied))
    return out


def _stated(corrections: RangeCorrections) -> Applied:
    stated = {
        Applied.SATELLITE_CLOCK: corrections.satellite_clock,
        Applied.RELATIVITY: corrections.relativity,
        Applied.GROUP_DELAY: corrections.group_delay,
        Applied.IONOSPHERE: corrections.ionosphere,
        Applied.TROPOSPHERE: corrections.troposphere,
        Applied.TURNED: corrections.sagnac == "applied",
        Applied.TURNED_BY_PSEUDORANGE: corrections.sagnac == "pseudorange",
    }
    applied = Applied(0)
    for meaning, is_in in stated.items():
        applied |= meaning if is_in else Applied(0)
    return applied


def _satellites(values: np.ndarray, mapping: CsvMapping) -> np.ndarray:
    """Names of the satellites; numbers by the blocks of the mapping, plain numbers being GPS."""
    texts, inverse = np.unique(values.astype(str), return_inverse=True)
    blocks = sorted(((first, system) for system, first in mapping.satellite_blocks.items()), reverse=True) or [(1, "G")]
    return satellite_names(np.array([_name(str(text), blocks) for text in texts]))[inverse]


def _name(text: str, blocks: Sequence[tuple[int, str]]) -> str:
    try:
        number = round(float(text))
    except (ValueError, OverflowError):
        return text
    return next((f"{system}{number - first + 1}" for first, system in blocks if number >= first), "")


def _by_system(sat: np.ndarray, value: Mapping[str, str]) -> np.ndarray:
    systems, inverse = np.unique(sat.astype("U1"), return_inverse=True)
    return np.array([value.get(str(system), "") for system in systems], dtype="U2")[inverse]
