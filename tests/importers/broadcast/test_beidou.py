"""BeiDou's D2 message and the ionosphere's coefficients of D1, D2, LNAV and gnss_comm, from words of an encoder of its own."""

from pathlib import Path

import numpy as np
import pytest

from importers import InputSettings, load_timeline
from importers.broadcast.beidou import decode_d1, decode_d2
from importers.roles.ephemeris_messages import EPHEMERIS_TYPES
from importers.rows.log import Table
from importers.satellites.ephemeris import Ephemerides, join_ephemerides
from importers.satellites.kepler import kepler_states
from importers.ublox.stream import UbxLog
from navreplay.geodesy.time_scales import LEAP_SECONDS
from tests.helpers.beidou_words import D2_FIELDS, KLOBUCHAR, KLOBUCHAR_BITS, d1_subframe_1, d2_pages, sfrbx
from tests.helpers.paths import DATA
from tests.importers.conversion.test_range_fuzz import assert_told
from tests.importers.satellites.test_states import assert_same_elements, bits_of, rtklib_bytes, rtklib_time

SAMPLE = DATA / "walk_0827.ubx"
SOW = 408_642
WEEK = 1025
NOW_NS = ((WEEK + 1356) * 604_800 + SOW + 14) * 10**9
ANGLES = ("delta_n", "m0", "i0", "omega_dot", "omega0", "omega", "idot")
SEEDS = range(8)


