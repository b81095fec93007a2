"""Messages of any type by mapping, and of drivers without one."""

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from importers.drivers.packages import definitions_of
from importers.formats import open_log
from importers.load import load_timeline
from importers.meanings.mapped_messages import map_table
from importers.message_settings import MessageMapping
from importers.rows.log import Table
from importers.settings import InputSettings
from navreplay.geodesy.time_scales import LEAP_SECONDS, gps_from_utc
from navreplay.timeline import FixStatus, LogError
from pipelines.config.spec import load_config
from tests.helpers.log_samples import START_NS

N = 30
LAT, LON, HEIGHT = 48.123456789, 11.6, 512.5


def mapping(**more: Any) -> MessageMapping:
    return MessageMapping.model_validate({"topic": "*", "role": "fix", **more})


def mapped(messages: dict[str, np.ndarray], **more: Any) -> dict[str, np.ndarray]:
    n = len(next(iter(messages.values())))
    times = START_NS + np.arange(n) * 10**8
    return dict(map_table(Table(times, messages, n), mapping(**more), LEAP_SECONDS, "log: the mapping").columns)


@pytest.mark.parametrize(
    ("unit", "value"), [("deg", 48.0), ("rad", np.radians(48.0)), ("1e-7 deg", 480_000_000), ("arcsec", 48.0 * 3600)]
)
def test_units_of_angles(unit: str, value: float) -> None:
    columns = {"a": np.full(3, value), "b": np.full(3, 11.0), "h": np.full(3, 1000)}
    out = mapped(columns, columns={"lat": "a", "lon": "b", "height": "h"}, units={"lat": unit, "height": "mm"})
    assert np.allclose(out["lla"], [np.radians(48.0), np.radians(11.0), 1.0], atol=1e-12)


def test_speed_course_and_climb() -> None:
    columns = {"v": np.full(2, 36.0), "c": np.full(2, 90.0), "up": np.full(2, 1.0), "s": np.full(2, 0.5)}
    fields = {"speed": "v", "course": "c", "vel_u": "up", "std_vel": "s"}
    out = mapped(columns, role="velocity", columns=fields, units={"speed": "km/h"})
    assert np.allclose(out["vel_n"], [0.0, 10.0, -1.0])
    assert np.allclose(out["cov_vel"], np.eye(3) * 0.25)


def test_local_positions_about_an_origin() -> None:
    columns = {"pose.position": np.array([[0.0, 0.0, 0.0], [0.0, 111.0, 5.0]])}
    fields = {"east": "pose.position.x", "north": "pose.position.y", "up": "pose.position.z"}
    out = mapped(columns, columns=fields, origin_deg_m=(48.0, 11.0, 500.0))
    assert np.allclose(out["lla"][0], [np.radians(48.0), np.radians(11.0), 500.0])
    assert np.degrees(out["lla"][1, 0]) == pytest.approx(48.001, abs=3e-6)
    assert out["lla"][1, 2] == pytest.approx(505.0, abs=0.01)


def test_axes_and_increments_of_an_imu() -> None:
    columns = {"dv": np.tile([0.1, 0.2, 0.981], (5, 1)), "da": np.tile([0.01, 0.02, 0.03], (5, 1))}
    fields = {f"{kind}_{axis}": f"{name}.{axis}" for kind, name in (("gyro", "da"), ("accel", "dv")) for axis in "xyz"}
    out = mapped(columns, role="imu", columns=fields, axes="rfu", increments=True)
    assert np.allclose(out["accel"], [2.0, 1.0, -9.81])
    assert np.allclose(out["gyro"], [0.2, 0.1, -0.3])


def test_bits_no_fix_and_finer_digits() -> None:
    columns = {
        "flags": np.array([1, 65, 129, 0]),
        "y": np.full(4, 480_000_001),
        "yhp": np.full(4, 25),
        "x": np.full(4, 116_000_000),
    }
    out = mapped(
        columns,
        columns={"lat": "y", "lon": "x", "lat_plus": "yhp", "status": "flags & 192"},
        units={"lat": "1e-7 deg", "lon": "1e-7 deg", "lat_plus": "1e-9 deg"},
        status={"0": "single", "64": "float", "128": "fixed"},
        no_fix={"flags & 1": [0]},
    )
    assert out["status"].tolist() == [FixStatus.SINGLE, FixStatus.FLOAT, FixStatus.FIXED, -1]
    assert np.degrees(out["lla"][0, 0]) == pytest.approx(48.000000125, abs=1e-12)


