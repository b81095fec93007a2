"""The Galileo I/NAV message. Source: Galileo OS SIS ICD 2.1, 4.3 and 5.1."""

import numpy as np
from numpy.typing import NDArray

from importers.broadcast.subframes import Bits, complete_sets, nearest_time
from importers.satellites.ephemeris import KEPLER

__all__ = ["decode_inav"]

_WEEK_NS = 604_800 * 10**9
_GST_BEHIND_GPS_WEEKS = 1024
_CRC_24Q = 0x1864CFB
_TIMING_WORD = 5
_ELEMENTS: tuple[dict[str, tuple[int, int, int, float, bool]], ...] = (
    {
        "toe_sow": (16, 14, 0, 60.0, False), "m0": (30, 32, -31, np.pi, True), "e": (62, 32, -33, 1.0, False),
        "sqrt_a": (94, 32, -19, 1.0, False),
    },
    {
        "omega0": (16, 32, -31, np.pi, True), "i0": (48, 32, -31, np.pi, True), "omega": (80, 32, -31, np.pi, True),
        "idot": (112, 14, -43, np.pi, True),
    },
    {
        "omega_dot": (16, 24, -43, np.pi, True), "delta_n": (40, 16, -43, np.pi, True), "cuc": (56, 16, -29, 1.0, True),
        "cus": (72, 16, -29, 1.0, True), "crc": (88, 16, -5, 1.0, True), "crs": (104, 16, -5, 1.0, True),
    },
    {
        "cic": (22, 16, -29, 1.0, True), "cis": (38, 16, -29, 1.0, True), "af0": (68, 31, -34, 1.0, True),
        "af1": (99, 21, -46, 1.0, True), "af2": (120, 6, -59, 1.0, True),
    },
)  # fmt: skip
"""Of word types 1 to 4: first bit, width, exponent of two, factor, signed."""


def decode_inav(
    number: NDArray[np.int64], words: NDArray[np.int64], near_ns: int
) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
    """Ephemerides of the satellites number (n,) from pages (n, 10) (even part in the first four words, odd part in the next),
    and which messages (n,) are whole pages. near_ns is not needed: the week counts to 4096."""
    pages = Bits.of_words(words[:, :8], [32] * 8, [0] * 8)
    nominal = (pages.whole(0, 2) == 0) & (pages.whole(128, 2) == 0b10)
    checked = pages.columns((0, 114), (128, 82), (210, 24)).packed()
    good = nominal & (_crc(checked) == 0)
    number = number[good]
    bits = pages.rows(good).columns((2, 112), (130, 16))
    part = bits.whole(0, 6)
    timing = _latest_timing(number, part)
    issue = np.where(np.isin(part, (1, 2, 3, 4)), bits.whole(6, 10), -1)
    sets = complete_sets(number.tolist(), part.tolist(), issue.tolist(), (1, 2, 3, 4))
    sets = sets[(timing[sets] >= 0).any(axis=1)] if len(sets) else sets
    records = np.zeros(len(sets), KEPLER)
    for column, elements in enumerate(_ELEMENTS):
        chosen = bits.rows(sets[:, column])
        for name, (first, width, exponent, factor, signed) in elements.items():
            records[name] = chosen.scaled(first, width, exponent, factor, signed)
    told = bits.rows(timing[sets].max(axis=1) if len(sets) else np.empty(0, dtype=np.intp))
    sent_ns = (told.whole(73, 12) + _GST_BEHIND_GPS_WEEKS) * _WEEK_NS + told.whole(85, 20) * 10**9
    records["toe_ns"] = nearest_time(records["toe_sow"], sent_ns)
    records["toc_ns"] = nearest_time(bits.rows(sets[:, 3]).whole(54, 14) * 60, sent_ns)
    records["tgd"] = np.column_stack([told.scaled(47, 10, -32), told.scaled(57, 10, -32)])
    # As RINEX packs them: E1-B data validity and signal health, and the same of E5b six bits up.
    records["health"] = told.whole(72, 1) | told.whole(69, 2) << 1 | told.whole(71, 1) << 6 | told.whole(67, 2) << 7
    records["sat"] = [f"E{value:02d}" for value in number[sets[:, 0]]]
    return records, good


def _latest_timing(number: NDArray[np.int64], part: NDArray[np.int64]) -> NDArray[np.intp]:
    """For each message the row of its satellite's word 5 before it, or else the first behind it; -1 where there is none."""
    rows = np.full(len(number), -1, dtype=np.intp)
    for value in np.unique(number):
        own = np.flatnonzero(number == value)
        timing = own[part[own] == _TIMING_WORD]
        if len(timing):
            rows[own] = timing[np.maximum(np.searchsorted(timing, own, side="right") - 1, 0)]
    return rows


def _crc(content: NDArray[np.uint8]) -> NDArray[np.int64]:
    """CRC-24Q of messages (n, k), which is zero for a message with its own checksum at the end."""
    table = np.arange(256, dtype=np.int64) << 16
    for _ in range(8):
        table = np.where(table & 0x800000, (table << 1) ^ _CRC_24Q, table << 1) & 0xFFFFFF
    crc = np.zeros(len(content), dtype=np.int64)
    for column in content.T:
        crc = ((crc << 8) & 0xFFFFFF) ^ table[(crc >> 16) ^ column]
    return crc
