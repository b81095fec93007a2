"""NMEA as receivers, phones and loggers really write it."""

import numpy as np
import pytest

from importers import load_timeline, open_log
from importers.nmea.sentences import is_nmea
from importers.settings import InputSettings
from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import FixStatus, LogError

N = 20
FIRST = np.datetime64("2023-11-14T22:13:20", "ns").astype(np.int64)


def summed(body):
    parity = 0
    for letter in body.encode():
        parity ^= letter
    return f"${body}*{parity:02X}"


def clock(i, start=22 * 3600 + 13 * 60 + 20):
    second = (start + 0.2 * i) % 86400
    return f"{int(second // 3600):02d}{int(second // 60 % 60):02d}{second % 60:05.2f}"


def gga(i, talker="GN", height="499.00", geoid="46.0", start=22 * 3600 + 13 * 60 + 20):
    return f"{talker}GGA,{clock(i, start)},4812.{i:04d},N,01136.0000,E,4,12,0.8,{height},M,{geoid},M,,"


def rmc(i, date="141123", start=22 * 3600 + 13 * 60 + 20):
    return f"GNRMC,{clock(i, start)},A,4812.{i:04d},N,01136.0000,E,10.000,90.00,{date},,,A"


def gns(i):
    return f"GNGNS,{clock(i)},4812.{i:04d},N,01136.0000,E,RR,12,0.8,499.00,46.0,,"


def zda(i):
    return f"GNZDA,{clock(i)},14,11,2023,00,00"


def gst(i):
    return f"GNGST,{clock(i)},1.0,,,,0.02,0.03,0.05"


def vtg(i):
    return "GNVTG,90.00,T,,M,10.000,N,18.520,K,A"


def gsv(i):
    return "GPGSV,3,1,10,02,25,181,42,06,45,146,45,12,19,292,47,13,17,209,43"


def write(path, *makers, dress=summed, newline="\r\n", lead=""):
    path.write_bytes((lead + "".join(dress(make(i)) + newline for i in range(N) for make in makers)).encode())
    return path


def check(fixes, velocity=False, height=True):
    assert fixes.t_ns.tolist() == gps_from_utc(FIRST + 200_000_000 * np.arange(N)).tolist()
    np.testing.assert_allclose(np.degrees(fixes.lla[:, 0]), 48.2 + np.arange(N) * 1e-4 / 60, atol=1e-10)
    if height:
        np.testing.assert_allclose(fixes.lla[:, 2], 545.0)
    if velocity:
        np.testing.assert_allclose(fixes.vel_n[:, :2], [[0, 10 * 1852 / 3600]] * N, atol=1e-9)


DRESSES = {
    "as it is": summed,
    "no checksum": lambda body: f"${body}",
    "android": lambda body: f"NMEA,{summed(body)},1700000000000",
    "android, blanks": lambda body: f"NMEA, {summed(body)}, 1700000000000",
    "stamped": lambda body: f"2023-11-14T22:13:20.123 {summed(body)}",
    "small letters": lambda body: summed(body)[:-2] + summed(body)[-2:].lower(),
    "trailing blanks": lambda body: summed(body) + "  ",
    "recorded by ros": lambda body: f'"{summed(body)}"',
}


@pytest.mark.parametrize("dress", DRESSES)
@pytest.mark.parametrize("order", [(gga, rmc), (rmc, gga), (gsv, gga, rmc, gsv), (gst, rmc, gsv, vtg, gga, zda)])
@pytest.mark.parametrize("newline", ["\r\n", "\n"])
def test_however_sentences_are_dressed(tmp_path, dress, order, newline):
    path = write(tmp_path / "a.log", *order, dress=DRESSES[dress], newline=newline)
    timeline = load_timeline([path])
    check(timeline.fixes, velocity=True)
    assert (timeline.fixes.status == FixStatus.FIXED).all()
    (use,) = timeline.provenance.channels
    assert use.read == use.used + sum(use.rejected.values()) == N * len(order)


@pytest.mark.parametrize(
    ("makers", "velocity", "height"),
    [((gga, zda), False, True), ((gga, zda, vtg), True, True), ((zda, vtg, gga), True, True), ((gns, zda), False, True),
     ((gns, rmc), True, True), ((rmc,), True, False), ((rmc, gsv), True, False)],
)  # fmt: skip
def test_what_each_sentence_gives(tmp_path, makers, velocity, height):
    fixes = load_timeline([write(tmp_path / "a.log", *makers)]).fixes
    check(fixes, velocity, height)


