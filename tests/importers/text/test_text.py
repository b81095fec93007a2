"""Text formats: what is read, what is rejected, and that every line is counted."""

import numpy as np
import pytest
from scipy.io import savemat

from importers import open_log
from importers.load import load_timeline
from importers.settings import InputSettings
from importers.text.table import parse_text, select_columns
from navreplay.geodesy.earth import ecef_from_lla, matrix_en
from navreplay.geodesy.rotation import euler_from_quat
from navreplay.geodesy.time_scales import gps_from_utc, gps_from_week_tow
from navreplay.timeline import FixStatus, LogError

POS_HEAD = (
    "% program   : some\n"
    "%  {scale}  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio "
    "vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun\n"
)
POS_TAIL = "40.5 -105.25 1601.5 {q} 21 0.02 0.03 0.05 0.01 -0.02 -0.015 0 0 1.5 -2.5 0.25 0.1 0.1 0.2 0 0 0\n"


def read_only_channel(path, **settings):
    log = open_log(path, InputSettings.model_validate(settings))
    (channel,) = log.channels()
    return channel, log.read((channel.name,))[channel.name]


def write(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def balanced(table):
    return table.read == len(table.log_time_ns) + sum(table.rejected.values())


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_every_delimiter_and_newline_gives_the_same_numbers(delimiter, newline):
    rows = [["1", "2.5", "-3e-4"], ["4", "5.5", "6"], ["7", "8", "9"]]
    table = parse_text(newline.join(delimiter.join(row) for row in rows).encode())
    values = select_columns(table, {"a": 0, "b": 2}).columns
    np.testing.assert_array_equal(values["a"], [1, 4, 7])
    np.testing.assert_array_equal(values["b"], [-3e-4, 6, 9])


def test_doubles_survive_their_repr():
    values = np.random.default_rng(1).normal(size=2000) * 10.0 ** np.random.default_rng(2).integers(-12, 12, 2000)
    table = parse_text("\n".join(f"{value!r},1" for value in values.tolist()).encode(), header=False)
    np.testing.assert_array_equal(select_columns(table, {"v": 0}).columns["v"], values)


def test_damaged_lines_are_rejected_and_counted():
    text = b"2,3\n1,2,3\n1,x,3\n4,5,6\n1,2\x00,3\n# comment\n\n4,\xff\xfe,6\n7,8,9\n10,11"
    selection = select_columns(parse_text(text, header=False, comment="#"), {"a": 0, "b": 1})
    np.testing.assert_array_equal(selection.columns["b"], [2, 5, 8])
    assert selection.rejected == {"zero bytes in the line": 1, "wrong number of fields": 2, "not a number": 2}
    assert selection.read == 8


def test_own_imu_csv_with_byte_order_mark_and_a_cut_last_line(tmp_path):
    head = "t_gps_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
    body = "1436000000000000001,0.1,0.2,0.3,1,2,-9.8\n1436000000010000001,0.1,0.2,0.3,1,2,-9.8\n14360000000200"
    path = write(tmp_path, "imu.csv", b"\xef\xbb\xbf" + (head + body).encode())
    channel, table = read_only_channel(path)
    assert channel.type == "navreplay/imu"
    assert table.columns["t_gps_ns"].tolist() == [1436000000000000001, 1436000000010000001]
    np.testing.assert_array_equal(table.columns["gyro"][1], [0.1, 0.2, 0.3])
    assert table.rejected == {"wrong number of fields": 1}
    assert balanced(table)


def test_one_damaged_stamp_does_not_round_the_others(tmp_path):
    head = "t_gps_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
    stamps = ["1436000000000000001", "", "1e300", "99999999999999999999", "1436000000010000003"]
    path = write(tmp_path, "imu.csv", head + "".join(f"{stamp},0.1,0.2,0.3,1,2,-9.8\n" for stamp in stamps))
    _, table = read_only_channel(path)
    assert table.columns["t_gps_ns"].tolist() == [1436000000000000001, 1436000000010000003]
    assert table.rejected == {"not a number": 3}


def test_own_fix_csv_takes_empty_cells_as_unknown(tmp_path):
    head = "t_gps_ns,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps,std_n_m,std_e_m,std_d_m,status\n"
    body = "1436000000000000000,40,-105,1600,,,,1,2,3,FIXED\n1436000001000000000,,,,1,2,3,,,,\n"
    fixes = load_timeline([write(tmp_path, "fix.csv", head + body)]).fixes
    assert fixes.status.tolist() == [FixStatus.FIXED, FixStatus.UNKNOWN]
    assert fixes.has_position.tolist() == [True, False]
    assert fixes.has_velocity.tolist() == [False, True]
    np.testing.assert_array_equal(np.diagonal(fixes.cov_pos[0]), [1, 4, 9])
    assert np.isnan(fixes.cov_pos[1]).all()


def test_own_csv_without_rows_says_so(tmp_path):
    path = write(tmp_path, "fix.csv", "t_gps_ns,lat_deg,lon_deg,height_m\n")
    with pytest.raises(LogError, match="holds a header but no rows"):
        load_timeline([path])


def test_solution_csv_serves_as_reference(tmp_path):
    head = "gps_week,gps_tow_s,utc,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps,roll_deg,pitch_deg,yaw_deg,status\n"
    body = "2374,1.5,2025-07-06T00:00:00Z,40,-105,1600,1,2,3,10,20,30,UPDATED\n2374,2.5,x,40,-105,1600,1,2,3,10,20,30,UPDATED\n"
    reference = load_timeline([write(tmp_path, "solution.csv", head + body)]).reference
    assert reference.t_ns.tolist() == gps_from_week_tow(2374, np.array([1.5, 2.5])).tolist()
    np.testing.assert_allclose(np.degrees(euler_from_quat(reference.q_nb[0])), [10, 20, 30])


@pytest.mark.parametrize(("scale", "shift_s"), [("GPST", 0), ("UTC", 18), ("JST", 18 - 9 * 3600)])
def test_pos_dates_are_in_the_scale_of_the_header(tmp_path, scale, shift_s):
    text = POS_HEAD.format(scale=scale) + "2025/07/08 19:34:18.499 " + POS_TAIL.format(q=1)
    _, table = read_only_channel(write(tmp_path, "a.pos", text))
    gpst = int(np.datetime64("2025-07-08T19:34:18.499", "ns").astype(np.int64)) - 315_964_800 * 10**9
    assert table.columns["t_gps_ns"].tolist() == [gpst + shift_s * 10**9]


def test_pos_covariances_are_signed_square_roots(tmp_path):
    text = POS_HEAD.format(scale="GPST") + "2374 1.5 " + POS_TAIL.format(q=2) + "2374 2.5 " + POS_TAIL.format(q=0)
    fixes = load_timeline([path := write(tmp_path, "a.pos", text)]).fixes
    assert fixes.t_ns.tolist() == gps_from_week_tow(2374, np.array([1.5])).tolist()
    assert fixes.status.tolist() == [FixStatus.FLOAT]
    np.testing.assert_allclose(fixes.vel_n, [[1.5, -2.5, -0.25]])
    expected = [[4e-4, 1e-4, 2.25e-4], [1e-4, 9e-4, 4e-4], [2.25e-4, 4e-4, 25e-4]]
    np.testing.assert_allclose(fixes.cov_pos[0], expected)
    (use,) = load_timeline([path]).provenance.channels
    assert (use.read, use.used, dict(use.rejected)) == (2, 1, {"no fix": 1})


def test_earth_fixed_pos_equals_the_geodetic_one(tmp_path):
    lla = np.array([np.radians(40.5), np.radians(-105.25), 1601.5])
    x = ecef_from_lla(lla)
    v = matrix_en(lla[0], lla[1]) @ [1.5, -2.5, -0.25]
    deviations = "sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m)"
    text = f"%  GPST  x-ecef(m) y-ecef(m) z-ecef(m) Q ns {deviations} age(s) ratio vx(m/s) vy(m/s) vz(m/s)\n"
    numbers = " ".join(repr(float(value)) for value in x)
    speeds = " ".join(repr(float(value)) for value in v)
    text += f"2374 1.5 {numbers} 1 9 0.3 0.3 0.3 0 0 0 0 0 {speeds}\n"
    fixes = load_timeline([write(tmp_path, "a.pos", text)]).fixes
    np.testing.assert_allclose(fixes.lla[0], lla, rtol=1e-12)
    np.testing.assert_allclose(fixes.vel_n[0], [1.5, -2.5, -0.25], atol=1e-9)
    np.testing.assert_allclose(fixes.cov_pos[0], 0.09 * np.eye(3), atol=1e-12)


def test_pos_with_a_baseline_is_refused(tmp_path):
    text = "%  GPST  e-baseline(m) n-baseline(m) u-baseline(m) Q ns\n2374 1.5 1 2 3 1 9\n"
    with pytest.raises(LogError, match=r"only latitude and longitude in degrees or Earth-fixed"):
        load_timeline([write(tmp_path, "a.pos", text)])


def test_kf_gins_increments_become_rates(tmp_path):
    imu = "".join(f"{604799.5 + i * 0.25 if i < 2 else (i - 2) * 0.25} 1e-3 2e-3 -1e-3 0.01 0.02 -0.049\n" for i in range(6))
    gnss = "604799.75 30.5 114.25 20 0.1 0.2 0.3\n1.0 30.5 114.25 20 0.1 0.2 0.3\n"
    timeline = load_timeline([write(tmp_path, "imu.txt", imu), write(tmp_path, "gnss.txt", gnss)], InputSettings(gps_week=2100))
    assert timeline.imu.increments
    np.testing.assert_allclose(timeline.imu.gyro[0], [4e-3, 8e-3, -4e-3])
    assert np.diff(timeline.imu.t_ns).tolist() == [250_000_000] * 5
    assert timeline.fixes.t_ns.tolist() == gps_from_week_tow(np.array([2100, 2101]), np.array([604799.75, 1.0])).tolist()
    np.testing.assert_allclose(np.diagonal(timeline.fixes.cov_pos[0]), [0.01, 0.04, 0.09])


def test_kf_gins_without_a_week_names_the_setting(tmp_path):
    path = write(tmp_path, "imu.txt", "1.0 0 0 0 0 0 -0.05\n1.1 0 0 0 0 0 -0.05\n")
    with pytest.raises(LogError, match=r"set input\.gps_week"):
        load_timeline([path])


def test_tum_needs_an_origin_and_takes_one(tmp_path):
    path = write(tmp_path, "a.tum", "# t x y z qx qy qz qw\n1752000000.25 0 0 0 0 0 0 1\n1752000001.25 10 20 5 0 0 0 1\n")
    with pytest.raises(LogError, match=r"set input\.reference\.origin_deg_m"):
        load_timeline([path])
    reference = load_timeline([path], InputSettings.model_validate({"reference": {"origin_deg_m": [40, -105, 1600]}})).reference
    assert reference.t_ns[0] == gps_from_utc(np.array([1752000000_250000000]))[0]
    np.testing.assert_allclose(np.degrees(reference.lla[0, :2]), [40, -105])
    assert reference.lla[1, 0] > reference.lla[0, 0]
    np.testing.assert_allclose(np.degrees(euler_from_quat(reference.q_nb[0])), [0, 0, 90], atol=1e-9)


def nmea(body):
    parity = 0
    for letter in body.encode():
        parity ^= letter
    return f"${body}*{parity:02X}\r\n"


def test_nmea_joins_position_date_and_velocity(tmp_path):
    text = (
        nmea("GNRMC,235959.00,A,3725.5,N,12205.6,W,10.0,90.0,311224,,,A")
        + nmea("GNGGA,235959.00,3725.5,N,12205.6,W,4,12,0.76,4.4,M,-30.0,M,,")
        + nmea("GPGSV,3,1,10,02,25,181,42,06,45,146,45,12,19,292,47,13,17,209,43,1")
        + nmea("GNGGA,000000.00,3725.5,S,12205.6,E,5,12,0.76,4.4,M,-30.0,M,,")
        + "$GNGGA,000001.00,3725.5,S,12205.6,E,5,12,0.76,4.4,M,-30.0,M,,*00\r\n"
        + "$GGGPGSV,garbage\r\n"
    )
    fixes = load_timeline([path := write(tmp_path, "a.nmea", text)]).fixes
    midnight = np.datetime64("2025-01-01T00:00:00", "ns").astype(np.int64)
    assert fixes.t_ns.tolist() == gps_from_utc(np.array([midnight - 10**9, midnight])).tolist()
    assert fixes.status.tolist() == [FixStatus.FIXED, FixStatus.FLOAT]
    np.testing.assert_allclose(np.degrees(fixes.lla[:, 0]), [37 + 25.5 / 60, -37 - 25.5 / 60])
    np.testing.assert_allclose(np.degrees(fixes.lla[:, 1]), [-122 - 5.6 / 60, 122 + 5.6 / 60])
    np.testing.assert_allclose(fixes.lla[:, 2], -25.6)
    np.testing.assert_allclose(fixes.vel_n[0], [0, 10 * 1852 / 3600, 0], atol=1e-9)
    assert not fixes.has_velocity[1]
    (use,) = load_timeline([path]).provenance.channels
    assert use.rejected["wrong checksum or garbled"] == 2
    assert use.used == 2


def test_nmea_without_a_date_takes_it_from_the_settings(tmp_path):
    path = write(tmp_path, "a.gga", nmea("GNGGA,120000.00,3725.5,N,12205.6,W,1,12,0.76,4.4,M,-30.0,M,,"))
    with pytest.raises(LogError, match=r"set input\.utc_date"):
        load_timeline([path])
    fixes = load_timeline([path], InputSettings.model_validate({"utc_date": "2025-01-01"})).fixes
    noon = np.datetime64("2025-01-01T12:00:00", "ns").astype(np.int64)
    assert fixes.t_ns.tolist() == gps_from_utc(np.array([noon])).tolist()


def mapped(**mapping):
    return {"csv": [{"match": "data.*", **mapping}]}


def test_mapping_by_name_with_status_words_and_up_velocities(tmp_path):
    text = "TOW (s);Week;Lat;Lon;Height;E;N;U;Kind\n1.5;2374;40;-105;1600;1;2;3;fix\n2.5;2374;40;-105;1600;1;2;3;none\n"
    settings = mapped(
        role="fix",
        time={"column": "TOW (s)", "base": "gps_tow", "week_column": "Week"},
        columns={"lat": "Lat", "lon": "Lon", "height": "Height", "vel_e": "E", "vel_n": "N", "vel_u": "U", "status": "Kind"},
        status={"fix": "fixed", "none": "none"},
    )
    timeline = load_timeline([write(tmp_path, "data.csv", text)], InputSettings.model_validate(settings))
    np.testing.assert_allclose(timeline.fixes.vel_n, [[2, 1, -3]])
    assert timeline.fixes.status.tolist() == [FixStatus.FIXED]
    assert dict(timeline.provenance.channels[0].rejected) == {"no fix": 1}


@pytest.mark.parametrize(
    ("time", "cell", "expected"),
    [
        ({"base": "gps"}, "1436000000.25", 1436000000_250000000),
        ({"base": "gps", "unit": "ns"}, "1436000000250000000", 1436000000_250000000),
        ({"base": "gps", "unit": "ms"}, "1436000000250.5", 1436000000_250500000),
        ({"base": "gps_unix"}, "1751964800.25", 1436000000_250000000),
        ({"base": "utc"}, "1751964782.25", 1436000000_250000000),
        ({"base": "tai"}, "1751964819.25", 1436000000_250000000),
        ({"base": "datetime_utc"}, "2025-07-08T08:53:02.25Z", 1436000000_250000000),
        ({"base": "datetime_gps"}, "2025/07/08 08:53:20.250", 1436000000_250000000),
        ({"base": "boot", "unit": "us"}, "250000", 1436000000_250000000),
    ],
)
def test_every_time_base_of_a_mapping(tmp_path, time, cell, expected):
    numbers = ",".join(["0"] * 5 + ["-9.8"])
    columns = {name: i + 2 for i, name in enumerate(["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"])}
    settings = mapped(role="imu", time={"column": 1} | time, columns=columns)
    if time["base"] == "boot":
        settings["imu"] = {"time_offset_s": 1436000000.0}
    path = write(tmp_path, "data.csv", f"{cell},{numbers}\n")
    assert load_timeline([path], InputSettings.model_validate(settings)).imu.t_ns.tolist() == [expected]


def test_mapping_of_a_matlab_matrix_and_of_earth_fixed_velocities(tmp_path):
    t = np.arange(20.0)
    lla = np.array([np.radians(35.0), np.radians(139.0), 50.0])
    c_en = matrix_en(lla[0], lla[1])
    vel_n = np.array([3.0, -4.0, 0.5])
    x = ecef_from_lla(lla) + t[:, None] * (c_en @ vel_n)
    savemat(tmp_path / "data.mat", {"P": np.column_stack([t, x]), "other": np.eye(2)})
    lines = "\n".join(f"{i},{','.join(map(repr, (c_en @ vel_n).tolist()))}" for i in t.tolist())
    write(tmp_path, "vel.csv", lines)
    clock = {"column": 1, "base": "gps_tow"}
    positions = {
        "match": "data.mat",
        "variable": "P",
        "role": "fix",
        "time": clock,
        "columns": {"ecef_x": 2, "ecef_y": 3, "ecef_z": 4},
    }
    speeds = {"vel_ecef_x": 2, "vel_ecef_y": 3, "vel_ecef_z": 4}
    settings = {
        "gps_week": 2200,
        "csv": [positions, {"match": "vel.csv", "role": "velocity", "time": clock, "columns": speeds}],
    }
    fixes = load_timeline([tmp_path / "data.mat", tmp_path / "vel.csv"], InputSettings.model_validate(settings)).fixes
    np.testing.assert_allclose(fixes.lla[0], lla, rtol=1e-12)
    np.testing.assert_allclose(fixes.vel_n, np.tile(vel_n, (20, 1)), atol=1e-3)
    positions["variable"] = "Q"
    with pytest.raises(LogError, match="has no numeric matrix Q; its numeric matrices are P"):
        load_timeline([tmp_path / "data.mat"], InputSettings.model_validate(settings))


def test_mapping_that_names_a_missing_column_lists_those_there(tmp_path):
    settings = mapped(role="fix", time={"column": "t"}, columns={"lat": "latt", "lon": "lon", "height": "h"})
    path = write(tmp_path, "data.csv", "t,lat,lon,h\n1,2,3,4\n")
    with pytest.raises(LogError, match="names the column 'latt', but the file has t, lat, lon, h"):
        load_timeline([path], InputSettings.model_validate(settings))


def test_mapping_without_the_columns_of_its_role_names_them(tmp_path):
    settings = mapped(role="imu", time={"column": 1}, columns={"gyro_x": 2})
    with pytest.raises(LogError, match="role imu, which needs the columns gyro_x, gyro_y, gyro_z"):
        load_timeline([write(tmp_path, "data.csv", "1436000000,2\n")], InputSettings.model_validate(settings))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.mcap", b"", "the file is empty"),
        ("a.bag", b"\x00\x01garbage", "does not begin like a ROS 1 bag"),
        ("a.csv", b"1,2,3\n4,5,6\n", r"needs an \[\[input.csv\]\] entry"),
    ],
)
def test_unreadable_files_get_one_clear_line(tmp_path, name, content, message):
    with pytest.raises(LogError, match=message) as caught:
        open_log(write(tmp_path, name, content))
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(LogError, match=r"gone\.pos: cannot be read: No such file"):
        open_log(tmp_path / "gone.pos")
