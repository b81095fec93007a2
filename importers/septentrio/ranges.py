"""MeasEpoch: pseudoranges and Doppler of the main signal of every satellite (the sub-blocks of type 1)."""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather, records
from importers.rows.ranges import satellite_names
from importers.rows.signals import SPEED_OF_LIGHT, carrier_hz
from navreplay.timeline import Times

__all__ = ["observations"]

_MAIN = np.dtype(
    [("channel", "u1"), ("type", "u1"), ("svid", "u1"), ("misc", "u1"), ("code", "<u4"), ("doppler", "<i4"), ("carrier", "<u2")]
    + [("carrier_high", "i1"), ("cn0", "u1"), ("lock", "<u2"), ("info", "u1"), ("others", "u1")]
)
_SATELLITES = (
    (1, 37, "G", 0), (38, 61, "R", 37), (63, 68, "R", 38), (71, 106, "E", 70), (120, 140, "S", 100), (141, 180, "C", 140),
    (181, 190, "J", 180), (198, 215, "S", 157), (223, 245, "C", 182),
)  # fmt: skip
"""First and last number of the receiver, system, and what to subtract."""
_SIGNALS = {
    0: "1C", 1: "1W", 2: "2W", 3: "2L", 4: "5Q", 5: "1L", 6: "1C", 7: "2L", 8: "1C", 9: "1P", 10: "2P", 11: "2C", 12: "3X",
    13: "1P", 14: "5P", 17: "1C", 19: "6C", 20: "5Q", 21: "7Q", 22: "8Q", 26: "5Q", 28: "2I", 29: "7I", 30: "6I", 32: "1L",
    34: "7D",
}  # fmt: skip
_EXTENDED, _GLONASS = 31, (8, 9, 10, 11, 12)
_FULL_SCALE_CN0 = (1, 2)
_HEAD = 6
_NO_DOPPLER = -(2**31)


def observations(buffer: Buffer, start: Offsets, size: NDArray[np.int64], t_ns: Times) -> dict[str, np.ndarray]:
    """Columns as `importers.rows.ranges.range_rows` takes them, of blocks at start (n,)."""
    message, place = _places(buffer, start, size)
    rows = records(buffer, place, _MAIN)
    kind = (rows["type"] & 31).astype(np.int64)
    kind = np.where(kind == _EXTENDED, (rows["info"] >> 3).astype(np.int64) + 32, kind)
    sat = satellite_names(np.array([_name(number) for number in range(256)]))[rows["svid"]]
    signal = np.array([_SIGNALS.get(number, "") for number in range(64)], dtype="U2")[kind]
    channel = np.where(np.isin(kind, _GLONASS), (rows["info"] >> 3).astype(np.float64) - 8, np.nan)
    wave = SPEED_OF_LIGHT / carrier_hz(sat, signal, channel)
    code = ((rows["misc"] & 15).astype(np.int64) << 32) + rows["code"]
    doppler = np.where(rows["doppler"] == _NO_DOPPLER, np.nan, rows["doppler"] * 1e-4)
    cn0 = np.where(rows["cn0"] == 255, np.nan, rows["cn0"] * 0.25 + np.where(np.isin(kind, _FULL_SCALE_CN0), 0.0, 10.0))
    return {
        "t_gps_ns": t_ns[message],
        "sat": sat,
        "signal": signal,
        "pseudorange": np.where(code > 0, code * 1e-3, np.nan),
        "range_rate": -doppler * wave,
        "cn0": cn0,
    }


def _places(buffer: Buffer, start: Offsets, size: NDArray[np.int64]) -> tuple[NDArray[np.int64], Offsets]:
    """Block and place of every sub-block of type 1; those of type 2 stand between them, so that they are found in turn."""
    head = gather(buffer, start, 3).astype(np.int64)
    left, width, width_2 = head[:, 0].copy(), head[:, 1], head[:, 2]
    left[width < _MAIN.itemsize] = 0
    at, end = start + _HEAD, start + size
    messages, places = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    while True:
        own = np.flatnonzero((left > 0) & (at + width <= end))
        if len(own) == 0:
            break
        messages.append(own)
        places.append(at[own])
        others = records(buffer, at[own], _MAIN)["others"].astype(np.int64)
        at[own] += width[own] + others * width_2[own]
        left[own] -= 1
    message, place = np.concatenate(messages), np.concatenate(places)
    order = np.argsort(place, kind="stable")
    return message[order], place[order]


def _name(number: int) -> str:
    return next((f"{system}{number - less}" for first, last, system, less in _SATELLITES if first <= number <= last), "")
