"""The strings of the GLONASS navigation message. Source: GLONASS ICD L1, L2 edition 5.1, 4.4 and 4.5."""

import numpy as np
from numpy.typing import NDArray

from importers.broadcast.subframes import Bits, complete_sets
from importers.satellites.ephemeris import GLONASS
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc, utc_from_gps

__all__ = ["decode_strings"]

_DAY_NS = 86_400 * 10**9
_MOSCOW_NS = 3 * 3600 * 10**9
_QUARTER_NS = 15 * 60 * 10**9
_FOUR_YEARS_DAYS = 1461
_1996_UNIX_DAYS = 9496
_LAST_NUMBER = 32
_FRAME = (1, 2, 3, 4)


def decode_strings(
    number: NDArray[np.int64], channel: NDArray[np.int64], words: NDArray[np.int64], near_ns: int, leap: LeapSeconds
) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
    """Ephemerides of the satellites number (n,) with frequency numbers channel (n,) from words (n, 10), of which a string fills
    the first 85 bits, and which messages (n,) are strings. The four years that a day is counted in are those of near_ns."""
    good = (number >= 1) & (number <= _LAST_NUMBER) & (words[:, 0] >> 31 == 0)
    number, channel = number[good], channel[good]
    bits = Bits.of_words(words[good, :3], [32] * 3, [0] * 3)
    part = bits.whole(1, 4)
    sets = complete_sets(number.tolist(), part.tolist(), _frames(number, part).tolist(), _FRAME)
    one, two, three, four = (bits.rows(sets[:, column]) for column in range(4))
    records = np.zeros(len(sets), GLONASS)
    for axis, string in enumerate((one, two, three)):
        records["vel"][:, axis] = string.sign_magnitude(21, 24) * (2.0**-20 * 1e3)
        records["acc"][:, axis] = string.sign_magnitude(45, 5) * (2.0**-30 * 1e3)
        records["pos"][:, axis] = string.sign_magnitude(50, 27) * (2.0**-11 * 1e3)
    records["gamma"] = three.sign_magnitude(6, 11) * 2.0**-40
    records["tau"] = four.sign_magnitude(5, 22) * 2.0**-30
    records["channel"] = channel[sets[:, 0]]
    records["health"] = two.whole(5, 1) | three.whole(20, 1)
    records["toe_ns"] = _reference_time(two.whole(9, 7), four.whole(59, 11), near_ns, leap)
    records["sat"] = [f"R{value:02d}" for value in number[sets[:, 0]]]
    return records, good


def _frames(number: NDArray[np.int64], part: NDArray[np.int64]) -> NDArray[np.int64]:
    """A count per satellite that goes up with every string that does not follow its predecessor within a frame."""
    frame = np.zeros(len(number), dtype=np.int64)
    for value in np.unique(number):
        own = np.flatnonzero(number == value)
        frame[own] = np.cumsum(np.diff(part[own], prepend=0) != 1)
    return frame


def _reference_time(quarter: NDArray[np.int64], day: NDArray[np.int64], near_ns: int, leap: LeapSeconds) -> NDArray[np.int64]:
    """GPS time of quarters of an hour, by Moscow time, of days counted from 1 within four years."""
    near_utc_ns = int(utc_from_gps(np.array([near_ns]), leap)[0])
    in_period = _1996_UNIX_DAYS + day - 1
    periods = np.rint((near_utc_ns // _DAY_NS - in_period) / _FOUR_YEARS_DAYS).astype(np.int64)
    days = in_period + periods * _FOUR_YEARS_DAYS
    return gps_from_utc(days * _DAY_NS + quarter * _QUARTER_NS - _MOSCOW_NS, leap)
