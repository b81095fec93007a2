"""Mappings drafted for types that are not known."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from importers.meanings.draft import draft_mapping
from importers.rows.log import Channel, Table
from pipelines.cli import main
from pipelines.config.spec import load_config
from tests.helpers.log_samples import START_NS

N = 400
RATE_HZ = 50


def drafted(columns: dict[str, Any]) -> dict[str, Any]:
    arrays = {name: np.asarray(column) for name, column in columns.items()}
    n = len(next(iter(arrays.values())))
    draft = draft_mapping(Channel("/x", "my_msgs/msg/X", "cdr", n), Table(START_NS + np.arange(n) * 10**7, arrays, n))
    assert draft is not None
    assert draft.usable
    (mapping,) = tomllib.loads("\n".join(draft.lines))["input"]["message"]
    return mapping


VECTOR = np.tile([0.1, 0.2, 0.3], (9, 1))
FORCE = np.tile([0.1, 0.2, -9.8], (9, 1))


def axes(name: str, vectors: np.ndarray, letters: str = "xyz") -> dict[str, np.ndarray]:
    return {f"{name}{letter}": vectors[:, place] for place, letter in enumerate(letters)}


@pytest.mark.parametrize(
    ("columns", "units"),
    [
        ({"gyro": VECTOR, "accel": FORCE}, ("rad/s", "m/s2")),
        ({"imu.angular_rate": VECTOR * 100, "imu.linear_acceleration": FORCE / 9.8}, ("deg/s", "g")),
        ({"gyro_dps": VECTOR, "acc_mg": FORCE * 102}, ("deg/s", "mg")),
        (axes("gyro_", VECTOR) | axes("acc_", FORCE), ("rad/s", "m/s2")),
        (axes("imu.w", VECTOR) | axes("imu.a", FORCE), ("rad/s", "m/s2")),
        (axes("gyro", VECTOR, "XYZ") | axes("accel", FORCE, "XYZ"), ("rad/s", "m/s2")),
        (axes("angular_velocity_", VECTOR) | axes("linear_acceleration_", FORCE), ("rad/s", "m/s2")),
    ],
)  # fmt: skip
def test_inertial_sensors(columns: dict[str, Any], units: tuple[str, str]) -> None:
    mapping = drafted(columns)
    assert mapping["role"] == "imu"
    assert {mapping["units"][f"gyro_{axis}"] for axis in "xyz"} == {units[0]}
    assert {mapping["units"][f"accel_{axis}"] for axis in "xyz"} == {units[1]}


@pytest.mark.parametrize(
    ("columns", "expected", "unit"),
    [
        ({"latitude": [48.0], "longitude": [11.0], "altitude": [500.0]}, {"lat", "lon", "height"}, "deg"),
        ({"pos.lat": [480_000_000], "pos.lng": [110_000_000], "pos.hae": [500_000]}, {"lat", "lon", "height"}, "1e-7 deg"),
        (
            {"lat_rad": [0.84], "lon_rad": [0.19], "north_velocity": [1.0], "east_velocity": [2.0]},
            {"lat", "lon", "vel_n", "vel_e"},
            "rad",
        ),
        ({"gpsLat": [48.0], "gpsLon": [11.0], "speed_kmh": [36.0], "cog": [90.0]}, {"lat", "lon", "speed", "course"}, "deg"),
    ],
)
def test_fixes(columns: dict[str, Any], expected: set[str], unit: str) -> None:
    mapping = drafted(columns)
    assert mapping["role"] == "fix"
    assert mapping["columns"].keys() == expected
    assert mapping["units"]["lat"] == unit


@pytest.mark.parametrize(
    ("values", "unit", "base"),
    [
        ({"time_s": [1.7e9]}, "s", "utc"),
        ({"timestamp_ms": [1_700_000_000_000]}, "ms", "utc"),
        ({"utc_time_us": [1_700_000_000_000_000]}, "us", "utc"),
        ({"gps_time": [1.384e9]}, "s", "gps"),
        ({"itow": [252_818_000]}, "ms", "gps_tow"),
    ],
)
def test_times(values: dict[str, Any], unit: str, base: str) -> None:
    time = drafted({"lat": [48.0], "lon": [11.0]} | values)["time"]
    assert (time["unit"], time["base"]) == (unit, base)


def test_nothing_is_drafted_for_what_holds_no_measurement() -> None:
    table = Table(np.zeros(2, dtype=np.int64), {"voltage": np.ones(2), "name": np.array(["a", "b"], dtype=object)}, 2)
    assert draft_mapping(Channel("/x", "my_msgs/msg/Battery", "cdr", 2), table) is None


def write_unknown(path: Path) -> Path:
    """An IMU and a receiver at rest, in JSON of types that nobody knows."""
    rng = np.random.default_rng(2)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [
            writer.register_channel(topic, "json", writer.register_schema(name, "jsonschema", b"{}"))
            for topic, name in (("/raw/imu", "acme.Inertial"), ("/raw/gnss", "acme.Receiver"))
        ]
        for i in range(N):
            t_ns = START_NS + i * 10**9 // RATE_HZ
            gyro, accel = rng.normal(0, 1e-3, 3).tolist(), (rng.normal(0, 0.02, 3) + [0, 0, -9.81]).tolist()
            writer.add_message(
                channels[0], t_ns, json.dumps({"gyro": gyro, "accel": accel, "t_us": t_ns // 1000}).encode(), t_ns
            )
            if i % 10 == 0:
                fix = {"lat_e7": 480_000_000 + i, "lon_e7": 110_000_000, "height_mm": 500_000, "h_acc": 900, "v_acc": 1500}
                writer.add_message(channels[1], t_ns, json.dumps(fix | {"utc_ms": t_ns // 10**6}).encode(), t_ns)
        writer.finish()
    return path


def test_a_drafted_configuration_reads_the_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, config = write_unknown(tmp_path / "log.mcap"), tmp_path / "c.toml"
    assert main(["init", str(log), "-o", str(config)]) == 0
    told = load_config(config).input.message
    assert [(mapping.topic, mapping.role) for mapping in told] == [("/raw/imu", "imu"), ("/raw/gnss", "fix")]
    assert main(["inspect", str(log), "-c", str(config)]) == 0
    shown = capsys.readouterr().out
    assert "There is no IMU" not in shown
    assert "There are no GNSS fixes" not in shown
    assert main(["init", str(log), "-c", str(config), "-o", str(config), "--force"]) == 0
    assert load_config(config).input.message == told
