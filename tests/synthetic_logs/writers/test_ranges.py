"""Ranges as files: RINEX fields by the standard's columns, JSON and CSV to the last bit."""

import csv
import json
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from navreplay.geodesy.time_scales import gps_from_utc, gps_from_week_tow, week_tow_from_gps
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import LogError
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from synthetic_logs.ranges.constellation import ascending_node, refer_to
from synthetic_logs.ranges.signals import carrier_of
from synthetic_logs.simulation import orbits_of
from synthetic_logs.writers.gnss_comm import TOPICS, register_types, satellite_number
from synthetic_logs.writers.range_messages import SCHEMA, range_messages

LOG = simulate(with_duration(SCENARIOS["ranges-open"], 6.0), 5)
FIELDS = ("pseudorange_m", "range_rate_mps", "pseudorange_std_m", "range_rate_std_mps", "cn0_dbhz")
COLUMNS = ("pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0")


def read_mcap(path):
    with path.open("rb") as stream:
        return [(schema.name, channel, message) for schema, channel, message in make_reader(stream).iter_messages()]


def test_mcap_holds_every_range_exactly(tmp_path):
    messages = read_mcap(write(LOG, tmp_path / "log.mcap")[0])
    assert {channel.topic: (name, channel.message_encoding) for name, channel, _ in messages} == {
        "/imu/data": ("sensor_msgs/msg/Imu", "cdr"),
        "/gnss/ranges": ("navreplay.GnssRanges", "json"),
    }
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)
    epochs = [(m.log_time, json.loads(m.data)) for _, channel, m in messages if channel.topic == "/gnss/ranges"]
    assert len(epochs) == 7
    assert [int(gps_from_utc(np.array([t]))[0]) for t, _ in epochs] == [epoch["t_gps_ns"] for _, epoch in epochs]
    rows = [(epoch["t_gps_ns"], sat) for _, epoch in epochs for sat in epoch["satellites"]]
    assert [t for t, _ in rows] == LOG.ranges.t_ns.tolist()
    for name in ("sat", "signal"):
        assert [sat[name] for _, sat in rows] == getattr(LOG.ranges, name).tolist()
    for field, column in zip(FIELDS, COLUMNS, strict=True):
        np.testing.assert_array_equal([sat[field] for _, sat in rows], getattr(LOG.ranges, column))
    np.testing.assert_array_equal([sat["sat_pos_e_m"] for _, sat in rows], LOG.ranges.sat_pos_e)
    np.testing.assert_array_equal([sat["sat_vel_e_mps"] for _, sat in rows], LOG.ranges.sat_vel_e)
    for _, epoch in epochs:
        assert set(epoch) == set(SCHEMA["required"]) == set(SCHEMA["properties"])
        assert (epoch["corrected"], epoch["ionosphere_removed"], epoch["troposphere_removed"]) == (True, False, False)
        assert epoch["klobuchar"] == LOG.ranges.klobuchar.tolist()


def test_json_has_null_for_what_is_unknown():
    unknown = np.full(len(LOG.ranges), np.nan)
    ranges = replace(LOG.ranges, range_rate=unknown, cn0=unknown, klobuchar=None, ionosphere_removed=True)
    message = json.loads(next(data for _, data in range_messages(ranges)))
    assert message["klobuchar"] is None
    assert message["ionosphere_removed"] is True
    assert {(sat["range_rate_mps"], sat["cn0_dbhz"]) for sat in message["satellites"]} == {(None, None)}


def test_csv_holds_every_range_exactly(tmp_path):
    paths = write(LOG, tmp_path / "log.csv")
    assert [p.name for p in paths] == ["log.imu.csv", "log.ranges.csv", "log.truth.csv"]
    with paths[1].open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["t_gps_ns"]) for row in rows] == LOG.ranges.t_ns.tolist()
    assert [row["sat"] for row in rows] == LOG.ranges.sat.tolist()
    assert [row["signal"] for row in rows] == LOG.ranges.signal.tolist()
    for field, column in zip(FIELDS, COLUMNS, strict=True):
        np.testing.assert_array_equal([float(row[field]) for row in rows], getattr(LOG.ranges, column))
    for field, column in (("sat_{}_m", "sat_pos_e"), ("sat_v{}_mps", "sat_vel_e")):
        values = [[float(row[field.format(axis)]) for axis in "xyz"] for row in rows]
        np.testing.assert_array_equal(values, getattr(LOG.ranges, column))