def any_values(seed: int) -> dict[str, int]:
    """Bits of all fields by chance; times and week those of now, for they are told by each other."""
    random = np.random.default_rng(seed)
    values = {
        name: int(random.integers(-(2 ** (width - 1)), 2 ** (width - 1)) if signed else random.integers(2**width))
        for name, (width, _, signed) in D2_FIELDS.items()
    }
    hours = int(random.integers(-2, 2))
    return values | KLOBUCHAR_BITS | {"week": WEEK, "toe": (SOW // 3600 + hours) * 450, "toc": (SOW // 3600 + hours) * 450}


def value_of(name: str, bits: int) -> float:
    """In SI units and radians."""
    return bits * 2.0 ** D2_FIELDS[name][1] * (np.pi if name in ANGLES else 1.0)


def decoded(pages: np.ndarray, number: int = 3) -> np.ndarray:
    return decode_d2(np.full(len(pages), number), pages, NOW_NS)[0]


@pytest.mark.parametrize("seed", SEEDS)
def test_pages_of_d2_give_what_was_encoded(seed: int) -> None:
    values = any_values(seed)
    records, coefficients, known = decode_d2(np.full(10, 59), d2_pages(values, SOW), NOW_NS)
    (record,) = records
    assert known.all()
    assert record["sat"] == "C59"
    for name in set(D2_FIELDS) - {"week", "toe", "toc", "tgd1", "tgd2"}:
        assert float(record[name]) == pytest.approx(value_of(name, values[name]), rel=1e-15), name
    assert record["tgd"] == pytest.approx([values["tgd1"] * 1e-10, values["tgd2"] * 1e-10], rel=1e-15)
    assert record["toe_sow"] == values["toe"] * 8
    assert (record["toe_ns"] - NOW_NS) // 10**9 == values["toe"] * 8 - SOW
    assert record["toc_ns"] == record["toe_ns"]
    assert coefficients is not None
    np.testing.assert_array_equal(coefficients, KLOBUCHAR)


@pytest.mark.parametrize("seed", SEEDS)
def test_rtklib_reads_the_same_in_d2(seed: int) -> None:
    rtklib = pytest.importorskip("pyrtklib", reason="RTKLIB is the judge here")
    values = any_values(seed)
    # RTKLIB takes the first bit of e, which stands for 0.25, for a sign.
    pages = d2_pages(values | {"e": values["e"] % 2**31}, SOW)
    eph = rtklib.eph_t()
    packed = np.concatenate([np.packbits(bits_of(row, 30)) for row in pages])
    rtklib.decode_bds_d2(rtklib_bytes(packed), eph, rtklib.Arr1Ddouble(8))
    (record,) = decoded(pages)
    assert_same_elements(record, eph)
    assert float(record["tgd"][1]) == pytest.approx(eph.tgd[1], rel=1e-14)
    assert rtklib.timediff(eph.toe, rtklib_time(int(record["toe_ns"]))) == 0


def test_a_geostationary_satellite_of_the_stream_stands_still() -> None:
    elements = {"sqrt_a": 6493.4, "e": 3e-4, "i0": np.radians(5.0), "omega0": 2.1, "m0": 0.4}
    values = dict.fromkeys(D2_FIELDS, 0) | KLOBUCHAR_BITS | {"week": WEEK, "toe": SOW // 8, "toc": SOW // 8}
    values |= {name: round(value / value_of(name, 1)) for name, value in elements.items()}
    records = decoded(d2_pages(values, SOW))
    hours = np.arange(-2, 3) * 3600.0
    pos, vel, *_ = kepler_states(records, np.zeros(5, dtype=np.intp), records["toe_ns"].repeat(5), -hours)
    assert np.linalg.norm(pos, axis=1) == pytest.approx(np.full(5, 42_164e3), rel=1e-3)
    assert np.linalg.norm(pos - pos[2], axis=1).max() < 4e6
    assert np.linalg.norm(vel, axis=1).max() < 400


def test_pages_of_two_rounds_and_two_satellites_do_not_mix() -> None:
    values = any_values(1)
    first, second = d2_pages(values, SOW), d2_pages(values, SOW + 30)
    assert len(decoded(np.concatenate([np.delete(first, 4, axis=0), second[4:5]]))) == 0
    assert len(decoded(np.concatenate([first[:5], second, first[5:]]))) == 1
    number = np.array([3] * 5 + [4] * 5)
    assert len(decode_d2(number, first, NOW_NS)[0]) == 0
    assert len(decode_d1(np.full(10, 3), first, NOW_NS)[0]) == 0
    assert not decode_d2(np.full(10, 21), first, NOW_NS)[2].any()


def test_a_round_across_the_end_of_the_week_is_one() -> None:
    (record,) = decoded(d2_pages(any_values(1) | {"toe": 0, "toc": 0}, 604_788))
    assert record["toe_ns"] == (WEEK + 1357) * 604_800 * 10**9 + 14 * 10**9


def test_d1_tells_the_ionosphere() -> None:
    _, coefficients, known = decode_d1(np.array([21]), d1_subframe_1(KLOBUCHAR_BITS, SOW), NOW_NS)
    assert known.all()
    assert coefficients is not None
    np.testing.assert_array_equal(coefficients, KLOBUCHAR)


def gps_page_18() -> np.ndarray:
    """Words (1, 10) of subframe 4, page 18 (IS-GPS-200N, figure 20-1 sheet 8): coefficients 1 to 8 of their least bits."""
    words = [0x8B << 22, 4 << 8, (0b01 << 6 | 56) << 22 | 1 << 14 | 2 << 6]
    words += [3 << 22 | 4 << 14 | 5 << 6, 6 << 22 | 7 << 14 | 8 << 6, *[0b10 << 6] * 5]
    return np.array([words])


def test_the_stream_brings_beidous_ionosphere_unless_it_has_that_of_gps(tmp_path: Path) -> None:
    timeline = load_timeline([SAMPLE])
    assert timeline.ranges is not None
    assert timeline.ranges.klobuchar is not None
    assert timeline.ranges.klobuchar_system == "C"
    np.testing.assert_array_equal(timeline.ranges.klobuchar, KLOBUCHAR)
    assert any("told by BeiDou's broadcast model" in note for note in timeline.provenance.assumptions)
    path = tmp_path / "a.ubx"
    path.write_bytes(SAMPLE.read_bytes() + sfrbx(10, gps_page_18(), gnss=0))
    timeline = load_timeline([path])
    assert timeline.ranges is not None
    assert timeline.ranges.klobuchar is not None
    assert timeline.ranges.klobuchar_system == "G"
    least = [2.0**exponent for exponent in (-30, -27, -24, -24, 11, 14, 16, 16)]
    np.testing.assert_array_equal(timeline.ranges.klobuchar, np.arange(1, 9) * least)
    assert any("told by GPS's broadcast model" in note for note in timeline.provenance.assumptions)


def test_of_several_logs_the_ionosphere_of_gps_goes_first() -> None:
    nothing = join_ephemerides([])
    parts = [
        Ephemerides(nothing.kepler, nothing.glonass, np.full(8, float(i)), system)
        for i, system in enumerate(("C", "G", "G", "C"))
    ]
    chosen = join_ephemerides(parts)
    assert chosen.klobuchar is not None
    assert (chosen.klobuchar[0], chosen.klobuchar_system) == (2.0, "G")
    assert join_ephemerides(parts[3:]).klobuchar_system == "C"
    assert nothing.klobuchar is None


def test_an_ionosphere_message_counts_only_with_eight_numbers() -> None:
    data = np.empty(3, dtype=object)
    data[:] = [KLOBUCHAR, KLOBUCHAR[:7], np.full(8, np.nan)]
    table = Table(np.zeros(3, dtype=np.int64), {"data": data}, 3, {})
    ephemerides, useless = EPHEMERIS_TYPES["gnss_comm/StampedFloat64Array"](table, NOW_NS, LEAP_SECONDS)
    assert ephemerides.klobuchar is not None
    np.testing.assert_array_equal(ephemerides.klobuchar, KLOBUCHAR)
    assert useless == {"not eight numbers": 2}


def ephemerides_of(path: Path) -> tuple[Ephemerides, int]:
    """Of a stream of navigation data, and how many of its messages say nothing."""
    table = UbxLog(str(path)).read(("RXM-SFRBX",))["RXM-SFRBX"]
    ephemerides, useless = EPHEMERIS_TYPES["ubx/RXM-SFRBX"](table, NOW_NS, LEAP_SECONDS)
    return ephemerides, sum(useless.values()) + sum(table.rejected.values())


@pytest.mark.parametrize("seed", SEEDS)
def test_a_cut_or_disturbed_stream_of_d2_loses_only_that_round(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    rounds = [sfrbx(3, d2_pages(any_values(i) | {"toe": 51_000 + i, "toc": 51_000 + i}, SOW + 30 * i)) for i in range(3)]
    path = tmp_path / "a.ubx"
    path.write_bytes(b"".join(rounds))
    assert len(ephemerides_of(path)[0].kepler) == 3
    cut = rounds[0] + rounds[1] + rounds[2][: int(random.integers(len(rounds[2])))]
    path.write_bytes(cut)
    assert len(ephemerides_of(path)[0].kepler) == 2
    # Page 2 brings no elements: any other page is one too few.
    page, place = int(random.choice([0, *range(2, 10)])), int(random.integers(6, 50))
    damaged = bytearray(rounds[1])
    damaged[page * 56 + place] ^= int(random.integers(1, 256))
    path.write_bytes(rounds[0] + bytes(damaged) + rounds[2])
    ephemerides, lost = ephemerides_of(path)
    assert len(ephemerides.kepler) == 2
    assert lost == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_d2_of_any_content_beside_ranges_ends_in_a_timeline_or_one_line(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    pages = np.concatenate([d2_pages(any_values(seed + i), SOW + 30 * i) for i in range(3)])
    pages ^= np.where(random.random(pages.shape) < 0.05, random.integers(0, 2**30, pages.shape), 0)
    stream = bytearray(sfrbx(int(random.integers(1, 64)), pages) + sfrbx(10, gps_page_18(), gnss=0))
    for place in random.integers(0, len(stream), int(random.integers(0, 5))).tolist():
        stream[place] ^= 255
    path = tmp_path / "a.ubx"
    path.write_bytes(bytes(stream) + SAMPLE.read_bytes()[: int(random.integers(200, 40_000))])
    assert_told([path], InputSettings())