@pytest.mark.parametrize(
    ("time", "column", "expected"),
    [
        ({"column": "t", "unit": "us", "base": "utc"}, START_NS // 1000, "utc"),
        ({"column": "t", "unit": "ms", "base": "gps_tow"}, None, "tow"),
        ({"column": "t", "unit": "ns", "base": "gps"}, 5 * 10**17, "gps"),
    ],
)
def test_times(time: dict[str, str], column: int | None, expected: str) -> None:
    utc = gps_from_utc(np.array([START_NS], dtype=np.int64), LEAP_SECONDS)
    tow = int(utc[0] % (604_800 * 10**9)) // 10**6
    columns = {"t": np.array([tow if column is None else column]), "a": np.zeros(1), "b": np.zeros(1)}
    out = mapped(columns, columns={"lat": "a", "lon": "b"}, time=time)
    assert out["t_gps_ns"][0] == {"utc": utc[0], "tow": utc[0] // 10**6 * 10**6, "gps": 5 * 10**17}[expected]


def test_missing_field_is_named() -> None:
    with pytest.raises(LogError, match=r"names the field 'x\.lat' \(lat\), but its messages have a, b"):
        mapped({"a": np.zeros(2), "b": np.zeros(2)}, columns={"lat": "x.lat", "lon": "b"})
    with pytest.raises(LogError, match="has the role imu, which needs all parts of gyro and accel; it has gyro_x"):
        mapped({"a": np.zeros(2)}, role="imu", columns={"gyro_x": "a"})


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('role = "fix"\ncolumns = { lat = "a" }', "a mapping of messages needs topic or type"),
        ('topic = "/a"\nrole = "fix"\ncolumns = { latt = "a" }', "latt"),
        ('topic = "/a"\nrole = "fix"\ncolumns = { lat = "a" }\nunits = { lat = "degrees" }', "no unit 'degrees'; known are"),
    ],
)
def test_configuration_is_checked(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "c.toml"
    path.write_text(f"[[input.message]]\n{text}\n")
    with pytest.raises(LogError, match=problem):
        load_config(path)


# --- through a bag without definitions, as ROS 2 Humble writes it


def write_humble(path: Path, messages: list[tuple[str, str, int, dict[str, Any]]], release: int = 0) -> Path:
    """A bag whose messages are filled as told, every other field zero; the definitions are taken out of it."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for package in {kind.partition("/")[0] for _, kind, _, _ in messages}:
        for name, texts in definitions_of(package).items():
            store.register(get_types_from_msg(texts[min(release, len(texts) - 1)], name))
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, t_ns, values in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            message = filled(store, kind, {"header.stamp.sec": t_ns // 10**9, "header.stamp.nanosec": t_ns % 10**9} | values)
            writer.write(connections[topic], t_ns, store.serialize_cdr(message, kind))
    database = next(path.glob("*.db3"))
    with sqlite3.connect(database) as connection:
        connection.execute("DROP TABLE IF EXISTS message_definitions")
    connection.close()
    return path


def filled(store: Any, kind: str, values: dict[str, Any], prefix: str = "") -> Any:
    from rosbags.interfaces import Nodetype

    parts: dict[str, Any] = {}
    for name, (node, detail) in store.fielddefs[kind][1]:
        path = prefix + name
        if node == Nodetype.NAME:
            parts[name] = filled(store, detail, values, f"{path}.")
        elif node == Nodetype.BASE:
            parts[name] = values.get(path, "" if detail[0] == "string" else 0)
        elif node == Nodetype.ARRAY:
            parts[name] = np.array(values.get(path, np.zeros(detail[1])), dtype=detail[0][1][0])
        else:
            parts[name] = values.get(path, np.empty(0, dtype=detail[0][1][0]))
    return store.types[kind](**parts)


SCALED = {"lat": round(LAT * 1e7), "lon": round(LON * 1e7), "height": round(HEIGHT * 1e3)}
DRIVERS: dict[str, dict[str, Any]] = {
    "novatel_oem7_msgs/msg/BESTPOS": {"lat": LAT, "lon": LON, "hgt": HEIGHT - 45, "undulation": 45.0, "pos_type.type": 50},
    "septentrio_gnss_driver/msg/PVTGeodetic": {
        "latitude": np.radians(LAT), "longitude": np.radians(LON), "height": HEIGHT, "mode": 4, "h_accuracy": 3,
    },
    "ublox_msgs/msg/NavPVT": SCALED | {"fix_type": 3, "flags": 131, "h_acc": 14, "v_acc": 20},
    "ublox_ubx_msgs/msg/UBXNavPVT": SCALED | {"gps_fix.fix_type": 3, "gnss_fix_ok": True, "carr_soln.status": 2},
    "px4_msgs/msg/SensorGps": {
        "latitude_deg": LAT, "longitude_deg": LON, "altitude_ellipsoid_m": HEIGHT, "fix_type": 6, "eph": 0.02, "epv": 0.03,
    },
    "px4_msgs/msg/VehicleGpsPosition": SCALED | {"alt_ellipsoid": round(HEIGHT * 1e3), "fix_type": 6},
    "mavros_msgs/msg/GPSRAW": SCALED | {"alt_ellipsoid": round(HEIGHT * 1e3), "fix_type": 6, "h_acc": 20, "v_acc": 30},
    "vectornav_msgs/msg/GpsGroup": {"poslla.x": LAT, "poslla.y": LON, "poslla.z": HEIGHT, "fix": 8},
    "gps_msgs/msg/GPSFix": {"latitude": LAT, "longitude": LON, "altitude": HEIGHT, "status.status": 19},
}  # fmt: skip


@pytest.mark.parametrize("kind", DRIVERS)
def test_fixes_of_a_driver_need_no_mapping_and_no_definition(tmp_path: Path, kind: str) -> None:
    utc = gps_from_utc(START_NS + np.arange(N) * 200_000_000, LEAP_SECONDS)
    messages = []
    for i in range(N):
        t_ns = START_NS + i * 200_000_000
        values = dict(DRIVERS[kind])
        tow_ms = int(utc[i] % (604_800 * 10**9)) // 10**6
        values |= {"i_tow": tow_ms, "itow": tow_ms, "timestamp": i * 200_000}
        messages.append(("/gnss", kind, t_ns, values))
    bag = write_humble(tmp_path / "bag", messages)
    fixes = load_timeline([bag]).fixes
    assert fixes is not None
    assert len(fixes) == N
    assert np.allclose(np.degrees(fixes.lla[:, :2]), [LAT, LON], atol=1e-7)
    assert np.allclose(fixes.lla[:, 2], HEIGHT, atol=1e-3)
    assert (fixes.status == FixStatus.FIXED).all()
    assert np.abs(fixes.t_ns - utc).max() <= 1_000_000


@pytest.mark.parametrize("release", [0, 1])
def test_the_release_of_a_driver_is_found(tmp_path: Path, release: int) -> None:
    gnss, imu = "px4_msgs/msg/SensorGps", "px4_msgs/msg/SensorCombined"
    moving = {"gyro_rad": [0.1, 0.2, 0.3], "accelerometer_m_s2": [0.0, 0.0, -9.8]}
    messages = []
    for i in range(N):
        stamp = {"timestamp": i * 100_000}
        messages.append(("/g", gnss, START_NS + i * 10**8, DRIVERS[gnss] | stamp))
        messages.append(("/i", imu, START_NS + i * 10**8, moving | stamp))
    timeline = load_timeline([write_humble(tmp_path / "bag", messages, release)])
    assert timeline.fixes is not None
    assert timeline.imu is not None
    assert np.allclose(np.degrees(timeline.fixes.lla[:, :2]), [LAT, LON])
    assert (timeline.fixes.status == FixStatus.FIXED).all()
    assert np.allclose(timeline.imu.accel, [0.0, 0.0, -9.8])


@pytest.mark.parametrize("role", ["reference", "fix"])
def test_a_topic_may_tell_what_its_type_does_not(tmp_path: Path, role: str) -> None:
    kind = "sensor_msgs/msg/NavSatFix"
    values = {"latitude": LAT, "longitude": LON, "altitude": HEIGHT}
    topics = ["/gnss_1/llh_position", "/ekf/llh_position"]
    messages = [(topic, kind, START_NS + i * 10**8, values) for i in range(N) for topic in topics]
    settings = {"fix": {"channel": "/ekf/llh_position"}} if role == "fix" else {}
    timeline = load_timeline([write_humble(tmp_path / "bag", messages)], InputSettings.model_validate(settings))
    roles = {use.name: use.role for use in timeline.provenance.channels}
    assert roles["/ekf/llh_position"] == "reference"
    assert roles["/ekf/llh_position#fix" if role == "fix" else "/gnss_1/llh_position"] == "fix"


def test_covariances_beside_a_position(tmp_path: Path) -> None:
    package = "septentrio_gnss_driver/msg/"
    messages = []
    for i in range(N):
        t_ns, tow = START_NS + i * 200_000_000, {"block_header.tow": i * 200}
        place = {"latitude": np.radians(LAT), "longitude": np.radians(LON), "mode": 1, "vn": 1.5}
        messages.append(("/pvt", f"{package}PVTGeodetic", t_ns, place | tow))
        if i != 3:
            cov = {"cov_latlat": 4.0, "cov_lonlon": 9.0, "cov_hgthgt": 16.0}
            messages.append(("/cov", f"{package}PosCovGeodetic", t_ns, cov | tow))
        messages.append(
            ("/vcov", f"{package}VelCovGeodetic", t_ns, {"cov_vnvn": 0.01, "cov_veve": 0.04, "cov_vuvu": 0.09} | tow)
        )
    fixes = load_timeline([write_humble(tmp_path / "bag", messages)]).fixes
    assert fixes is not None
    assert np.allclose(fixes.cov_pos[0], np.diag([4.0, 9.0, 16.0]))
    assert np.isnan(fixes.cov_pos[3]).all()
    assert np.allclose(fixes.cov_vel[0], np.diag([0.01, 0.04, 0.09]))
    assert np.allclose(fixes.vel_n[:, 0], 1.5)


def test_one_message_of_several_sensors(tmp_path: Path) -> None:
    kind = "vectornav_msgs/msg/CommonGroup"
    values = {"imu_accel.z": -9.81, "imu_rate.x": 0.1, "position.x": LAT, "position.y": LON, "insstatus.mode": 2}
    messages = [("/vn", kind, START_NS + i * 10**7, values | {"imu_rate.y": i * 0.01}) for i in range(N)]
    log = open_log(write_humble(tmp_path / "bag", messages))
    assert [channel.name for channel in log.channels()] == ["/vn", "/vn#reference"]
    timeline = load_timeline([tmp_path / "bag"])
    assert timeline.imu is not None
    assert timeline.reference is not None
    assert np.allclose(timeline.imu.accel, [0.0, 0.0, -9.81])
    assert np.allclose(np.degrees(timeline.reference.lla[:, 0]), LAT)


@pytest.mark.parametrize("second", ["gps_msgs/msg/GPSFix", "nmea_msgs/msg/Sentence"])
def test_one_topic_with_two_types(tmp_path: Path, second: str) -> None:
    from mcap.writer import Writer

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, texts in (definitions_of("gps_msgs") | definitions_of("nmea_msgs")).items():
        store.register(get_types_from_msg(texts[0], name))
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        for part, kind in enumerate(("sensor_msgs/msg/NavSatFix", second)):
            schema = writer.register_schema(kind, "ros2msg", store.generate_msgdef(kind, ros_version=2)[0].encode())
            channel = writer.register_channel("/fix", "cdr", schema)
            for i in range(N):
                t_ns = START_NS + (part * N + i) * 10**8
                stamp = {"header.stamp.sec": t_ns // 10**9, "header.stamp.nanosec": t_ns % 10**9}
                values = {"latitude": LAT, "longitude": LON, "altitude": HEIGHT, "speed": 2.0, "err_speed": 0.1} | stamp
                writer.add_message(channel, t_ns, bytes(store.serialize_cdr(filled(store, kind, values), kind)), t_ns)
        writer.finish()
    log = open_log(tmp_path / "log.mcap")
    assert [channel.name for channel in log.channels()] == ["/fix", f"/fix#{second}"]
    for channel in (None, "/fix"):
        timeline = load_timeline([tmp_path / "log.mcap"], InputSettings.model_validate({"fix": {"channel": channel}}))
        assert timeline.fixes is not None
        assert len(timeline.fixes) == (2 * N if "GPSFix" in second else N)
        assert np.allclose(np.degrees(timeline.fixes.lla[:, 0]), LAT)


def test_a_solution_that_never_aligned_is_no_reference(tmp_path: Path) -> None:
    ins, gnss = "novatel_oem7_msgs/msg/INSPVAX", "novatel_oem7_msgs/msg/BESTPOS"
    messages = []
    for i in range(N):
        t_ns = START_NS + i * 10**8
        messages += [("/ins", ins, t_ns, {"ins_status.status": 1}), ("/pos", gnss, t_ns, DRIVERS[gnss])]
    bag = write_humble(tmp_path / "bag", messages)
    timeline = load_timeline([bag])
    assert timeline.fixes is not None
    assert timeline.reference is None
    assert any("so there is no reference" in note for note in timeline.provenance.damage)
    with pytest.raises(LogError, match="none of its 30 rows can serve as reference"):
        load_timeline([bag], InputSettings.model_validate({"reference": {"channel": "/ins"}}))


def test_a_mapping_of_the_configuration_goes_first(tmp_path: Path) -> None:
    kind = "px4_msgs/msg/SensorGps"
    values = {"latitude_deg": LAT, "longitude_deg": LON, "altitude_msl_m": 7.0, "altitude_ellipsoid_m": HEIGHT}
    messages = [("/gnss", kind, START_NS + i * 10**8, values | {"timestamp": i * 100_000}) for i in range(N)]
    bag = write_humble(tmp_path / "bag", messages)
    told = mapping(topic="/gn*", fields={"lat": "latitude_deg", "lon": "longitude_deg", "height": "altitude_msl_m"})
    fixes = load_timeline([bag], InputSettings(message=(told,))).fixes
    assert fixes is not None
    assert np.allclose(fixes.lla[:, 2], 7.0)
    assert len(fixes) == N, "the time is known of the type where the mapping names none"


def test_a_mapping_that_fits_no_channel_is_told(tmp_path: Path) -> None:
    kind = "px4_msgs/msg/SensorGps"
    values = {"latitude_deg": LAT, "longitude_deg": LON, "altitude_ellipsoid_m": HEIGHT, "fix_type": 3}
    bag = write_humble(tmp_path / "bag", [("/gnss", kind, START_NS + i * 10**8, values) for i in range(N)])
    told = mapping(topic="/gps", columns={"lat": "a", "lon": "b"})
    (note,) = load_timeline([bag], InputSettings(message=(told,))).provenance.damage
    assert note.startswith("the mapping [[input.message]] for /gps fits no channel and is not used; there is /gnss (px4_msgs")


@pytest.mark.parametrize("role", ["fix", "velocity"])
def test_a_mapping_that_does_not_fit_the_messages_costs_only_its_channel(tmp_path: Path, role: str) -> None:
    kind = "px4_msgs/msg/SensorGps"
    values = {"latitude_deg": LAT, "longitude_deg": LON, "altitude_ellipsoid_m": HEIGHT, "fix_type": 3}
    topics = ("/gnss", "/other")
    messages = [(topic, kind, START_NS + i * 10**8, values | {"timestamp": i * 100_000}) for i in range(N) for topic in topics]
    told = (
        mapping(topic="/gnss", columns={"lat": "latitude_deg", "lon": "longitude_deg"}),
        mapping(topic="/other", role=role, columns={"lat": "lat_deg", "lon": "b"} if role == "fix" else {"vel_n": "north"}),
    )
    settings = InputSettings.model_validate({"message": told, "fix": {"channel": "/gnss"}})
    timeline = load_timeline([write_humble(tmp_path / "bag", messages)], settings)
    assert timeline.fixes is not None
    assert len(timeline.fixes) == N
    assert any("names the field 'north'" in note for note in timeline.provenance.damage) == (role == "velocity")
    if role == "fix":
        with pytest.raises(
            LogError, match=r"channel /other holds no readable message .*names the field 'lat_deg' \(lat\), but"
        ):
            load_timeline([tmp_path / "bag"], InputSettings.model_validate({"message": told, "fix": {"channel": "/other"}}))


def test_sentences_as_messages(tmp_path: Path) -> None:
    def sentence(i: int) -> str:
        body = f"GPGGA,2213{20 + i:02d}.00,4807.4074,N,01136.0000,E,4,12,0.8,467.5,M,45.0,M,,"
        check = 0
        for letter in body:
            check ^= ord(letter)
        return f"${body}*{check:02X}"

    kind = "nmea_msgs/msg/Sentence"
    messages = [("/nmea", kind, START_NS + i * 10**9, {"sentence": sentence(i)}) for i in range(N)]
    fixes = load_timeline([write_humble(tmp_path / "bag", messages)]).fixes
    assert fixes is not None
    assert np.allclose(np.degrees(fixes.lla[0]), [LAT, LON, np.degrees(HEIGHT)], atol=1e-5)
    assert fixes.t_ns[0] == gps_from_utc(np.array([START_NS], dtype=np.int64), LEAP_SECONDS)[0]


def test_inertial_sensor_of_a_receiver(tmp_path: Path) -> None:
    def word(kind: int, value: int) -> int:
        return kind << 24 | value & 0xFFFFFF

    messages = []
    for i in range(N):
        data = [word(14, 4096), word(13, -4096), word(5, 0), word(16, 1024), word(17, 0), word(18, -10 * 1024)]
        values = {"time_tag": i * 100, "data": np.array(data, dtype=np.uint32)}
        messages.append(("/esf", "ublox_msgs/msg/EsfMEAS", START_NS + i * 10**8, values))
    imu = load_timeline([write_humble(tmp_path / "bag", messages)]).imu
    assert imu is not None
    assert np.allclose(imu.gyro, np.radians([1.0, -1.0, 0.0]))
    assert np.allclose(imu.accel, [1.0, 0.0, -10.0])
    assert np.abs(np.diff(imu.t_ns) - 10**8).max() < 1000
