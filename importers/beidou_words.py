"""The BeiDou D1 message, of satellites in medium and inclined orbits. Source: BDS-SIS-ICD-B1I-3.0, 5.2.

Geostationary satellites send D2, which is laid out otherwise and is not decoded.
"""

import numpy as np
from numpy.typing import NDArray

from importers.ephemeris import KEPLER
from importers.subframes import Bits, complete_sets, nearest_time

__all__ = ["decode_d1"]

_PREAMBLE = 0b11100010010
_WEEK_NS = 604_800 * 10**9
_BDT_ZERO_NS = 1356 * _WEEK_NS + 14 * 10**9
_PERIOD_S = 30
_PART_S = 6
_GEOSTATIONARY = (*range(1, 6), *range(59, 64))
_ELEMENTS: tuple[dict[str, tuple[int, int, int, float, bool]], ...] = (
    {"af2": (162, 11, -66, 1.0, True), "af0": (173, 24, -33, 1.0, True), "af1": (197, 22, -50, 1.0, True)},
    {
        "delta_n": (38, 16, -43, np.pi, True), "cuc": (54, 18, -31, 1.0, True), "m0": (72, 32, -31, np.pi, True),
        "e": (104, 32, -33, 1.0, False), "cus": (136, 18, -31, 1.0, True), "crc": (154, 18, -6, 1.0, True),
        "crs": (172, 18, -6, 1.0, True), "sqrt_a": (190, 32, -19, 1.0, False),
    },
    {
        "i0": (53, 32, -31, np.pi, True), "cic": (85, 18, -31, 1.0, True), "omega_dot": (103, 24, -43, np.pi, True),
        "cis": (127, 18, -31, 1.0, True), "idot": (145, 14, -43, np.pi, True), "omega0": (159, 32, -31, np.pi, True),
        "omega": (191, 32, -31, np.pi, True),
    },
)  # fmt: skip
"""Of subframes 1 to 3: first bit (parity left out), width, exponent of two, factor, signed."""


def decode_d1(number: NDArray[np.int64], words: NDArray[np.int64], near_ns: int) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
    """Ephemerides of the satellites number (n,) from words (n, 10), and which messages (n,) are subframes of this kind. near_ns
    is not needed: the week counts to 8192."""
    good = (words[:, 0] >> 19 == _PREAMBLE) & ~np.isin(number, _GEOSTATIONARY) & (words[:, 9] != 0)
    bits = Bits.of_words(words[good], [26, *[22] * 9], [4, *[8] * 9])
    number = number[good]
    part, sow = bits.whole(15, 3), bits.whole(18, 20)
    # Subframes carry no issue number; those of one frame follow each other within 30 s.
    frame = (sow - _PART_S * (part - 1)) // _PERIOD_S
    sets = complete_sets(number.tolist(), part.tolist(), frame.tolist(), (1, 2, 3))
    records = np.zeros(len(sets), KEPLER)
    for column, elements in enumerate(_ELEMENTS):
        chosen = bits.rows(sets[:, column])
        for name, (first, width, exponent, factor, signed) in elements.items():
            records[name] = chosen.scaled(first, width, exponent, factor, signed)
    one, two, three = (bits.rows(sets[:, column]) for column in range(3))
    records["toe_sow"] = (two.whole(222, 2) << 15 | three.whole(38, 15)) * 8
    sent_ns = one.whole(48, 13) * _WEEK_NS + one.whole(18, 20) * 10**9
    records["toe_ns"] = nearest_time(records["toe_sow"], sent_ns) + _BDT_ZERO_NS
    records["toc_ns"] = nearest_time(one.whole(61, 17) * 8, sent_ns) + _BDT_ZERO_NS
    records["tgd"] = np.column_stack([one.scaled(78, 10, 0, 1e-10), one.scaled(88, 10, 0, 1e-10)])
    records["health"] = one.whole(38, 1)
    records["sat"] = [f"C{value:02d}" for value in number[sets[:, 0]]]
    _, rows = np.unique(records[["sat", "toe_ns", "af0", "m0"]], return_index=True)
    return records[np.sort(rows)], good
