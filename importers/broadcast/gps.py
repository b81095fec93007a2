"""The GPS and QZSS legacy navigation message (LNAV). Source: IS-GPS-200N, 20.3.3 (figure 20-1, tables 20-I to 20-III and 20-X);
IS-QZSS-PNT-005."""

import numpy as np
from numpy.typing import NDArray

from importers.broadcast.subframes import Bits, complete_sets, last_klobuchar, nearest_time
from importers.satellites.ephemeris import KEPLER
from navreplay.timeline import Floats

__all__ = ["decode_lnav"]

_PREAMBLE = 0x8B
_IONOSPHERE_PAGE = {"G": 56, "J": 61}
_WEEK_NS = 604_800 * 10**9
_SIX_SECONDS_NS = 6 * 10**9
_ELEMENTS: tuple[dict[str, tuple[int, int, int, float, bool]], ...] = (
    {"af2": (192, 8, -55, 1.0, True), "af1": (200, 16, -43, 1.0, True), "af0": (216, 22, -31, 1.0, True)},
    {
        "crs": (56, 16, -5, 1.0, True), "delta_n": (72, 16, -43, np.pi, True), "m0": (88, 32, -31, np.pi, True),
        "cuc": (120, 16, -29, 1.0, True), "e": (136, 32, -33, 1.0, False), "cus": (168, 16, -29, 1.0, True),
        "sqrt_a": (184, 32, -19, 1.0, False), "toe_sow": (216, 16, 4, 1.0, False),
    },
    {
        "cic": (48, 16, -29, 1.0, True), "omega0": (64, 32, -31, np.pi, True), "cis": (96, 16, -29, 1.0, True),
        "i0": (112, 32, -31, np.pi, True), "crc": (144, 16, -5, 1.0, True), "omega": (160, 32, -31, np.pi, True),
        "omega_dot": (192, 24, -43, np.pi, True), "idot": (224, 14, -43, np.pi, True),
    },
)  # fmt: skip
"""Of subframes 1 to 3: first bit (parity left out), width, exponent of two, factor, signed."""


def decode_lnav(
    letter: str, number: NDArray[np.int64], words: NDArray[np.int64], near_ns: int
) -> tuple[NDArray[np.void], Floats | None, NDArray[np.bool_]]:
    """Ephemerides of the satellites number (n,) from words (n, 10), Klobuchar's coefficients (8,) if they were sent, and which
    messages (n,) are subframes of this kind."""
    good = (words[:, 0] >> 22 == _PREAMBLE) & (words[:, 9] != 0)
    bits = Bits.of_words(words[good], [24] * 10, [6] * 10)
    number = number[good]
    part = bits.whole(43, 3)
    page = bits.whole(50, 6)
    ionosphere = (part == 4) & (page == _IONOSPHERE_PAGE[letter]) & (bits.whole(48, 2) != 0)
    issue = np.select([part == 1, part == 2, part == 3], [bits.whole(168, 8), bits.whole(48, 8), bits.whole(216, 8)], -1)
    sets = complete_sets(number.tolist(), part.tolist(), issue.tolist(), (1, 2, 3))
    records = np.zeros(len(sets), KEPLER)
    for column, elements in enumerate(_ELEMENTS):
        chosen = bits.rows(sets[:, column])
        for name, (first, width, exponent, factor, signed) in elements.items():
            records[name] = chosen.scaled(first, width, exponent, factor, signed)
    one = bits.rows(sets[:, 0])
    # Week numbers count modulo 1024: the sending time of subframe 1 is the one nearest to the log among them.
    sent_ns = one.whole(48, 10) * _WEEK_NS + one.whole(24, 17) * _SIX_SECONDS_NS
    cycle_ns = 1024 * _WEEK_NS
    sent_ns = sent_ns + np.rint((near_ns - sent_ns) / cycle_ns).astype(np.int64) * cycle_ns
    records["toc_ns"] = nearest_time(one.whole(176, 16) * 16, sent_ns)
    records["toe_ns"] = nearest_time(records["toe_sow"], sent_ns)
    records["tgd"][:, 0] = one.scaled(160, 8, -31)
    records["health"] = one.whole(64, 6)
    records["sat"] = [f"{letter}{value:02d}" for value in number[sets[:, 0]]]
    return records, last_klobuchar(bits.rows(ionosphere), 56), good
