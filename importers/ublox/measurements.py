"""Raw measurements of u-blox receivers as pseudoranges, from the stream itself or from ROS messages.

Source: u-blox F9 HPG 1.32 interface description (UBX-22008968), 1.5 (identifiers) and 3.17.5 (RXM-RAWX).
"""

import numpy as np
from numpy.typing import NDArray

from importers.rows.ranges import satellite_names
from importers.rows.signals import SPEED_OF_LIGHT, carrier_hz
from navreplay.timeline import Times

__all__ = ["RAWX_BLOCK", "RAWX_HEAD", "UBX_SYSTEMS", "measurement_columns"]

RAWX_HEAD = np.dtype(
    [("rcvTow", "<f8"), ("week", "<u2"), ("leapS", "i1"), ("numMeas", "u1"), ("recStat", "u1"), ("rest", "V3")]
)
RAWX_BLOCK = np.dtype(
    [("prMes", "<f8"), ("cpMes", "<f8"), ("doMes", "<f4"), ("gnssId", "u1"), ("svId", "u1"), ("sigId", "u1"), ("freqId", "u1")]
    + [("locktime", "<u2"), ("cno", "u1"), ("prStdev", "u1"), ("cpStdev", "u1"), ("doStdev", "u1"), ("trkStat", "u1")]
    + [("rest", "u1")]
)
UBX_SYSTEMS = {0: "G", 1: "S", 2: "E", 3: "C", 5: "J", 6: "R"}
"""RINEX letters of the identifiers of systems."""

_SIGNALS = {
    (0, 0): "1C", (0, 3): "2L", (0, 4): "2S", (0, 6): "5I", (0, 7): "5Q",
    (2, 0): "1C", (2, 1): "1B", (2, 3): "5I", (2, 4): "5Q", (2, 5): "7I", (2, 6): "7Q", (2, 8): "6B", (2, 9): "6C",
    (3, 0): "2I", (3, 1): "2I", (3, 2): "7I", (3, 3): "7I", (3, 4): "6I", (3, 10): "6I", (3, 5): "1P", (3, 6): "1D",
    (3, 7): "5P", (3, 8): "5D",
    (5, 0): "1C", (5, 1): "1Z", (5, 4): "2S", (5, 5): "2L", (5, 8): "5I", (5, 9): "5Q",
    (6, 0): "1C", (6, 2): "2C",
}  # fmt: skip
_VALID, _STD_BITS = 1, 0x0F
_CHANNEL_ZERO = 7
_SBAS, _SBAS_FIRST = 1, 100


def measurement_columns(t_ns: Times, rows: NDArray[np.void]) -> dict[str, np.ndarray]:
    """Columns as `importers.rows.ranges.range_rows` takes them, of blocks (n,) of `RAWX_BLOCK` received at t_ns (n,). A
    pseudorange that the receiver does not vouch for is NaN."""
    gnss, space_vehicle, kind = (rows[name].astype(np.int64) for name in ("gnssId", "svId", "sigId"))
    keys = (gnss * 256 + space_vehicle) * 256 + kind
    values, inverse = np.unique(keys, return_inverse=True)
    sat = satellite_names(np.array([_name(int(key) >> 16, (int(key) >> 8) & 255) for key in values] or [""]))[inverse]
    signal = np.array([_SIGNALS.get((int(key) >> 16, int(key) & 255), "") for key in values] or [""], dtype="U2")[inverse]
    wave = SPEED_OF_LIGHT / carrier_hz(sat, signal, rows["freqId"].astype(np.float64) - _CHANNEL_ZERO)
    valid = (rows["trkStat"] & _VALID) != 0
    return {
        "t_gps_ns": t_ns,
        "sat": sat,
        "signal": signal,
        "pseudorange": np.where(valid, rows["prMes"], np.nan),
        "range_rate": -rows["doMes"].astype(np.float64) * wave,
        "pseudorange_std": 0.01 * 2.0 ** (rows["prStdev"] & _STD_BITS),
        "range_rate_std": 0.002 * 2.0 ** (rows["doStdev"] & _STD_BITS) * wave,
        "cn0": rows["cno"].astype(np.float64),
    }


def _name(system: int, number: int) -> str:
    return f"{UBX_SYSTEMS.get(system, '?')}{number - _SBAS_FIRST if system == _SBAS else number}"
