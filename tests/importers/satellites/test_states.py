"""Satellites against RTKLIB (pyrtklib): states to the millimetre, decoded words to the last bit."""

from pathlib import Path

import numpy as np
import pytest

from importers.roles.ephemeris_messages import EPHEMERIS_TYPES
from importers.satellites.ephemeris import GLONASS, KEPLER, Ephemerides, nearest_records
from importers.satellites.glonass import glonass_states
from importers.satellites.kepler import kepler_states
from importers.satellites.precise import PreciseOrbits
from importers.satellites.states import FAULTS, satellite_states
from importers.ublox.stream import UbxLog
from navreplay.geodesy.time_scales import LEAP_SECONDS, week_tow_from_gps
from tests.helpers.paths import DATA

rtklib = pytest.importorskip("pyrtklib", reason="RTKLIB is the judge here")

SAMPLE = DATA / "walk_0827.ubx"
S = 10**9
RTKLIB_BUFFER = 11 * 38
RTKLIB_NAMES = {
    "e": "e", "i0": "i0", "omega0": "OMG0", "omega": "omg", "m0": "M0", "delta_n": "deln", "omega_dot": "OMGd", "idot": "idot",
    "crc": "crc", "crs": "crs", "cuc": "cuc", "cus": "cus", "cic": "cic", "cis": "cis", "toe_sow": "toes", "af0": "f0",
    "af1": "f1", "af2": "f2",
}  # fmt: skip


def words_of(sample: Path) -> dict[str, np.ndarray]:
    return dict(UbxLog(str(sample)).read(("RXM-SFRBX",))["RXM-SFRBX"].columns)


def decoded() -> Ephemerides:
    """The ephemerides in the stream: GPS, Galileo, BeiDou in medium and inclined orbits."""
    table = UbxLog(str(SAMPLE)).read(("RXM-SFRBX",))["RXM-SFRBX"]
    ephemerides, _ = EPHEMERIS_TYPES["ubx/RXM-SFRBX"](table, int(table.log_time_ns[0]), LEAP_SECONDS)
    return ephemerides


def with_geostationary(records: np.ndarray) -> np.ndarray:
    """Besides the records, a geostationary BeiDou satellite and a QZSS one of much the same elements."""
    geo = records[records["sat"] == "C21"].copy()
    geo["sat"], geo["sqrt_a"], geo["e"], geo["i0"] = "C03", 6493.4, 3e-4, 0.09
    quasi = records[:1].copy()
    quasi["sat"], quasi["sqrt_a"], quasi["e"] = "J02", 6493.2, 0.075
    return np.concatenate([records, geo, quasi])


def rtklib_time(t_ns: int) -> object:
    week, tow = week_tow_from_gps(np.array([t_ns]))
    return rtklib.gpst2time(int(week[0]), float(tow[0]))


def rtklib_kepler(record: np.void) -> object:
    eph = rtklib.eph_t()
    eph.sat = rtklib.satid2no(str(record["sat"]))
    eph.toe, eph.toc, eph.A = (
        rtklib_time(int(record["toe_ns"])),
        rtklib_time(int(record["toc_ns"])),
        float(record["sqrt_a"]) ** 2,
    )
    for own, name in RTKLIB_NAMES.items():
        setattr(eph, name, float(record[own]))
    return eph


@pytest.mark.parametrize("elapsed_s", [-5400.25, 0.0, 7100.5])
def test_kepler_positions_and_clocks_equal_those_of_rtklib(elapsed_s: float) -> None:
    records = with_geostationary(decoded().kepler)
    assert {"G", "E", "C", "J"} == set(records["sat"].astype("U1").tolist())
    t_ns = records["toe_ns"] + round(elapsed_s * S)
    pos, vel, clock, drift = kepler_states(records, np.arange(len(records)), t_ns, np.full(len(records), 0.075))
    for i, record in enumerate(records):
        place, offset, variance = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)
        moment = rtklib.timeadd(rtklib_time(int(t_ns[i])), -0.075)
        rtklib.eph2pos(moment, rtklib_kepler(record), place, offset, variance)
        assert np.abs(pos[i] - [place[k] for k in range(3)]).max() < 1e-3, record["sat"]
        assert abs(clock[i] - offset[0]) * 3e8 < 1e-4, record["sat"]
    late, early = (kepler_states(records, np.arange(len(records)), t_ns, np.full(len(records), 0.075 + h)) for h in (-0.5, 0.5))
    np.testing.assert_allclose(vel, late[0] - early[0], atol=2e-5)
    np.testing.assert_allclose(drift, late[2] - early[2], atol=1e-15)


