"""ROS messages with raw GNSS data: gnss_comm and ublox_msgs.

gnss_comm (https://github.com/HKUST-Aerial-Robotics/gnss_comm) numbers satellites through the systems and gives GPS times;
ublox_msgs (https://github.com/KumarRobotics/ublox) passes on what the receiver sent, with names that differ between versions.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from importers.roles.range_epochs import flatten_epochs
from importers.rows.log import Table
from importers.rows.ranges import satellite_names
from importers.rows.signals import SPEED_OF_LIGHT, nearest_signal
from importers.satellites.ephemeris import GLONASS, KEPLER
from importers.ublox.measurements import RAWX_BLOCK, measurement_columns
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import Times

__all__ = ["gnss_comm_ephemerides", "gnss_comm_glonass", "gnss_comm_ranges", "sfrbx_columns", "ublox_ranges"]

_FIRST_NUMBER = {"G": 1, "R": 33, "E": 60, "C": 98}
_LAST_NUMBER = 160
_VALID = 1
_WORDS = 10
_NO_CHANNEL = 7
_KEPLER_OF = {
    "e": "e", "i0": "i0", "omg": "omega", "OMG0": "omega0", "M0": "m0", "delta_n": "delta_n", "OMG_dot": "omega_dot",
    "i_dot": "idot", "cuc": "cuc", "cus": "cus", "crc": "crc", "crs": "crs", "cic": "cic", "cis": "cis", "af0": "af0",
    "af1": "af1", "af2": "af2", "toe_tow": "toe_sow",
}  # fmt: skip
_BLOCK_OF = {
    "prmes": "prMes", "domes": "doMes", "gnssid": "gnssId", "svid": "svId", "sigid": "sigId", "reserved0": "sigId",
    "freqid": "freqId", "cno": "cno", "prstdev": "prStdev", "dostdev": "doStdev", "trkstat": "trkStat",
}  # fmt: skip


def gnss_comm_ranges(table: Table) -> Table:
    """``GnssMeasMsg``: a row per satellite and frequency."""

    def columns(observations: list[Any], message: np.ndarray) -> dict[str, np.ndarray]:
        """Columns of all observations; message (k,): the index of the message each came in."""
        counts = [len(item.psr) for item in observations]
        sat = np.repeat(_satellites(np.array([item.sat for item in observations], dtype=np.int64)), counts)
        weeks = np.array([item.time.week for item in observations], dtype=np.int64)
        times = gps_from_week_tow(weeks, _seconds(np.array([item.time.tow for item in observations])))
        carrier = _joined(observations, "freqs", counts)
        wave = SPEED_OF_LIGHT / np.where(carrier > 0, carrier, np.nan)
        valid = _joined(observations, "status", counts, _VALID).astype(np.int64) & _VALID
        return {
            "t_gps_ns": np.repeat(times, counts),
            "sat": sat,
            "signal": nearest_signal(sat, carrier),
            "pseudorange": np.where(valid, _joined(observations, "psr", counts), np.nan),
            "range_rate": -_joined(observations, "dopp", counts) * wave,
            "pseudorange_std": _joined(observations, "psr_std", counts),
            "range_rate_std": _joined(observations, "dopp_std", counts) * wave,
            "cn0": _joined(observations, "CN0", counts),
        }

    return flatten_epochs(table, [list(epoch) for epoch in table.columns["meas"]], columns)


def ublox_ranges(table: Table) -> Table:
    """``RxmRAWX``: a row per measurement."""
    own = {_plain(name): values for name, values in table.columns.items()}
    weeks, tow = own["week"].astype(np.int64), _seconds(own["rcvtow"].astype(np.float64))
    times = gps_from_week_tow(weeks, tow)

    def columns(blocks: list[Any], message: np.ndarray) -> dict[str, np.ndarray]:
        """Columns of all measurement blocks; message (k,): the index of the message each came in."""
        rows = np.zeros(len(blocks), RAWX_BLOCK)
        names = list(getattr(type(blocks[0]), "__dataclass_fields__", ())) if blocks else []
        for name in names:
            if _plain(name) in _BLOCK_OF:
                rows[_BLOCK_OF[_plain(name)]] = [getattr(block, name) for block in blocks]
        return measurement_columns(times[message], rows)

    return flatten_epochs(table, [list(epoch) for epoch in own["meas"]], columns)


def sfrbx_columns(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """``RxmSFRBX`` under the names of the receiver's description: ``gnssId``, ``svId``, ``freqId`` (n,), ``dwrd`` (n, 10)."""
    own = {_plain(name): values for name, values in columns.items()}
    n = len(own["gnssid"])
    words = np.zeros((n, _WORDS), dtype=np.int64)
    for row, some in enumerate(own["dwrd"]):
        words[row, : min(len(some), _WORDS)] = some[:_WORDS]
    frequency = own.get("freqid", np.full(n, _NO_CHANNEL))
    return {"gnssId": own["gnssid"], "svId": own["svid"], "freqId": frequency, "dwrd": words}


