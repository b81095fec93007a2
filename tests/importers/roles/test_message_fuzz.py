"""Messages whose fields hold anything at all: used, or refused in a sentence; never a traceback."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from importers.decoding.json_text import JsonDecoder
from importers.meanings.draft import draft_mapping
from importers.rows.log import Channel, Table
from navreplay.timeline import LogError
from tests.helpers.log_samples import START_NS
from tests.helpers.memory_log import load_tables

N = 6
VECTOR = {"x": 0.1, "y": 0.2, "z": 9.8}
STAMP = {"sec": START_NS // 10**9, "nsec": 0}
HEADER = {"header": {"stamp": STAMP, "frame_id": "a"}}
FIX = {"latitude": 48.0, "longitude": 11.0, "altitude": 500.0, "position_covariance": [1.0] * 9, "position_covariance_type": 2}
MESSAGES: dict[str, dict[str, Any]] = {
    "foxglove.LocationFix": {"timestamp": STAMP} | FIX,
    "sensor_msgs/NavSatFix": HEADER | FIX | {"status": {"status": 0, "service": 1}},
    "gps_msgs/GPSFix": HEADER | FIX | {"status": {"status": 0}, "speed": 1.0, "track": 9.0, "climb": 0.0, "err_speed": 0.1},
    "sensor_msgs/Imu": HEADER
    | {"angular_velocity": VECTOR, "linear_acceleration": VECTOR, "orientation": VECTOR | {"w": 1.0}}
    | {f"{name}_covariance": [0.1] * 9 for name in ("angular_velocity", "linear_acceleration", "orientation")},
    "geometry_msgs/TwistWithCovarianceStamped": HEADER | {"twist": {"twist": {"linear": VECTOR}, "covariance": [0.1] * 36}},
    "navreplay.Imu": {"timestamp": STAMP, "angular_velocity": VECTOR, "linear_acceleration": VECTOR},
    "navreplay.Velocity": {"timestamp": STAMP, "velocity": VECTOR},
    "navreplay.GnssRanges": {"t_gps_ns": 5, "satellites": [{"sat": "G05", "signal": "1C", "pseudorange_m": 2e7}]},
}  # fmt: skip
JUNK = (
    None, True, -1, 0, 2**70, 1e308, float("nan"), "", "NaN", "12", "2023-11-14T22:13:20Z", "2023-13-44T22:13:20Z", "abc", [],
    [1], [None, 1.0, 2.0], ["a"], [[1]], [{}], {}, {"sec": "x"}, {"sec": 2**63, "nsec": 5}, {"x": 1.0}, {"x": "a", "y": 1},
)  # fmt: skip


def mutated(message: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The message with one field, at any depth, left out or replaced by junk."""
    message = json.loads(json.dumps(message))
    place = message
    while True:
        key = list(place)[rng.integers(len(place))]
        if isinstance(place[key], dict) and place[key] and rng.random() < 0.7:
            place = place[key]
            continue
        if rng.random() < 0.15:
            del place[key]
        else:
            place[key] = JUNK[rng.integers(len(JUNK))]
        return message


def decoded(messages: list[dict[str, Any]]) -> Table:
    texts = [json.dumps(message).encode() for message in messages]
    ends = np.cumsum([len(text) for text in texts])
    out = JsonDecoder().decode(np.frombuffer(b"".join(texts), dtype=np.uint8), ends - [len(text) for text in texts], ends)
    return Table(START_NS + np.arange(len(out.kept)) * 10**8, out.columns, len(texts))


@pytest.mark.parametrize("kind", MESSAGES)
def test_any_field_may_hold_anything(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(11)
    for some in range(60):
        share = (1.0, 0.4)[some % 2]
        base = MESSAGES[kind]
        spoiled = mutated(base, rng)
        table = decoded([spoiled if rng.random() < share else base for _ in range(N)])
        draft_mapping(Channel("/x", "my_msgs/X", "json", N), table)
        told = use_of(tmp_path, kind, table)
        assert "\n" not in told
        assert "object at" not in told


def use_of(folder: Path, kind: str, table: Table) -> str:
    """What is told of a table that cannot be used; else nothing, and its accounting balances."""
    try:
        timeline = load_tables(folder, {"/x": (kind, table)})
    except LogError as error:
        return str(error)
    assert all(use.read == use.used + sum(use.rejected.values()) for use in timeline.provenance.channels)
    return ""