def test_accuracies_of_gst(tmp_path):
    fixes = load_timeline([write(tmp_path / "a.log", gga, gst, rmc)]).fixes
    np.testing.assert_allclose(fixes.cov_pos, np.tile(np.diag([0.02, 0.03, 0.05]) ** 2, (N, 1, 1)))


@pytest.mark.parametrize("known_from", [0, 1, 7, N - 1])
def test_a_date_of_zero_is_no_date(tmp_path, known_from):
    date = {True: "141123", False: "000000"}
    path = write(tmp_path / "a.log", lambda i: rmc(i, date[i >= known_from]), gga)
    check(load_timeline([path]).fixes, velocity=True)


@pytest.mark.parametrize("date", ["000000", "", "320123", "141323"])
def test_a_log_without_any_date_asks_for_it(tmp_path, date):
    path = write(tmp_path / "a.log", lambda i: rmc(i, date), gga)
    with pytest.raises(LogError, match=r"a.log: no intact RMC or ZDA sentence tells the date.*input\.utc_date"):
        load_timeline([path])
    check(load_timeline([path], InputSettings.model_validate({"utc_date": "2023-11-14"})).fixes)


@pytest.mark.parametrize("gga_first", [True, False])
@pytest.mark.parametrize("before", [0.2, 1.0, 2.0])
def test_midnight_in_any_order(tmp_path, gga_first, before):
    start = 86400 - before
    position = lambda i: gga(i, start=start)  # noqa: E731
    date = lambda i: rmc(i, "141123" if start + 0.2 * i < 86400 - 1e-6 else "151123", start)  # noqa: E731
    path = write(tmp_path / "a.log", *((position, date) if gga_first else (date, position)))
    t_ns = load_timeline([path]).fixes.t_ns
    midnight = np.datetime64("2023-11-15", "ns").astype(np.int64)
    np.testing.assert_allclose(t_ns - gps_from_utc(np.array([midnight])), (np.arange(N) * 0.2 - before) * 1e9, atol=1e4)


@pytest.mark.parametrize("other", ["GP", "GL", "GA", "GB"])
def test_of_two_talkers_one_counts(tmp_path, other):
    path = write(tmp_path / "a.log", rmc, lambda i: gga(i, other, height="503.00"), gga)
    timeline = load_timeline([path])
    check(timeline.fixes)
    assert timeline.provenance.channels[0].rejected["of another talker at the same time"] == N


def test_a_talker_that_changes_loses_no_row(tmp_path):
    path = write(tmp_path / "a.log", rmc, lambda i: gga(i, "GP" if i < 5 else "GN"))
    check(load_timeline([path]).fixes)


def test_blank_geoid_counts_over_ground(tmp_path):
    fixes = load_timeline([write(tmp_path / "a.log", rmc, lambda i: gga(i, geoid=""))]).fixes
    check(fixes, height=False)
    assert (fixes.cov_pos[:, 2, 2] > 1e3).all()


HEADS = ["GPGSV,3,1,10,02,25,181,42", "GNGST,221320.00,1.0,,,,0.02,0.03,0.05", "PTNL,PJK,221320.00,111423,+4,N,+5,E",
         "GPHDT,123.4,T", "GNVTG,90.00,T,,M,10.000,N,18.520,K,A", "GNGNS,,,,,,NN,00,,,,,", "GPZDA,,,,,,",
         "GNGSA,A,3,02,06,,,,,,,,,,,1.2,0.8,0.9", "PSSN,HRP,221320.00,141123,1.0,2.0,,,,,,,,"]  # fmt: skip


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("size", [1, 400])
def test_what_stands_first_does_not_matter(tmp_path, head, size):
    path = write(tmp_path / "a.log", rmc, gga, lead=(summed(head) + "\r\n") * size)
    assert open_log(path).format == "nmea"
    check(load_timeline([path]).fixes, velocity=True)


def test_glued_and_cut_sentences_cost_themselves_only(tmp_path):
    path = write(tmp_path / "a.log", rmc, gga, dress=lambda body: summed(body) + (summed(body)[:12] if "GGA" in body else ""))
    check(load_timeline([path]).fixes, velocity=True)
    assert not is_nmea("$5 for a sentence, 3 for two\n")
