"""An encoder of BeiDou's D1 and D2 messages and of u-blox frames, written from the bit numbers of BDS-SIS-ICD-B1I-3.0 (5.2 and
5.3: bits of a subframe count from 1, parity included), without a look at the decoder."""

import struct
from collections.abc import Mapping

import numpy as np

__all__ = ["D2_FIELDS", "KLOBUCHAR", "KLOBUCHAR_BITS", "d1_subframe_1", "d2_pages", "frame", "sfrbx"]

_PREAMBLE = 0b11100010010
_Places = tuple[tuple[str, int, int], ...]
"""Name, first bit and width of pieces of fields, the highest bits first."""
_COEFFICIENTS = ("alpha0", "alpha1", "alpha2", "alpha3", "beta0", "beta1", "beta2", "beta3")
KLOBUCHAR_BITS = dict(zip(_COEFFICIENTS, (35, 28, -29, 44, 63, -23, 42, -29), strict=True))
"""Coefficients as numbers of their least bits, those of the sample's satellites."""
KLOBUCHAR = np.array(list(KLOBUCHAR_BITS.values())) * [2.0**e for e in (-30, -27, -24, -24, 11, 14, 16, 16)]
D2_FIELDS: dict[str, tuple[int, int, bool]] = {
    "week": (13, 0, False), "toc": (17, 3, False), "tgd1": (10, 0, True), "tgd2": (10, 0, True), "af0": (24, -33, True),
    "af1": (22, -50, True), "af2": (11, -66, True), "delta_n": (16, -43, True), "cuc": (18, -31, True),
    "m0": (32, -31, True), "cus": (18, -31, True), "e": (32, -33, False), "sqrt_a": (32, -19, False),
    "cic": (18, -31, True), "cis": (18, -31, True), "toe": (17, 3, False), "i0": (32, -31, True), "crc": (18, -6, True),
    "crs": (18, -6, True), "omega_dot": (24, -43, True), "omega0": (32, -31, True), "omega": (32, -31, True),
    "idot": (14, -43, True), "health": (1, 0, False),
}  # fmt: skip
"""Width, exponent of two, signed."""
_WIDTHS = {name: width for name, (width, _, _) in D2_FIELDS.items()} | dict.fromkeys(_COEFFICIENTS, 8)
_D2_PAGES: dict[int, _Places] = {
    1: (("health", 47, 1), ("week", 65, 13), ("toc", 78, 5), ("toc", 91, 12), ("tgd1", 103, 10), ("tgd2", 121, 10)),
    2: (
        ("alpha0", 47, 6), ("alpha0", 61, 2), ("alpha1", 63, 8), ("alpha2", 71, 8), ("alpha3", 79, 4), ("alpha3", 91, 4),
        ("beta0", 95, 8), ("beta1", 103, 8), ("beta2", 111, 2), ("beta2", 121, 6), ("beta3", 127, 8),
    ),
    3: (("af0", 101, 12), ("af0", 121, 12), ("af1", 133, 4)),
    4: (("af1", 47, 6), ("af1", 61, 12), ("af2", 73, 10), ("af2", 91, 1), ("delta_n", 97, 16), ("cuc", 121, 14)),
    5: (
        ("cuc", 47, 4), ("m0", 51, 2), ("m0", 61, 22), ("m0", 91, 8), ("cus", 99, 14), ("cus", 121, 4), ("e", 125, 10),
    ),
    6: (("e", 47, 6), ("e", 61, 16), ("sqrt_a", 77, 6), ("sqrt_a", 91, 22), ("sqrt_a", 121, 4), ("cic", 125, 10)),
    7: (
        ("cic", 47, 6), ("cic", 61, 2), ("cis", 63, 18), ("toe", 81, 2), ("toe", 91, 15), ("i0", 106, 7), ("i0", 121, 14),
    ),
    8: (
        ("i0", 47, 6), ("i0", 61, 5), ("crc", 66, 17), ("crc", 91, 1), ("crs", 92, 18), ("omega_dot", 110, 3),
        ("omega_dot", 121, 16),
    ),
    9: (
        ("omega_dot", 47, 5), ("omega0", 52, 1), ("omega0", 61, 22), ("omega0", 91, 9), ("omega", 100, 13),
        ("omega", 121, 14),
    ),
    10: (("omega", 47, 5), ("idot", 52, 1), ("idot", 61, 13)),
}  # fmt: skip
_D1_IONOSPHERE: _Places = (
    ("alpha0", 127, 8), ("alpha1", 135, 8), ("alpha2", 151, 8), ("alpha3", 159, 8), ("beta0", 167, 6), ("beta0", 181, 2),
    ("beta1", 183, 8), ("beta2", 191, 8), ("beta3", 199, 4), ("beta3", 211, 4),
)  # fmt: skip


def d2_pages(values: Mapping[str, int], first_sow: int) -> np.ndarray:
    """The ten pages (10, 10) of subframe 1 as words; values are numbers of the least bits. Whatever they do not hold is 1."""
    texts = _texts(values)
    pages = []
    for page, places in _D2_PAGES.items():
        texts |= {"page": format(page, "04b")}
        sow = (first_sow + 3 * (page - 1)) % 604_800
        pages.append(_words(1, sow, (("page", 43, 4), *places), texts))
    assert not any(texts.values()), "a field is not written to its end"
    return np.array(pages)


def d1_subframe_1(values: Mapping[str, int], sow: int) -> np.ndarray:
    """Words (1, 10) with the ionosphere's coefficients."""
    return np.array([_words(1, sow, _D1_IONOSPHERE, _texts(values))])


def sfrbx(satellite: int, words: np.ndarray, gnss: int = 3) -> bytes:
    """RXM-SFRBX messages of words (n, 10)."""
    head = bytes([gnss, satellite, 0, 0, 10, 0, 2, 0])
    return b"".join(frame(0x13, head + row.astype("<u4").tobytes()) for row in words)


def frame(kind: int, payload: bytes) -> bytes:
    """An RXM message with its checksum (interface description, 3.4)."""
    content = bytes([0x02, kind]) + struct.pack("<H", len(payload)) + payload
    first = second = 0
    for byte in content:
        first = (first + byte) & 255
        second = (second + first) & 255
    return b"\xb5\x62" + content + bytes([first, second])


def _texts(values: Mapping[str, int]) -> dict[str, str]:
    """Bits of each value, in two's complement."""
    return {name: format(value % 2 ** _WIDTHS[name], f"0{_WIDTHS[name]}b") for name, value in values.items()}


def _words(part: int, sow: int, places: _Places, texts: dict[str, str]) -> list[int]:
    """A subframe; what is written of texts is taken off them."""
    header: _Places = (("preamble", 1, 11), ("part", 16, 3), ("sow", 19, 8), ("sow", 31, 12))
    texts |= {"preamble": format(_PREAMBLE, "011b"), "part": format(part, "03b"), "sow": format(sow, "020b")}
    bits = ["1"] * 300
    for name, first, width in (*header, *places):
        bits[first - 1 : first - 1 + width] = texts[name][:width]
        texts[name] = texts[name][width:]
    assert len(bits) == 300, "a field is shorter than its places"
    return [int("".join(bits[i : i + 30]), 2) for i in range(0, 300, 30)]
