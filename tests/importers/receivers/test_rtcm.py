"""RTCM 3 streams that RTKLIB encodes from RINEX give what the RINEX gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from importers import InputSettings, LogError, load_timeline, open_log
from synthetic_logs import SCENARIOS, simulate, with_duration, write

rtklib = pytest.importorskip("pyrtklib")
LOG = simulate(with_duration(SCENARIOS["ranges-open"], 3.0), 7)
_MESSAGES = (1077, 1097, 1127)
_EPHEMERIS = {"G": 1019, "E": 1046, "C": 1042}


def encoded(state: Any) -> bytes:
    return bytes(state.buff[place] for place in range(state.nbyte))


def ephemeris_frames(state: Any, nav: Any) -> bytes:
    frames = b""
    for place in range(nav.n):
        eph, text = nav.eph[place], rtklib.Arr1Dchar(4)
        rtklib.satno2id(eph.sat, text)
        for angle in ("M0", "OMG0", "omg"):  # the encoder does not wrap them
            setattr(eph, angle, (getattr(eph, angle) + np.pi) % (2 * np.pi) - np.pi)
        state.nav.eph[eph.sat - 1], state.ephsat, state.ephset = eph, eph.sat, 0
        if rtklib.gen_rtcm3(state, _EPHEMERIS[text[0][0]], 0, 0):
            frames += encoded(state)
    return frames


def epoch_frames(state: Any, obs: Any) -> bytes:
    frames, first = b"", 0
    while first < obs.n:
        time = obs.data[first].time
        same = [k for k in range(first, obs.n) if (obs.data[k].time.time, obs.data[k].time.sec) == (time.time, time.sec)]
        for place, k in enumerate(same):
            state.obs.data[place] = obs.data[k]
        state.obs.n, state.time = len(same), time
        for message in _MESSAGES:
            if rtklib.gen_rtcm3(state, message, 0, int(message != _MESSAGES[-1])):
                frames += encoded(state)
        first += len(same)
    return frames


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """log.obs, log.nav, their stream with ephemerides, and one without."""
    place = tmp_path_factory.mktemp("rtcm")
    write(LOG, place / "log.obs")
    obs, nav, station, state = rtklib.obs_t(), rtklib.nav_t(), rtklib.sta_t(), rtklib.rtcm_t()
    for name in ("log.obs", "log.nav"):
        assert rtklib.readrnx(str(place / name), 1, "", obs, nav, station) == 1
    rtklib.init_rtcm(state)
    state.time = obs.data[0].time
    ephemerides, epochs = ephemeris_frames(state, nav), epoch_frames(state, obs)
    rtklib.free_rtcm(state)
    (place / "log.rtcm3").write_bytes(b"$GNGGA,noise*00\r\n\xd3\x00" + ephemerides + epochs)
    (place / "epochs.rtcm3").write_bytes(epochs)
    return place


def test_a_stream_gives_what_its_rinex_gives(folder: Path) -> None:
    before = load_timeline([folder / "log.obs", folder / "log.nav"]).ranges
    after = load_timeline([folder / "log.rtcm3"]).ranges
    assert before is not None
    assert after is not None
    assert np.array_equal(before.t_ns, after.t_ns)
    assert np.array_equal(before.sat, after.sat)
    np.testing.assert_allclose(after.sat_pos_e, before.sat_pos_e, atol=10.0)
    np.testing.assert_allclose(after.range_rate, before.range_rate, atol=0.01)
    np.testing.assert_allclose(after.cn0, before.cn0, atol=0.05)
    raw = {}
    for name in ("log.obs", "log.rtcm3"):
        log = open_log(folder / name)
        channel = log.channels()[0].name
        columns = log.read((channel,))[channel].columns
        order = np.lexsort((columns["sat"], columns["t_gps_ns"]))
        raw[name] = columns["pseudorange"][order]
    np.testing.assert_allclose(raw["log.rtcm3"], raw["log.obs"], atol=1e-3)


def test_the_week_is_told_by_an_ephemeris_or_the_settings(folder: Path) -> None:
    with pytest.raises(LogError, match=r"without the week, and holds no GPS ephemeris; set input\.gps_week"):
        load_timeline([folder / "epochs.rtcm3"])
    week = int(LOG.ranges.t_ns[0]) // (604_800 * 10**9) if LOG.ranges is not None else 0
    ranges = load_timeline([folder / "epochs.rtcm3", folder / "log.nav"], InputSettings(gps_week=week)).ranges
    assert ranges is not None
    assert LOG.ranges is not None
    assert np.array_equal(np.unique(ranges.t_ns), np.unique(LOG.ranges.t_ns))


def test_a_wrong_checksum_costs_its_frame(folder: Path, tmp_path: Path) -> None:
    data = bytearray((folder / "epochs.rtcm3").read_bytes())
    data[20] ^= 1
    (tmp_path / "a.rtcm3").write_bytes(bytes(data))
    log = open_log(tmp_path / "a.rtcm3", InputSettings(gps_week=2304))
    assert log.notes == ("1 frames have a wrong checksum and were left out",)
    whole = open_log(folder / "epochs.rtcm3", InputSettings(gps_week=2304)).read(("MSM",))["MSM"]
    assert 0 < log.read(("MSM",))["MSM"].read < whole.read


GLONASS = """     3.04           N: GNSS NAV DATA    R: GLONASS          RINEX VERSION / TYPE
                                                            END OF HEADER
R03 2023 11 14 22 15 00-1.500000000000E-04 9.094947017729E-13 2.529000000000E+05
     7.003008300781E+03 7.835226058960E-01 9.313225746155E-10 0.000000000000E+00
    -1.220662597656E+04 2.804252624512E+00 0.000000000000E+00 5.000000000000E+00
     2.128076513672E+04 1.352500915527E+00-2.793967723846E-09 0.000000000000E+00
"""


def test_an_ephemeris_of_glonass_is_that_of_the_navigation_file(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "log.nav").write_text(GLONASS)
    obs, nav, station, state = rtklib.obs_t(), rtklib.nav_t(), rtklib.sta_t(), rtklib.rtcm_t()
    assert rtklib.readrnx(str(tmp_path / "log.nav"), 1, "", obs, nav, station) == 1
    rtklib.init_rtcm(state)
    eph = nav.geph[0] if nav.ng == 1 else nav.geph[2]
    state.nav.geph[2], state.ephsat, state.time = eph, eph.sat, eph.toe
    assert rtklib.gen_rtcm3(state, 1020, 0, 0) == 1
    frame = encoded(state)
    rtklib.free_rtcm(state)
    (tmp_path / "a.rtcm3").write_bytes(frame * 2)
    week = 2288
    read = open_log(tmp_path / "a.rtcm3", InputSettings(gps_week=week)).read(("ephemerides",))["ephemerides"]
    told = open_log(tmp_path / "log.nav").read(("log.nav",))["log.nav"]
    mine, theirs = read.columns["glonass"][0], told.columns["glonass"][0]
    assert mine["sat"] == theirs["sat"] == "R03"
    assert mine["channel"] == theirs["channel"]
    assert mine["tau"] == pytest.approx(theirs["tau"], abs=1e-9)
    assert mine["gamma"] == pytest.approx(theirs["gamma"], abs=1e-12)
    for name, tolerance in (("pos", 0.5), ("vel", 1e-3), ("acc", 1e-6)):
        np.testing.assert_allclose(mine[name], theirs[name], atol=tolerance)