@pytest.fixture(scope="module")
def rinex(tmp_path_factory):
    paths = write(LOG, tmp_path_factory.mktemp("rinex") / "log.obs")
    assert [p.name for p in paths] == ["log.obs", "log.nav", "log.imu.csv", "log.truth.csv"]
    return paths[0].read_text().splitlines(), paths[1].read_text().splitlines()


def split_header(lines):
    end = next(i for i, line in enumerate(lines) if line[60:].strip() == "END OF HEADER")
    return [(line[60:].strip(), line[:60]) for line in lines[:end]], lines[end + 1 :]


def test_rinex_headers(rinex):
    for lines, kind in zip(rinex, ("O", "N"), strict=True):
        header, _ = split_header(lines)
        assert header[0][0] == "RINEX VERSION / TYPE"
        assert (header[0][1][:9], header[0][1][20], header[0][1][40]) == ("     3.04", kind, "M")
        assert all(len(text) == 60 for _, text in header)
        assert dict(header)["LEAP SECONDS"] == f"{18:6d}{'':54}"
    observation, navigation = (split_header(lines)[0] for lines in rinex)
    kinds = [text.split() for label, text in observation if label == "SYS / # / OBS TYPES"]
    assert kinds == [["C", "3", "C2I", "D2I", "S2I"], ["E", "3", "C1C", "D1C", "S1C"], ["G", "3", "C1C", "D1C", "S1C"]]
    klobuchar = [text for label, text in navigation if label == "IONOSPHERIC CORR"]
    assert [text[:4] for text in klobuchar] == ["GPSA", "GPSB"]
    told = [float(text[5 + 12 * i : 17 + 12 * i]) for text in klobuchar for i in range(4)]
    np.testing.assert_array_equal(told, LOG.ranges.klobuchar)


def test_rinex_observations_lack_every_correction(rinex):
    _, body = split_header(rinex[0])
    t_ns, rows = [], []
    for line in body:
        if line.startswith(">"):
            count = int(line[32:35])
            seconds = float(line[18:29])
            epoch = datetime.strptime(line[2:18], "%Y %m %d %H %M") - datetime(1980, 1, 6)
            stamp = int(epoch.total_seconds()) * 10**9 + round(seconds * 1e9)
        else:
            t_ns.append(stamp)
            rows.append((line[:3], *(float(line[3 + 16 * i : 17 + 16 * i]) for i in range(3))))
    assert count == len(set(LOG.ranges.sat[LOG.ranges.t_ns == LOG.ranges.t_ns[-1]]))
    assert t_ns == LOG.ranges.t_ns.tolist()
    assert [row[0] for row in rows] == LOG.ranges.sat.tolist()
    pseudorange, doppler, cn0 = np.array([row[1:] for row in rows]).T
    truth = LOG.range_truth
    np.testing.assert_allclose(pseudorange + truth.satellite_clock, LOG.ranges.pseudorange, atol=5.1e-4)
    rate = -doppler * SPEED_OF_LIGHT / carrier_of(LOG.ranges.sat)
    np.testing.assert_allclose(rate + truth.satellite_clock_rate, LOG.ranges.range_rate, atol=1e-4)
    np.testing.assert_allclose(cn0, LOG.ranges.cn0, atol=5.1e-4)
    assert np.abs(truth.satellite_clock).max() > 1e4


