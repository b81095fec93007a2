"""Rows of pseudoranges before corrections: what every reader of raw GNSS observations delivers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import RangeColumns

__all__ = ["SYSTEMS", "Applied", "RangeRows", "join_range_rows", "range_rows", "satellite_names"]

SYSTEMS = "GRECJ"
"""RINEX letters of the systems that can be used: GPS, GLONASS, Galileo, BeiDou, QZSS."""

_OTHERS = "SI"
"""SBAS and NavIC, which are known but not used."""
_OPTIONAL = ("range_rate", "pseudorange_std", "range_rate_std", "cn0")


class Applied(IntFlag):
    """What is already in a pseudorange, or done to its satellite state. TURNED: the satellite stands in Earth-fixed axes of
    the time of reception. TURNED_BY_PSEUDORANGE: it was turned, but by pseudorange / c, receiver clock included."""

    SATELLITE_CLOCK = 1
    RELATIVITY = 2
    GROUP_DELAY = 4
    IONOSPHERE = 8
    TROPOSPHERE = 16
    TURNED = 32
    TURNED_BY_PSEUDORANGE = 64


@dataclass(frozen=True, eq=False, slots=True)
class RangeRows(RangeColumns):
    """Observations, one row per satellite signal and epoch, in any order; see `navreplay.timeline.RangeSeries`.

    sat is empty where the file names none that exists. sat_pos_e, sat_vel_e: NaN where the file has no satellite states.
    applied: (n,) of `Applied`.
    """

    applied: NDArray[np.int64]


def range_rows(columns: Mapping[str, np.ndarray]) -> RangeRows:
    """Rows of a table's columns, which are named as the fields of `RangeRows` (``t_gps_ns`` for the time); what is missing is
    unknown, and nothing is applied. Raises KeyError without time, satellite, signal or pseudorange."""
    n = len(columns["t_gps_ns"])
    unknown = np.full(n, np.nan)
    return RangeRows(
        t_ns=columns["t_gps_ns"].astype(np.int64),
        sat=columns["sat"].astype("U3"),
        signal=columns["signal"].astype("U2"),
        pseudorange=columns["pseudorange"].astype(np.float64),
        **{name: columns.get(name, unknown).astype(np.float64) for name in _OPTIONAL},
        sat_pos_e=columns.get("sat_pos_e", np.full((n, 3), np.nan)).astype(np.float64),
        sat_vel_e=columns.get("sat_vel_e", np.full((n, 3), np.nan)).astype(np.float64),
        applied=columns.get("applied", np.zeros(n)).astype(np.int64),
    )


def join_range_rows(parts: Sequence[RangeRows]) -> RangeRows:
    """The rows of all parts, one after the other."""
    return RangeRows(
        **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(RangeRows)}
    )


def satellite_names(names: np.ndarray) -> NDArray[np.str_]:
    """Names (n,) as RINEX writes them, ``G05`` for ``G5`` or ``g 5``; empty where there is no such satellite."""
    texts, inverse = np.unique(np.asarray(names).astype(str), return_inverse=True)
    return np.array([_satellite_name(str(text)) for text in texts], dtype="U3")[inverse]


def _satellite_name(text: str) -> str:
    system, number = text.strip()[:1].upper(), text.strip()[1:].strip()
    known = bool(system) and system in SYSTEMS + _OTHERS and number.isascii() and number.isdigit() and 0 < int(number) < 100
    return f"{system}{int(number):02d}" if known else ""
