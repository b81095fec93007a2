"""Broadcast navigation data, as u-blox receivers pass it on, decoded into ephemerides.

Words are those of RXM-SFRBX: 30-bit words of GPS, QZSS and BeiDou right-aligned, data bits upright; pages of Galileo I/NAV and
strings of GLONASS left-aligned in 32-bit words. Weeks are told by a time near the log's, for GPS repeats them every 1024.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from importers.broadcast.beidou import decode_d1, decode_d2
from importers.broadcast.galileo import decode_inav
from importers.broadcast.glonass import decode_strings
from importers.broadcast.gps import decode_lnav
from importers.satellites.ephemeris import Ephemerides
from navreplay.geodesy.time_scales import LeapSeconds

__all__ = ["decode_words"]

_GPS, _GALILEO, _BEIDOU, _QZSS, _GLONASS = 0, 2, 3, 5, 6
_KEPLER_DECODERS = (
    (_GPS, "G", partial(decode_lnav, "G")),
    (_QZSS, "G", partial(decode_lnav, "J")),
    (_BEIDOU, "C", decode_d1),
    (_BEIDOU, "C", decode_d2),
)
"""By system: whose ionosphere model it sends, and what decodes its messages."""


def decode_words(
    gnss: NDArray[np.int64],
    number: NDArray[np.int64],
    frequency: NDArray[np.int64],
    words: NDArray[np.int64],
    near_ns: int,
    leap: LeapSeconds,
) -> tuple[Ephemerides, NDArray[np.bool_]]:
    """Ephemerides of messages in the order of their reception, and which of these (n,) are of a kind that can be decoded.

    gnss: (n,) identifier of the system; number: (n,) of the satellite; frequency: (n,) GLONASS frequency number; words: (n,
    10).
    """
    known = np.zeros(len(gnss), dtype=bool)
    klobuchar, model = None, "G"
    rows = np.flatnonzero(gnss == _GALILEO)
    records, good = decode_inav(number[rows], words[rows], near_ns)
    known[rows[good]] = True
    kepler = [records]
    for system, letter, decode in _KEPLER_DECODERS:
        rows = np.flatnonzero(gnss == system)
        records, coefficients, good = decode(number[rows], words[rows], near_ns)
        known[rows[good]] = True
        kepler.append(records)
        if klobuchar is None and coefficients is not None:
            klobuchar, model = coefficients, letter
    rows = np.flatnonzero(gnss == _GLONASS)
    glonass, good = decode_strings(number[rows], frequency[rows], words[rows], near_ns, leap)
    known[rows[good]] = True
    return Ephemerides(np.concatenate(kepler), glonass, klobuchar, model), known
