"""The BeiDou messages D1, of satellites in medium and inclined orbits, and D2, of geostationary ones.

Source: BDS-SIS-ICD-B1I-3.0, 5.2 and 5.3.
"""

import numpy as np
from numpy.typing import NDArray

from importers.broadcast.subframes import Bits, complete_sets, last_klobuchar, nearest_time
from importers.satellites.ephemeris import KEPLER
from navreplay.timeline import Floats

__all__ = ["decode_d1", "decode_d2"]

_PREAMBLE = 0b11100010010
_WEEK_NS = 604_800 * 10**9
_BDT_ZERO_NS = 1356 * _WEEK_NS + 14 * 10**9
_WEEK_S = 604_800
_D1_PERIOD_S = 30
_D1_PART_S = 6
_D2_PAGE_S = 3
_D2_WORDS = 5
_GEOSTATIONARY = (*range(1, 6), *range(59, 64))
_Elements = tuple[dict[str, tuple[int, int, int, float, bool]], ...]
"""First bit (parity left out), width, exponent of two, factor, signed."""
_D1_ELEMENTS: _Elements = (
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
"""Of subframes 1 to 3."""
_D2_PAGES = (1, 3, 4, 5, 6, 7, 8, 9, 10)
_D2_PIECES = ((38, 64), (80, 28), (42, 64), (42, 64), (42, 64), (42, 64), (42, 66), (42, 64), (42, 19))
"""First bit and width of what those pages of subframe 1 hold; fields run on from one page into the next."""
_D2_ELEMENTS: _Elements = (
    {
        "af0": (64, 24, -33, 1.0, True), "af1": (88, 22, -50, 1.0, True), "af2": (110, 11, -66, 1.0, True),
        "delta_n": (126, 16, -43, np.pi, True), "cuc": (142, 18, -31, 1.0, True), "m0": (160, 32, -31, np.pi, True),
        "cus": (192, 18, -31, 1.0, True), "e": (210, 32, -33, 1.0, False), "sqrt_a": (242, 32, -19, 1.0, False),
        "cic": (274, 18, -31, 1.0, True), "cis": (292, 18, -31, 1.0, True), "i0": (327, 32, -31, np.pi, True),
        "crc": (359, 18, -6, 1.0, True), "crs": (377, 18, -6, 1.0, True), "omega_dot": (395, 24, -43, np.pi, True),
        "omega0": (419, 32, -31, np.pi, True), "omega": (451, 32, -31, np.pi, True), "idot": (483, 14, -43, np.pi, True),
    },
)  # fmt: skip
"""Of those pages joined."""


def decode_d1(
    number: NDArray[np.int64], words: NDArray[np.int64], near_ns: int
) -> tuple[NDArray[np.void], Floats | None, NDArray[np.bool_]]:
    """Ephemerides of the satellites number (n,) from words (n, 10), the ionosphere's coefficients (8,) if they were sent, and
    which messages (n,) are subframes of this kind. near_ns is not needed: the week counts to 8192."""
    good = (words[:, 0] >> 19 == _PREAMBLE) & ~np.isin(number, _GEOSTATIONARY) & (words[:, 9] != 0)
    bits = Bits.of_words(words[good], [26, *[22] * 9], [4, *[8] * 9])
    number = number[good]
    part, sow = bits.whole(15, 3), bits.whole(18, 20)
    # Subframes carry no issue number; those of one frame follow each other within 30 s.
    frame = (sow - _D1_PART_S * (part - 1)) // _D1_PERIOD_S
    sets = complete_sets(number.tolist(), part.tolist(), frame.tolist(), (1, 2, 3))
    one, two, three = (bits.rows(sets[:, column]) for column in range(3))
    records = _records(number[sets[:, 0]], (one, two, three), _D1_ELEMENTS)
    records["toe_sow"] = (two.whole(222, 2) << 15 | three.whole(38, 15)) * 8
    sent_ns = one.whole(48, 13) * _WEEK_NS + one.whole(18, 20) * 10**9
    _set_times(records, sent_ns, one.whole(61, 17))
    records["tgd"] = np.column_stack([one.scaled(78, 10, 0, 1e-10), one.scaled(88, 10, 0, 1e-10)])
    records["health"] = one.whole(38, 1)
    return _without_repetitions(records), last_klobuchar(bits.rows(part == 1), 98), good


def decode_d2(
    number: NDArray[np.int64], words: NDArray[np.int64], near_ns: int
) -> tuple[NDArray[np.void], Floats | None, NDArray[np.bool_]]:
    """The same of geostationary satellites: ephemerides from ten pages of subframe 1, of which the first five words count."""
    good = (words[:, 0] >> 19 == _PREAMBLE) & np.isin(number, _GEOSTATIONARY) & (words[:, _D2_WORDS - 1] != 0)
    bits = Bits.of_words(words[good, :_D2_WORDS], [26, *[22] * (_D2_WORDS - 1)], [4, *[8] * (_D2_WORDS - 1)])
    number = number[good]
    page, sow = np.where(bits.whole(15, 3) == 1, bits.whole(38, 4), 0), bits.whole(18, 20)
    # Pages carry no issue number; those of one round follow each other every 3 s.
    first_sow = (sow - _D2_PAGE_S * (page - 1)) % _WEEK_S
    sets = complete_sets(number.tolist(), page.tolist(), first_sow.tolist(), _D2_PAGES)
    joined = Bits.side_by_side([bits.rows(rows).columns(piece) for rows, piece in zip(sets.T, _D2_PIECES, strict=True)])
    records = _records(number[sets[:, 0]], (joined,), _D2_ELEMENTS)
    records["toe_sow"] = joined.whole(310, 17) * 8
    sent_ns = joined.whole(14, 13) * _WEEK_NS + sow[sets[:, 0]] * 10**9
    _set_times(records, sent_ns, joined.whole(27, 17))
    records["tgd"] = np.column_stack([joined.scaled(44, 10, 0, 1e-10), joined.scaled(54, 10, 0, 1e-10)])
    records["health"] = joined.whole(4, 1)
    return _without_repetitions(records), last_klobuchar(bits.rows(page == 2), 42), good


def _records(number: NDArray[np.int64], parts: tuple[Bits, ...], elements: _Elements) -> NDArray[np.void]:
    """Records with the elements of each part."""
    records = np.zeros(len(number), KEPLER)
    records["sat"] = [f"C{value:02d}" for value in number]
    for bits, own in zip(parts, elements, strict=True):
        for name, (first, width, exponent, factor, signed) in own.items():
            records[name] = bits.scaled(first, width, exponent, factor, signed)
    return records


def _set_times(records: NDArray[np.void], sent_ns: NDArray[np.int64], toc: NDArray[np.int64]) -> None:
    """GPS times of ephemeris and clock, from the sending time [ns of BeiDou time] and toc [8 s]."""
    records["toe_ns"] = nearest_time(records["toe_sow"], sent_ns) + _BDT_ZERO_NS
    records["toc_ns"] = nearest_time(toc * 8, sent_ns) + _BDT_ZERO_NS


def _without_repetitions(records: NDArray[np.void]) -> NDArray[np.void]:
    _, rows = np.unique(records[["sat", "toe_ns", "af0", "m0"]], return_index=True)
    return records[np.sort(rows)]