def gnss_comm_ephemerides(columns: Mapping[str, np.ndarray]) -> NDArray[np.void]:
    """``GnssEphemMsg`` as records (n,)."""
    records = np.zeros(len(columns["sat"]), KEPLER)
    records["sat"] = _satellites(columns["sat"].astype(np.int64))
    for name, own in _KEPLER_OF.items():
        records[own] = columns[name]
    records["sqrt_a"] = np.sqrt(np.maximum(columns["A"], 0.0))
    records["toe_ns"], records["toc_ns"] = _stamps(columns, "toe"), _stamps(columns, "toc")
    records["tgd"] = np.column_stack([columns["tgd0"], columns["tgd1"]])
    records["health"] = columns["health"]
    code = columns["code"].astype(np.int64)
    galileo = records["sat"].astype("U1") == "E"
    records["fnav"] = galileo & ((code & 0b10) != 0) & ((code & 0b101) == 0)
    return records[records["sat"] != ""]


def gnss_comm_glonass(columns: Mapping[str, np.ndarray]) -> NDArray[np.void]:
    """``GnssGloEphemMsg`` as records (n,)."""
    records = np.zeros(len(columns["sat"]), GLONASS)
    records["sat"] = _satellites(columns["sat"].astype(np.int64))
    records["toe_ns"] = _stamps(columns, "toe")
    for axis, letter in enumerate("xyz"):
        for name in ("pos", "vel", "acc"):
            records[name][:, axis] = columns[f"{name}_{letter}"]
    records["tau"], records["gamma"] = columns["tau_n"], columns["gamma"]
    records["channel"], records["health"] = columns["freqo"], columns["health"]
    return records[records["sat"] != ""]


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _seconds(tow: np.ndarray) -> np.ndarray:
    """Seconds of a week; what is none becomes a time long past."""
    return np.where((tow >= 0) & (tow < 604_801), tow, -1e9)


def _stamps(columns: Mapping[str, np.ndarray], name: str) -> Times:
    tow = _seconds(columns[f"{name}.tow"].astype(np.float64))
    return gps_from_week_tow(columns[f"{name}.week"].astype(np.int64), tow)


def _satellites(number: NDArray[np.int64]) -> NDArray[np.str_]:
    """Names of gnss_comm's numbers; empty where there is none."""
    names = np.full(len(number), "", dtype="U8")
    for system, first in _FIRST_NUMBER.items():
        names = np.where(number >= first, np.char.add(system, (number - first + 1).astype("U4")), names)
    return satellite_names(np.where((number > 0) & (number <= _LAST_NUMBER), names, ""))


def _joined(observations: Sequence[Any], name: str, counts: Sequence[int], missing: float = np.nan) -> np.ndarray:
    """One array of all observations, cut or filled up to the number of frequencies of each."""
    parts = []
    for item, count in zip(observations, counts, strict=True):
        values = np.asarray(getattr(item, name), dtype=np.float64)[:count]
        parts.append(values if len(values) == count else np.append(values, np.full(count - len(values), missing)))
    return np.concatenate(parts) if parts else np.empty(0)
