"""RANGE: pseudoranges and Doppler of NovAtel receivers."""

import numpy as np
from numpy.typing import NDArray

from importers.rows.ranges import satellite_names
from importers.rows.signals import SPEED_OF_LIGHT, carrier_hz
from navreplay.timeline import Times

__all__ = ["OBSERVATION", "observations"]

OBSERVATION = np.dtype(
    [("prn", "<u2"), ("channel", "<u2"), ("psr", "<f8"), ("psr_std", "<f4"), ("adr", "<f8"), ("adr_std", "<f4")]
    + [("doppler", "<f4"), ("cn0", "<f4"), ("locktime", "<f4"), ("tracking", "<u4")]
)
_SYSTEMS = {0: "G", 1: "R", 2: "S", 3: "E", 4: "C", 5: "J", 6: "I"}
_FIRST = {"R": 37, "J": 192, "S": 100}
_SIGNALS = {
    ("G", 0): "1C", ("G", 5): "2P", ("G", 9): "2W", ("G", 14): "5Q", ("G", 16): "1L", ("G", 17): "2S",
    ("R", 0): "1C", ("R", 1): "2C", ("R", 5): "2P", ("R", 6): "3Q",
    ("E", 2): "1C", ("E", 6): "6B", ("E", 7): "6C", ("E", 12): "5Q", ("E", 17): "7Q", ("E", 20): "8Q",
    ("C", 0): "2I", ("C", 1): "7I", ("C", 2): "6I", ("C", 4): "2I", ("C", 5): "7I", ("C", 6): "6I", ("C", 7): "1P",
    ("C", 9): "5P", ("C", 11): "7D",
    ("J", 0): "1C", ("J", 14): "5Q", ("J", 16): "1L", ("J", 17): "2S",
}  # fmt: skip
_CODE_LOCKED = 1 << 12
_CHANNEL_ZERO = 7


def observations(rows: NDArray[np.void], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns as `importers.rows.ranges.range_rows` takes them; a pseudorange without code lock is NaN."""
    tracking = rows["tracking"].astype(np.int64)
    keys = (((tracking >> 16) & 7) * 65_536 + rows["prn"]) * 32 + ((tracking >> 21) & 31)
    values, inverse = np.unique(keys, return_inverse=True)
    parts = [(_SYSTEMS.get(int(key) >> 21, "?"), (int(key) >> 5) & 65_535, int(key) & 31) for key in values]
    names = np.array([f"{system}{number - _FIRST.get(system, 0)}" for system, number, _ in parts] or [""])
    sat = satellite_names(names)[inverse]
    signal = np.array([_SIGNALS.get((system, kind), "") for system, _, kind in parts] or [""], dtype="U2")[inverse]
    wave = SPEED_OF_LIGHT / carrier_hz(sat, signal, rows["channel"].astype(np.float64) - _CHANNEL_ZERO)
    return {
        "t_gps_ns": t_ns,
        "sat": sat,
        "signal": signal,
        "pseudorange": np.where(tracking & _CODE_LOCKED, rows["psr"], np.nan),
        "range_rate": -rows["doppler"].astype(np.float64) * wave,
        "pseudorange_std": rows["psr_std"].astype(np.float64),
        "cn0": rows["cn0"].astype(np.float64),
    }