@pytest.mark.parametrize("elapsed_s", [-1700.25, 30.0, 1799.0])
def test_glonass_positions_and_clocks_equal_those_of_rtklib(elapsed_s: float) -> None:
    record = np.zeros(1, GLONASS)
    record["sat"], record["toe_ns"] = "R05", 1_300_000_000 * S
    record["pos"], record["vel"] = [8.6e6, -2.05e7, 1.24e7], [-600.0, 1600.0, 3070.0]
    record["acc"], record["tau"], record["gamma"] = [1.9e-6, -9e-7, 2.8e-6], 3.4e-5, 1.8e-12
    t_ns = record["toe_ns"] + round(elapsed_s * S)
    pos, vel, clock, _ = glonass_states(record, np.zeros(1, dtype=np.intp), t_ns, np.array([0.07]))
    geph = rtklib.geph_t()
    geph.sat, geph.toe = rtklib.satid2no("R05"), rtklib_time(int(record["toe_ns"][0]))
    for k in range(3):
        geph.pos[k], geph.vel[k], geph.acc[k] = (float(record[name][0, k]) for name in ("pos", "vel", "acc"))
    geph.taun, geph.gamn = 3.4e-5, 1.8e-12
    place, offset, variance = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)
    rtklib.geph2pos(rtklib.timeadd(rtklib_time(int(t_ns[0])), -0.07), geph, place, offset, variance)
    assert np.abs(pos[0] - [place[k] for k in range(3)]).max() < 1e-3
    assert abs(clock[0] - offset[0]) * 3e8 < 1e-6
    ahead = glonass_states(record, np.zeros(1, dtype=np.intp), t_ns, np.array([0.07 - 0.01]))[0]
    np.testing.assert_allclose(vel, (ahead - pos) / 0.01, atol=0.01)


def rtklib_bytes(values: np.ndarray) -> object:
    """The bytes in a buffer as large as RTKLIB's own, for it looks at all parts of a message."""
    buffer = getattr(rtklib, "Arr1Dunsigned char")(RTKLIB_BUFFER)
    for i in range(RTKLIB_BUFFER):
        buffer[i] = int(values[i]) if i < len(values) else 0
    return buffer


def bits_of(words: np.ndarray, width: int) -> np.ndarray:
    return ((words[:, None] >> np.arange(width - 1, -1, -1)) & 1).astype(np.uint8).ravel()


def assert_same_elements(record: np.void, eph: object) -> None:
    for own, name in RTKLIB_NAMES.items():
        assert float(record[own]) == pytest.approx(getattr(eph, name), rel=1e-14, abs=1e-300), (record["sat"], own)
    assert float(record["sqrt_a"]) ** 2 == pytest.approx(eph.A, rel=1e-14)
    assert float(record["tgd"][0]) == pytest.approx(eph.tgd[0], rel=1e-14)
    assert int(record["health"]) == eph.svh


def test_gps_words_are_decoded_as_rtklib_does() -> None:
    columns, records = words_of(SAMPLE), decoded().kepler
    gps = records[records["sat"].astype("U1") == "G"]
    assert len(gps) == 4
    for record in gps:
        own = (columns["gnssId"] == 0) & (columns["svId"] == int(record["sat"][1:]))
        frames = np.zeros(150, np.uint8)
        for words in columns["dwrd"][own]:
            data = np.packbits(bits_of(words >> 6 & 0xFFFFFF, 24))
            part = int(data[5] >> 2 & 7)
            if part <= 3:  # RTKLIB would write the almanacs of the others beyond the one almanac it is given
                frames[(part - 1) * 30 : part * 30] = data
        eph = rtklib.eph_t()
        rtklib.decode_frame(rtklib_bytes(frames), eph, rtklib.alm_t(), rtklib.Arr1Ddouble(8), rtklib.Arr1Ddouble(8))
        assert_same_elements(record, eph)
        assert rtklib.timediff(eph.toe, rtklib_time(int(record["toe_ns"]))) == 0
        assert rtklib.timediff(eph.toc, rtklib_time(int(record["toc_ns"]))) == 0


