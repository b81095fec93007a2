"""Raw measurements of Android phones with derived values: ``device_gnss.csv`` of the Google Smartphone Decimeter Challenges.

Meaning of the columns: the data descriptions of the challenges of 2022 and 2023. Satellites stand in Earth-fixed axes of the
time of transmission; SvClockBiasMeters holds relativity and group delay.
"""

import numpy as np

from importers.rows.log import Table
from importers.rows.ranges import Applied, satellite_names
from importers.text.table import Selection, parse_text, read_bytes, select_columns
from navreplay.timeline import LogError

__all__ = ["is_smartphone", "read_smartphone"]

_TIME, _PSEUDORANGE = "ArrivalTimeNanosSinceGpsEpoch", "RawPseudorangeMeters"
_NEEDED = (_TIME, "Svid", "SignalType", _PSEUDORANGE)
_PLAIN = {
    "pseudorange_std": "RawPseudorangeUncertaintyMeters",
    "range_rate": "PseudorangeRateMetersPerSecond",
    "range_rate_std": "PseudorangeRateUncertaintyMetersPerSecond",
    "cn0": "Cn0DbHz",
}
_POSITION = tuple(f"SvPosition{axis}EcefMeters" for axis in "XYZ")
_VELOCITY = tuple(f"SvVelocity{axis}EcefMetersPerSecond" for axis in "XYZ")
_CLOCK, _DRIFT, _SIGNAL_BIAS = "SvClockBiasMeters", "SvClockDriftMetersPerSecond", "IsrbMeters"
_SYSTEMS = {"GPS": ("G", 0, 32), "GLO": ("R", 0, 32), "GAL": ("E", 0, 36), "BDS": ("C", 0, 63), "QZS": ("J", 192, 202)}
"""Letter, what Android adds to the number, and its largest number, by the first word of a signal's name."""
_CODES = {
    "L1": "1C",
    "E1": "1C",
    "G1": "1C",
    "J1": "1C",
    "B1I": "2I",
    "B1": "2I",
    "B1C": "1P",
    "L5": "5Q",
    "E5A": "5Q",
    "J5": "5Q",
    "B2A": "5P",
}
_CORRECTED = Applied.SATELLITE_CLOCK | Applied.RELATIVITY | Applied.GROUP_DELAY


def is_smartphone(head: str) -> bool:
    """Whether the beginning of a file is the header of such a table."""
    names = {name.strip() for name in head.split("\n", 1)[0].split(",")}
    return {_TIME, _PSEUDORANGE} <= names


def read_smartphone(path: str) -> Table:
    """A row per observation, columns as `importers.rows.ranges.range_rows` takes them. Raises LogError where one of the
    columns needed is missing."""
    text = parse_text(read_bytes(path), delimiter=",", header=True)
    index = {name: i for i, name in enumerate(text.names) if i in text.frame.columns}
    missing = [name for name in _NEEDED if name not in index]
    if missing:
        raise LogError(
            f"{path}: has no column {missing[0]}, or no rows; is it the device_gnss.csv of 2022 or later, and whole?"
        )
    wanted = {_TIME, "Svid", _PSEUDORANGE, *_PLAIN.values(), *_POSITION, *_VELOCITY, _CLOCK, _DRIFT, _SIGNAL_BIAS}
    numbers = {name: i for name, i in index.items() if name in wanted}
    selection = select_columns(text, numbers, {"SignalType": index["SignalType"]}, [_TIME])
    columns = _columns(selection)
    return Table(columns["t_gps_ns"], columns, selection.read, dict(selection.rejected))


def _columns(selection: Selection) -> dict[str, np.ndarray]:
    columns = selection.columns
    n = len(columns["SignalType"])
    unknown = np.full(n, np.nan)

    def values(name: str) -> np.ndarray:
        """The column of that name (n,), NaN where the file has none."""
        return columns.get(name, unknown).astype(np.float64)

    sat, signal = _satellites(columns["SignalType"], columns["Svid"])
    pos, vel = (np.column_stack([values(name) for name in names]) for names in (_POSITION, _VELOCITY))
    stated = np.isfinite(pos).all(axis=1) & np.isfinite(vel).all(axis=1) & np.isfinite(values(_CLOCK))
    out = {key: values(name) for key, name in _PLAIN.items()}
    out["pseudorange"] = values(_PSEUDORANGE) - np.nan_to_num(values(_SIGNAL_BIAS)) + np.where(stated, values(_CLOCK), 0.0)
    out["range_rate"] = out["range_rate"] + np.where(stated, np.nan_to_num(values(_DRIFT)), 0.0)
    out |= {"t_gps_ns": columns[_TIME].astype(np.int64), "sat": sat, "signal": signal, "sat_pos_e": pos, "sat_vel_e": vel}
    out["applied"] = np.where(stated, int(_CORRECTED), 0)
    return out


def _satellites(signals: np.ndarray, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Names and RINEX codes (n,) of signals such as ``GAL_E5A_Q`` and Android's numbers."""
    names = np.full(len(signals), "", dtype="U8")
    codes = np.full(len(signals), "", dtype="U2")
    for text in np.unique(signals.astype(str)):
        words = str(text).strip().upper().split("_")
        if words[0] not in _SYSTEMS:
            continue
        letter, added, last = _SYSTEMS[words[0]]
        own = np.flatnonzero(signals == text)
        own = own[np.isfinite(number[own].astype(np.float64)) & (number[own] <= last) & (number[own] > added)]
        names[own] = np.char.add(letter, (number[own].astype(np.int64) - added).astype("U4"))
        codes[own] = _CODES.get(words[1] if len(words) > 1 else "", "")
    return satellite_names(names), codes
