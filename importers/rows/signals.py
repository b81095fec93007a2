"""Signals: carriers, and which signal of a satellite is preferred. Codes and carriers: RINEX 4.01, tables 4 to 10."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from navreplay.timeline import Floats

__all__ = ["DEFAULT_SIGNALS", "SPEED_OF_LIGHT", "carrier_hz", "nearest_signal", "rank_signals"]

SPEED_OF_LIGHT = 299_792_458.0
"""[m/s]."""

DEFAULT_SIGNALS: Mapping[str, tuple[str, ...]] = {
    "G": ("1C", "1L", "1X", "1S", "1P", "1W", "1Y"),
    "R": ("1C", "1P"),
    "E": ("1C", "1X", "1B"),
    "C": ("2I", "2X", "2Q", "1I", "1P", "1X", "1D"),
    "J": ("1C", "1L", "1X", "1S", "1Z", "1B"),
}
"""By system, the signals used where a satellite has several, best first: L1, E1, B1."""

_MHZ = {
    "G": {"1": 1575.42, "2": 1227.60, "5": 1176.45},
    "R": {"1": 1602.0, "2": 1246.0, "3": 1202.025, "4": 1600.995, "6": 1248.06},
    "E": {"1": 1575.42, "5": 1176.45, "6": 1278.75, "7": 1207.14, "8": 1191.795},
    "C": {"1": 1575.42, "2": 1561.098, "5": 1176.45, "6": 1268.52, "7": 1207.14, "8": 1191.795},
    "J": {"1": 1575.42, "2": 1227.60, "5": 1176.45, "6": 1278.75},
}
_B1I_OF_RINEX_302 = "1I"
_BAND_HZ = 5e6
_GLONASS_STEP_MHZ = {"1": 0.5625, "2": 0.4375}


def carrier_hz(sat: np.ndarray, signal: np.ndarray, glonass_channel: np.ndarray | None = None) -> Floats:
    """Carriers (n,) [Hz] of the signals (n,) of satellites (n,), NaN where unknown. glonass_channel: (n,) -7 to 6, NaN where
    unknown, read for GLONASS only."""
    keys = np.char.add(sat.astype("U1"), signal.astype("U2"))
    texts, inverse = np.unique(keys, return_inverse=True)
    mhz = np.array([_carrier_mhz(str(text)) for text in texts])[inverse]
    step = np.array([_GLONASS_STEP_MHZ.get(str(text)[1:2], 0.0) if text.startswith("R") else 0.0 for text in texts])[inverse]
    channel = np.full(len(sat), np.nan) if glonass_channel is None else glonass_channel
    return np.asarray((mhz + np.where(step > 0, step * channel, 0.0)) * 1e6)


def _carrier_mhz(key: str) -> float:
    band = "2" if key[:1] == "C" and key[1:] == _B1I_OF_RINEX_302 else key[1:2]
    return _MHZ.get(key[:1], {}).get(band, np.nan)


def rank_signals(sat: np.ndarray, signal: np.ndarray, preferred: Mapping[Any, Sequence[str]]) -> np.ndarray:
    """Place (n,) of each signal (n,) among those preferred for the satellite's system, 0 the best; -1 where it is not among
    them. Systems without an entry have that of `DEFAULT_SIGNALS`."""
    order = {system: list(preferred.get(system) or signals) for system, signals in DEFAULT_SIGNALS.items()}
    keys = np.char.add(sat.astype("U1"), signal.astype("U2"))
    texts, inverse = np.unique(keys, return_inverse=True)
    ranks = [order[text[0]].index(text[1:]) if text[:1] in order and text[1:] in order[text[0]] else -1 for text in texts]
    return np.array(ranks, dtype=np.int64)[inverse]


def nearest_signal(sat: np.ndarray, carrier: Floats) -> np.ndarray:
    """Codes (n,) of the usual signal on carriers (n,) [Hz] of satellites (n,): that of `DEFAULT_SIGNALS` where the band has
    one, else the band with ``X``; empty where there is no such band."""
    out = np.full(len(sat), "", dtype="U2")
    system = sat.astype("U1")
    for name, bands in _MHZ.items():
        codes = [next((code for code in DEFAULT_SIGNALS[name] if code[0] == band), f"{band}X") for band in bands]
        centres = np.array(list(bands.values())) * 1e6
        rows = np.flatnonzero((system == name) & np.isfinite(carrier))
        apart = np.abs(carrier[rows, None] - centres)
        nearest = apart.argmin(axis=1)
        close = apart[np.arange(len(rows)), nearest] < _BAND_HZ
        out[rows[close]] = np.array(codes)[nearest[close]]
    return out
