"""Tables as they are exported: marks, quotes, decimal commas, times, angles, several sensors in a row, and no configuration."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from importers import load_timeline, open_log
from importers.inspection import draft_mappings, inspect_logs
from importers.settings import InputSettings
from importers.text.table import parse_text, select_columns
from importers.text.times import read_dates, unroll_32_bits
from navreplay.geodesy.time_scales import LEAP_SECONDS, gps_from_utc
from navreplay.timeline import LogError

START = datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC)
N = 40
LAT, LON, HEIGHT = 48.2 + 1e-5 * np.arange(N), 11.6 - 2e-5 * np.arange(N), 545.0 + 0.5 * np.arange(N)
UNIX_NS = 1_700_000_000 * 10**9 + 200_000_000 * np.arange(N)
T_NS = gps_from_utc(UNIX_NS, LEAP_SECONDS)
IMU = "gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z"


def moments(form):
    return [(START + timedelta(milliseconds=200 * i)).strftime(form) for i in range(N)]


def ddmm(degrees):
    return [f"{int(d) * 100 + (d % 1) * 60:.9f}" for d in degrees]


def fixes(path, **settings):
    log = open_log(path, InputSettings.model_validate(settings))
    return log.read((log.channels()[0].name,))[log.channels()[0].name]


def check(table, degrees=1e-7, seconds=1e-3):
    assert table.read == N == len(table.log_time_ns) + sum(table.rejected.values())
    np.testing.assert_allclose(np.degrees(table.columns["lla"][:, 0]), LAT, atol=degrees)
    np.testing.assert_allclose(np.degrees(table.columns["lla"][:, 1]), LON, atol=degrees)
    np.testing.assert_allclose(table.columns["t_gps_ns"], T_NS, atol=seconds * 1e9)


def columns(time, lat=None, lon=None):
    return [time, lat or [f"{v:.9f}" for v in LAT], lon or [f"{v:.9f}" for v in LON], [f"{v:.3f}" for v in HEIGHT]]


def lines(header, parts, mark=","):
    return "\n".join([header, *(mark.join(row) for row in zip(*parts, strict=True))]) + "\n"


TOW = (T_NS / 1e9) % 604_800
TIMES = {
    "unix s": ("time", [f"{t / 1e9:.3f}" for t in UNIX_NS]),
    "unix ms": ("Timestamp", [f"{t // 10**6}" for t in UNIX_NS]),
    "unix us": ("time_us", [f"{t // 10**3}" for t in UNIX_NS]),
    "unix ns": ("stamp", [f"{t}" for t in UNIX_NS]),
    "savetxt": ("timestamp", [f"{float(t):.18e}" for t in UNIX_NS]),
    "gps s": ("gps_time", [f"{t / 1e9:.3f}" for t in T_NS]),
    "iso": ("utc_time", moments("%Y-%m-%dT%H:%M:%S.%fZ")),
    "iso offset": ("time", moments("%Y-%m-%d %H:%M:%S.%f+00:00")),
    "slashes": ("time", moments("%Y/%m/%d %H:%M:%S.%f")),
    "compact": ("time", moments("%Y%m%dT%H%M%S.%fZ")),
    "points": ("time", moments("%d.%m.%Y %H:%M:%S.%f")),
    "day first": ("time", moments("%d/%m/%Y %H:%M:%S.%f")),
    "month first": ("time", moments("%m/%d/%Y %H:%M:%S.%f")),
    "two digits of the year": ("time", moments("%d/%m/%y %H:%M:%S.%f")),
    "pm": ("time", moments("%m/%d/%Y %I:%M:%S.%f %p")),
}


@pytest.mark.parametrize("name", TIMES)
def test_times_need_no_configuration(tmp_path, name):
    head, time = TIMES[name]
    (tmp_path / "a.csv").write_text(lines(f"{head},lat,lon,height", columns(time)))
    check(fixes(tmp_path / "a.csv"))


def test_week_and_seconds_and_date_beside_time(tmp_path):
    week = [str(int(T_NS[0] / 1e9 // 604_800))] * N
    parts = columns([f"{t:.3f}" for t in TOW])
    (tmp_path / "a.csv").write_text(lines("gps_week,tow_s,lat,lon,height", [week, *parts]))
    check(fixes(tmp_path / "a.csv"))
    (tmp_path / "b.csv").write_text(lines("Date,Time,lat,lon,height", [moments("%d.%m.%Y"), *columns(moments("%H:%M:%S.%f"))]))
    check(fixes(tmp_path / "b.csv"))


@pytest.mark.parametrize("header", [
    "time,lat,lon,height", "time [s],Latitude [deg],Longitude [deg],Altitude [m]", "t_s,latitude_deg,longitude_deg,height_m",
    "time,GPS Latitude,GPS Longitude,GPS Altitude", "timestamp,gps.lat,gps.lng,gps.alt", "# time, lat, lon, alt",
    "time (s),Lat (°),Long (°),Hgt (m)", '"time","lat","lon","height"', "utcTime,posLat,posLon,posHeight",
    "Device: X10\nFirmware, 2.1\n\ntime,lat,lon,height", "time,lat,lon,height\ns,deg,deg,m",
])  # fmt: skip
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_headers_need_no_configuration(tmp_path, header, mark):
    text = lines(header.replace(",", mark), columns(TIMES["unix s"][1]), mark)
    (tmp_path / "a.csv").write_text(text)
    check(fixes(tmp_path / "a.csv"))
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe" + text.encode("utf-16-le"))
    check(fixes(tmp_path / "b.csv"))


@pytest.mark.parametrize("mark", [";", "\t", " ", "quoted"])
def test_decimal_commas(tmp_path, mark):
    parts = columns(TIMES["unix s"][1])
    cells = [[cell.replace(".", ",") for cell in part] for part in parts]
    if mark == "quoted":
        mark, cells = ",", [[f'"{cell}"' for cell in part] for part in cells]
    (tmp_path / "a.csv").write_text(lines(mark.join(["time", "lat", "lon", "height"]), cells, mark))
    check(fixes(tmp_path / "a.csv"))


@pytest.mark.parametrize(("lat", "lon"), [
    ([f"{np.radians(v):.12f}" for v in LAT], [f"{np.radians(v):.12f}" for v in LON]),
    (ddmm(LAT), ddmm(LON)),
    ([f"{round(v * 1e7)}" for v in LAT], [f"{round(v * 1e7)}" for v in LON]),
])  # fmt: skip
def test_angles_by_their_size(tmp_path, lat, lon):
    (tmp_path / "a.csv").write_text(lines("time,lat,lon,height", columns(TIMES["unix s"][1], lat, lon)))
    table = fixes(tmp_path / "a.csv")
    check(table)
    mapping = {"match": "a.csv", "role": "fix", "time": {"column": "time", "base": "utc"}}
    mapping["columns"] = {"lat": "lat", "lon": "lon", "height": "height"}
    told = fixes(tmp_path / "a.csv", csv=[mapping])
    check(told)
    assert "angle_unit" in told.notes[0]


LISTS = ['"[0.25, 0.0, 0.0]"', '"(1;2;3)"', '"a, b"', '"1\t2"', '""', '"5"']


@pytest.mark.parametrize("cell", LISTS)
@pytest.mark.parametrize("mark", [",", ";"])
@pytest.mark.parametrize("place", range(5))
def test_a_quoted_cell_shifts_no_column(cell, mark, place):
    rows = [["1", "2", "3", "4"] for _ in range(8)]
    text = "\n".join(mark.join([*row[:place], cell, *row[place:]]) for row in rows).encode()
    table = parse_text(text, delimiter=mark, header=False)
    kept = [i for i in range(5) if i != place]
    picked = select_columns(table, {str(i): i for i in kept}, {"cell": place})
    assert [picked.columns[str(i)][0] for i in kept] == [1, 2, 3, 4]
    assert picked.columns["cell"][0] == cell.strip('"')
    assert picked.read == len(picked.columns["cell"]) == 8


def test_a_quote_left_open_costs_its_line_only():
    table = parse_text(b'1,2,3\n1,"2,3\n1,2,3\n"1,2,3"\n', header=False)
    np.testing.assert_array_equal(select_columns(table, {"b": 1}).columns["b"], [2, 2, 2, 2])


def test_day_and_month_are_decided_over_the_column():
    unix_ns, timed = read_dates(np.array(["05/04/2023 10:00:00", "13/04/2023 10:00:00", "x"]), None, "a.csv")
    assert timed.tolist() == [True, True, False]
    assert unix_ns[0] == datetime(2023, 4, 5, 10, tzinfo=UTC).timestamp() * 1e9
    across = np.array(["05/04/2023 23:59:59", "06/04/2023 00:00:00"])  # days pass before months do
    assert np.diff(read_dates(across, None, "a.csv")[0]) == [10**9]
    assert np.diff(read_dates(np.array(["04/05/2023 23:59:59", "04/06/2023 00:00:00"]), None, "a.csv")[0]) == [10**9]
    with pytest.raises(LogError, match=r"a.csv: '05/04/2023 10:00:00' .* set time.day_first"):
        read_dates(np.array(["05/04/2023 10:00:00", "05/04/2023 11:00:00"]), None, "a.csv")
    for first, month in ((True, 4), (False, 5)):
        told, _ = read_dates(np.array(["05/04/2023 10:00:00"]), first, "a.csv")
        assert datetime.fromtimestamp(told[0] / 1e9, UTC).month == month


@pytest.mark.parametrize("cell", ["1.30e+18", "1.7E+18", "1.70000e9", "1.7e+12"])
def test_stamps_rounded_by_a_spreadsheet_are_told_with_the_cell(tmp_path, cell):
    (tmp_path / "a.csv").write_text(lines("time,lat,lon,height", columns([cell] * N)))
    with pytest.raises(LogError, match=f"a.csv.* rounded .*'{cell}'".replace("+", r"\+")):
        fixes(tmp_path / "a.csv")


def test_a_table_without_a_time_is_asked_about(tmp_path):
    (tmp_path / "a.csv").write_text(lines("n,lat,lon,height", columns([str(i) for i in range(N)])))
    with pytest.raises(LogError, match=r"a.csv: a table .*\(lat, lon\).*n = 0, lat = 48.2.*time.column"):
        open_log(tmp_path / "a.csv")


def write_both(path, n=600, repeats=50, units=True):
    head = "timestamp_ms," + (
        IMU if not units else "gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],acc_x [g],acc_y [g],acc_z [g]"
    )
    rows = [
        f"{1_700_000_000_000 + 20 * i},1,2,3,0,0,-1,{48.2 + 1e-5 * (i // repeats):.7f},11.6,545,{36 + i // repeats},90"
        for i in range(n)
    ]
    path.write_text("\n".join([f"{head},lat,lon,alt,speed [km/h],course [deg]", *rows]) + "\n")


@pytest.mark.parametrize("repeats", [5, 10, 50, 100])
def test_a_row_that_holds_imu_and_fix_gives_both(tmp_path, repeats):
    write_both(tmp_path / "phone.csv", repeats=repeats)
    timeline = load_timeline([tmp_path / "phone.csv"])
    assert len(timeline.imu.t_ns) == 600
    np.testing.assert_allclose(timeline.imu.gyro[0], np.radians([1, 2, 3]))
    np.testing.assert_allclose(timeline.imu.accel[0], [0, 0, -9.80665])
    assert len(timeline.fixes.t_ns) == 600 // repeats
    np.testing.assert_allclose(timeline.fixes.vel_n[0], [0, 10, 0], atol=1e-9)
    for use in timeline.provenance.channels:
        assert use.read == use.used + sum(use.rejected.values()) == 600


def test_the_draft_of_init_reads_the_same(tmp_path):
    import tomllib

    write_both(tmp_path / "phone.csv")
    settings = InputSettings()
    drafts = draft_mappings([tmp_path / "phone.csv"], settings, inspect_logs([tmp_path / "phone.csv"], settings))
    told = InputSettings.model_validate(tomllib.loads("\n".join(drafts))["input"])
    assert [mapping.role for mapping in told.csv] == ["imu", "fix"]
    first, second = load_timeline([tmp_path / "phone.csv"]), load_timeline([tmp_path / "phone.csv"], told)
    np.testing.assert_array_equal(first.fixes.lla, second.fixes.lla)
    np.testing.assert_array_equal(first.imu.gyro, second.imu.gyro)


def test_a_mapping_that_no_file_takes_is_told(tmp_path):
    write_both(tmp_path / "phone.csv", units=False)
    time = {"column": "timestamp_ms", "base": "utc"}
    imu = {f"{kind}_{axis}": f"{name}_{axis}" for kind, name in (("gyro", "gyro"), ("accel", "acc")) for axis in "xyz"}
    fix = {"lat": "lat", "lon": "lon", "height": "alt"}
    csv = [
        {"match": "phone.csv", "role": "imu", "time": time, "columns": imu},
        {"match": "phone.csv", "role": "fix", "time": time, "columns": fix},
        {"match": "other*.csv", "role": "fix", "time": time, "columns": fix},
        {"match": "phone.csv", "role": "fix", "time": time, "columns": fix},
    ]
    timeline = load_timeline([tmp_path / "phone.csv"], InputSettings.model_validate({"csv": csv}))
    assert len(timeline.fixes.t_ns) == 12
    missing, second = timeline.provenance.damage
    assert "'other*.csv' with the role fix is not used: it fits no file; there is phone.csv" in missing
    assert "comes behind another" in second


@pytest.mark.parametrize(("axes", "gyro_axes"), [("frd", "flu"), ("flu", "frd"), ("frd", "fru"), ("frd", "blu")])
def test_angular_rates_may_have_axes_of_their_own(tmp_path, axes, gyro_axes):
    write_both(tmp_path / "phone.csv")
    imu = {"axes": axes, "gyro_axes": gyro_axes}
    timeline = load_timeline([tmp_path / "phone.csv"], InputSettings.model_validate({"imu": imu}))
    signs = [[1 if letter in "frd" else -1 for letter in letters] for letters in (gyro_axes, axes)]
    np.testing.assert_allclose(timeline.imu.gyro[0], np.radians([1, 2, 3]) * signs[0])
    np.testing.assert_allclose(timeline.imu.accel[0], [0, 0, -9.80665 * signs[1][2]])


@pytest.mark.parametrize("letters", ["ffd", "fr", "xyz", "fbd"])
def test_axes_that_are_no_triad_are_refused(letters):
    with pytest.raises(ValueError, match="axes"):
        InputSettings.model_validate({"imu": {"gyro_axes": letters}})


def test_a_counter_of_32_bits_goes_on_where_it_turns():
    count = (2**32 - 500 + np.arange(0, 1000, 10)) % 2**32
    whole, turns = unroll_32_bits(count)
    assert turns == 1
    np.testing.assert_array_equal(np.diff(whole), 10)
    assert unroll_32_bits(np.arange(10.0))[1] == 0
    late = count.copy()
    late[[50, 49]] = late[[49, 50]]  # a row that comes late belongs before the turn
    np.testing.assert_array_equal(np.sort(unroll_32_bits(late)[0]), whole)


@pytest.mark.parametrize(("cells", "sign"), [(("12.5S", "8.25W"), -1), (("N12.5", "8.25 E"), 1)])
def test_letters_beside_degrees_tell_the_hemisphere(tmp_path, cells, sign):
    rows = "".join(f"{1_700_000_000 + i},{cells[0]},{cells[1]},10\n" for i in range(30))
    (tmp_path / "a.csv").write_text("unix,lat,lon,alt\n" + rows)
    fixes = load_timeline([tmp_path / "a.csv"]).fixes
    np.testing.assert_allclose(np.degrees(fixes.lla[0, :2]), [12.5 * sign, 8.25 * sign])


def test_columns_of_letters_tell_the_hemisphere(tmp_path):
    rows = "".join(f"{1_700_000_000 + i},1230.0,S,815.0,W,10\n" for i in range(30))
    (tmp_path / "a.csv").write_text("unix,latitude,N/S,longitude,E/W,alt\n" + rows)
    fixes = load_timeline([tmp_path / "a.csv"]).fixes
    np.testing.assert_allclose(np.degrees(fixes.lla[0, :2]), [-12.5, -8.25])


@pytest.mark.parametrize(("accuracy", "std"), [("2", 2.0), ("0.014", 0.014), ("2100", 2.1)])
def test_accuracies_by_name_are_metres_unless_their_size_says_otherwise(tmp_path, accuracy, std):
    rows = "".join(f"{1_700_000_000 + i},48.{i:02d},11.6,10.5,{accuracy},{accuracy},{accuracy}\n" for i in range(30))
    (tmp_path / "a.csv").write_text("unix,lat,lon,alt,std_n,std_e,std_u\n" + rows)
    fixes = load_timeline([tmp_path / "a.csv"]).fixes
    np.testing.assert_allclose(np.sqrt(fixes.cov_pos[0, 0, 0]), std)