def test_galileo_pages_are_decoded_as_rtklib_does() -> None:
    columns, records = words_of(SAMPLE), decoded().kepler
    galileo = records[records["sat"].astype("U1") == "E"]
    assert len(galileo) == 7
    for record in galileo:
        own = (columns["gnssId"] == 2) & (columns["svId"] == int(record["sat"][1:]))
        pages = np.zeros(16 * 7, np.uint8)
        for words in columns["dwrd"][own]:
            bits = bits_of(words[:8], 32)
            page = np.packbits(np.concatenate([bits[2:114], bits[130:146]]))
            if page[0] >> 2 <= 6:
                pages[int(page[0] >> 2) * 16 :][:16] = page
        eph = rtklib.eph_t()
        rtklib.decode_gal_inav(rtklib_bytes(pages), eph, rtklib.Arr1Ddouble(8), rtklib.Arr1Ddouble(8))
        assert_same_elements(record, eph)
        assert float(record["tgd"][1]) == pytest.approx(eph.tgd[1], rel=1e-14)
        assert rtklib.timediff(eph.toe, rtklib_time(int(record["toe_ns"]))) == 0


def test_beidou_words_are_decoded_as_rtklib_does() -> None:
    columns, records = words_of(SAMPLE), decoded().kepler
    beidou = records[records["sat"].astype("U1") == "C"]
    assert len(beidou) >= 7
    for record in beidou:
        own = (columns["gnssId"] == 3) & (columns["svId"] == int(record["sat"][1:]))
        words = columns["dwrd"][own]
        parts = (words[:, 0] >> 12 & 7).tolist()
        first = next(i for i in range(len(parts)) if parts[i : i + 3] == [1, 2, 3])
        frames = np.concatenate([np.packbits(bits_of(row, 30)) for row in words[first : first + 3]])
        eph = rtklib.eph_t()
        rtklib.decode_bds_d1(rtklib_bytes(frames), eph, rtklib.Arr1Ddouble(8), rtklib.Arr1Ddouble(8))
        assert_same_elements(record, eph)
        assert rtklib.timediff(eph.toe, rtklib_time(int(record["toe_ns"]))) == 0


def test_the_nearest_valid_record_is_taken_and_galileo_prefers_inav() -> None:
    records = np.zeros(5, KEPLER)
    records["sat"] = ["G01", "G01", "G01", "E02", "E02"]
    records["toe_ns"] = np.array([0, 7200, 7200, 3600, 3000]) * S
    records["fnav"] = [False, False, False, False, True]
    sat = np.array(["G01", "G01", "G01", "E02", "E03"])
    index, valid = nearest_records(records, sat, np.array([3000, 4000, 20000, 3000, 3000]) * S)
    assert index.tolist() == [0, 2, 2, 3, -1]
    assert valid.tolist() == [True, True, False, True, False]


def test_satellites_without_a_usable_ephemeris_are_told_apart() -> None:
    records = decoded().kepler[[0, 0, 0, 0]].copy()
    records["sat"] = ["G01", "G02", "G03", "G04"]
    records["health"][2] = 1
    records["sqrt_a"][3] = 1e9
    t_ns = np.full(5, records["toe_ns"][0])
    t_ns[1] += 3 * 3600 * S
    sat = np.array(["G01", "G02", "G03", "G04", "G05"])
    nothing = np.empty(0, GLONASS)
    states = satellite_states(Ephemerides(records, nothing), sat, np.full(5, "1C"), t_ns, np.full(5, 2.2e7))
    expected = ["", "ephemeris beyond its validity", "satellite unhealthy", "damaged ephemeris", "no ephemeris"]
    assert [FAULTS[code] for code in states.fault] == expected
    assert np.isfinite(states.pos[0]).all()
    assert np.isnan(states.pos[1:]).all()


def test_precise_orbits_equal_the_broadcast_ones_they_are_sampled_from() -> None:
    records = decoded().kepler[:2]
    start = int(records["toe_ns"][0])
    times = start + (np.arange(15) - 7) * 900 * S
    table = [kepler_states(records, np.full(15, i), times, np.zeros(15)) for i in (0, 1)]
    pos, clock = (np.stack([states[k] for states in table]) for k in (0, 2))
    precise = PreciseOrbits(times, records["sat"], pos, clock)
    sat, t_ns = records["sat"][[0, 1, 1]], start + np.array([100, 450, -3333]) * S
    found = precise.states(sat, t_ns, np.full(3, 0.07))
    expected = kepler_states(records, np.array([0, 1, 1]), t_ns, np.full(3, 0.07))
    assert np.abs(found[0] - expected[0]).max() < 0.02
    assert np.abs(found[1] - expected[1]).max() < 1e-3
    assert np.isnan(precise.states(np.array(["G40"]), t_ns[:1], np.zeros(1))[0]).all()
    assert np.isnan(precise.states(sat[:1], t_ns[:1] + 9000 * S, np.zeros(1))[0]).all()