def test_rinex_ephemerides_hold_the_elements(rinex):
    _, body = split_header(rinex[1])
    assert len(body) == 8 * 78 * 2
    orbits = orbits_of(LOG.scenario.journey, LOG.scenario.receiver)
    week, _ = week_tow_from_gps(np.array([orbits.reference_ns]))
    for first in range(0, len(body) // 2, 8):
        block = body[first : first + 8]
        name, toc = block[0][:3], datetime.strptime(block[0][4:23], "%Y %m %d %H %M %S")
        ahead_s, weeks = (14, 1356) if name[0] == "C" else (0, 0)
        told = [[float(line[4 + 19 * i : 23 + 19 * i]) for i in range(4)] for line in block[1:]]
        row = orbits.sat.tolist().index(name)
        issue = refer_to(orbits, orbits.reference_ns + ahead_s * 10**9)
        assert (toc.minute, toc.second) == (0, 0)
        assert told[2][0] == ((toc - datetime(1980, 1, 6)).total_seconds()) % 604800
        assert told[4][2] == week[0] - weeks
        np.testing.assert_allclose(
            told[:4],
            [
                [told[0][0], issue.crs[row], issue.delta_n[row], issue.mean_anomaly[row]],
                [issue.cuc[row], issue.eccentricity[row], issue.cus[row], issue.sqrt_a[row]],
                [told[2][0], issue.cic[row], ascending_node(issue, ahead_s)[row], issue.cis[row]],
                [issue.inclination[row], issue.crc[row], issue.perigee[row], issue.node_rate[row]],
            ],
            rtol=1e-12,
        )
        clock = [float(block[0][23 + 19 * i : 42 + 19 * i]) for i in range(3)]
        np.testing.assert_allclose(clock, [issue.af0[row], issue.af1[row], 0.0], rtol=1e-12)
        delay = told[5][3] if name[0] == "E" else told[5][2]
        assert delay == pytest.approx(issue.group_delay[row], rel=1e-12)


@pytest.mark.parametrize("name", ["log.bag", "log"])
def test_bags_hold_raw_ranges_and_ephemerides(tmp_path, name):
    path = write(LOG, tmp_path / name)[0]
    store = get_typestore(Stores.ROS1_NOETIC if name == "log.bag" else Stores.ROS2_HUMBLE)
    register_types(store)
    decode = store.deserialize_ros1 if name == "log.bag" else store.deserialize_cdr
    with (rosbag1 if name == "log.bag" else rosbag2).Reader(path) as reader:
        found = [(c.topic, t_ns, decode(data, c.msgtype)) for c, t_ns, data in reader.messages()]
    times = [t_ns for _, t_ns, _ in found]
    assert times == sorted(times)
    assert {topic for topic, _, _ in found} == {"/imu/data", *TOPICS}
    epochs = [(t_ns, message) for topic, t_ns, message in found if topic == "/ublox_driver/range_meas"]
    rows = [(t_ns, row) for t_ns, message in epochs for row in message.meas]
    stamps = [gps_from_week_tow(np.array([row.time.week]), np.array([row.time.tow]))[0] for _, row in rows]
    np.testing.assert_array_equal(stamps, LOG.ranges.t_ns)
    np.testing.assert_array_equal(gps_from_utc(np.array([t_ns for t_ns, _ in rows])), LOG.ranges.t_ns)
    assert [row.sat for _, row in rows] == [satellite_number(sat) for sat in LOG.ranges.sat.tolist()]
    psr, dopp, freqs, cn0 = np.array([(row.psr[0], row.dopp[0], row.freqs[0], row.CN0[0]) for _, row in rows]).T
    np.testing.assert_allclose(psr + LOG.range_truth.satellite_clock, LOG.ranges.pseudorange, rtol=1e-15)
    rate = -dopp * SPEED_OF_LIGHT / freqs
    np.testing.assert_allclose(rate + LOG.range_truth.satellite_clock_rate, LOG.ranges.range_rate, atol=1e-11)
    np.testing.assert_array_equal(cn0, LOG.ranges.cn0)
    check_ephemerides([message for topic, _, message in found if topic == "/ublox_driver/ephem"])
    ionosphere = next(message for topic, _, message in found if topic == "/ublox_driver/iono_params")
    np.testing.assert_array_equal(ionosphere.data, LOG.ranges.klobuchar)


def check_ephemerides(messages):
    orbits = orbits_of(LOG.scenario.journey, LOG.scenario.receiver)
    assert len(messages) == 2 * len(orbits)
    numbers = {satellite_number(sat): row for row, sat in enumerate(orbits.sat.tolist())}
    assert (numbers[1], numbers[60], numbers[116]) == tuple(orbits.sat.tolist().index(sat) for sat in ("G01", "E01", "C19"))
    for message in messages:
        row = numbers[message.sat]
        toe_ns = int(gps_from_week_tow(np.array([message.toe.week]), np.array([message.toe.tow]))[0])
        issue = refer_to(orbits, toe_ns)
        ahead_s, weeks = (14, 1356) if message.sat >= 98 else (0, 0)
        assert message.toe_tow == message.toe.tow - ahead_s
        assert message.week == message.toe.week - weeks
        told = [message.A, message.M0, message.OMG0, message.omg, message.af0, message.tgd0, message.cis, message.crc]
        np.testing.assert_allclose(
            told,
            [
                issue.sqrt_a[row] ** 2,
                issue.mean_anomaly[row],
                ascending_node(issue, ahead_s)[row],
                issue.perigee[row],
                issue.af0[row],
                issue.group_delay[row],
                issue.cis[row],
                issue.crc[row],
            ],
            rtol=1e-14,
        )


def test_rinex_without_ranges_is_refused(tmp_path):
    fixes = simulate(with_duration(SCENARIOS["static"], 2.0), 1)
    with pytest.raises(LogError, match="RINEX holds ranges, but the scenario static has none; write another format"):
        write(fixes, tmp_path / "log.obs")
    assert list(tmp_path.iterdir()) == []
