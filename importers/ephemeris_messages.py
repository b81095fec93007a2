"""Types and layouts that hold ephemerides, and their tables as ephemerides."""

from collections.abc import Callable, Mapping

import numpy as np

from importers.broadcast_words import decode_words
from importers.ephemeris import GLONASS, KEPLER, Ephemerides
from importers.log import Table
from importers.sp3 import precise_orbits
from navreplay.time_scales import LeapSeconds

__all__ = ["EPHEMERIS_TYPES"]

_CHANNEL_ZERO = 7

Reader = Callable[[Table, int, LeapSeconds], tuple[Ephemerides, Mapping[str, int]]]
"""Ephemerides of a table, and how many of its rows are of no use, by reason. The second argument is a GPS time near that of the
observations, by which weeks and days are told."""


def _rinex(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    kepler, glonass = table.columns["kepler"].astype(KEPLER), table.columns["glonass"].astype(GLONASS)
    klobuchar = table.columns["klobuchar"]
    known = klobuchar[np.isfinite(klobuchar).all(axis=1)]
    return (
        Ephemerides(kepler[kepler["sat"] != ""], glonass[glonass["sat"] != ""], known[-1] if len(known) else None),
        {},
    )


def _sp3(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    return Ephemerides(np.empty(0, KEPLER), np.empty(0, GLONASS), None, precise_orbits(table)), {}


def _words(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    gnss, number, frequency = (table.columns[name].astype(np.int64) for name in ("gnssId", "svId", "freqId"))
    words = table.columns["dwrd"].astype(np.int64)
    ephemerides, known = decode_words(gnss, number, frequency - _CHANNEL_ZERO, words, near_ns, leap)
    return ephemerides, {"message of another kind": int((~known).sum())} if not known.all() else {}


EPHEMERIS_TYPES: Mapping[str, Reader] = {
    "rinex/navigation": _rinex,
    "sp3": _sp3,
    "ubx/RXM-SFRBX": _words,
}
"""By type (without the ``/msg/`` of ROS 2)."""
