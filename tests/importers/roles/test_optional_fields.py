"""Fields that are empty, absent or written another way leave a message usable for the rest."""

import json
from typing import Any

import numpy as np
import pytest

from importers.decoding.json_text import JsonDecoder
from importers.roles.heights import fill_unknown_heights
from importers.roles.messages import find_kind, stamp_column
from importers.rows.log import Table
from importers.rows.message_fields import either_spelling, find_field
from importers.rows.tables import NO_FIX, Rows
from navreplay.timeline import FixStatus

N = 4
T_NS = 1_700_000_000_123_456_789


def rows_of(type: str, columns: dict[str, np.ndarray]) -> Rows:
    kind = find_kind(type)
    assert kind is not None
    return kind.rows(either_spelling(columns))


def decoded(messages: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    texts = [json.dumps(message).encode() for message in messages]
    ends = np.cumsum([len(text) for text in texts])
    starts = ends - [len(text) for text in texts]
    return dict(JsonDecoder().decode(np.frombuffer(b"".join(texts), dtype=np.uint8), starts, ends).columns)


def fixes(**more: Any) -> dict[str, np.ndarray]:
    return {"latitude": np.full(N, 48.0), "longitude": np.full(N, 11.0), "altitude": np.full(N, 500.0)} | more


@pytest.mark.parametrize(
    "covariance",
    [None, np.full((N, 9), np.nan), np.array([np.empty(0)] * N + [None], dtype=object)[:N], np.zeros((N, 4))],
    ids=["absent", "nan", "empty", "too short"],
)
def test_fix_without_a_covariance_keeps_its_position(covariance: np.ndarray | None) -> None:
    columns = fixes() if covariance is None else fixes(position_covariance=covariance)
    rows = rows_of("foxglove.LocationFix", columns)
    assert np.allclose(rows.lla, [np.radians(48.0), np.radians(11.0), 500.0])
    assert np.isnan(rows.cov_pos).all()


@pytest.mark.parametrize(
    ("stamp", "expected"),
    [
        ("2023-11-14T22:13:20.123456789Z", T_NS),
        ("2023-11-14T23:13:20.123456789+01:00", T_NS),
        ("2023-11-14t22:13:20z", T_NS - 123_456_789),
        ({"seconds": "1700000000", "nanos": 123456789}, T_NS),
        ({"seconds": "1700000000"}, T_NS - 123_456_789),
        (str(T_NS), T_NS),
    ],
)
def test_stamps_of_json_in_every_spelling(stamp: Any, expected: int) -> None:
    assert decoded([{"timestamp": stamp}] * 2)["timestamp"].tolist() == [expected] * 2


@pytest.mark.parametrize("per_second", [1, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("whole", [False, True])
def test_stamps_that_are_plain_numbers(per_second: float, whole: bool) -> None:
    seconds = [1_700_000_000 + 2 * i for i in range(9)]
    stamps = [int(s * per_second) if whole else s * per_second for s in seconds]
    table = Table(np.array(seconds) * 10**9 + 5000, decoded([{"timestamp": stamp} for stamp in stamps]), 9)
    found = stamp_column(table)
    assert found is not None
    assert np.abs(found - np.array(seconds) * 10**9).max() < 1000


def test_stamps_from_power_on_are_no_seconds_of_a_calendar() -> None:
    boot = np.arange(2000) * 10**7 + 10**9  # passes 1.7e9 after 0.7 s
    table = Table(T_NS + np.arange(2000) * 10**7, {"header.stamp": boot}, 2000)
    assert np.array_equal(stamp_column(table), boot)


def test_protobufs_own_json_form() -> None:
    message = {
        "timestamp": "2023-11-14T22:13:20Z",
        "latitude": 48,
        "longitude": "11.5",
        "altitude": "NaN",
        "positionCovariance": [1, 0, 0, 0, 4, 0, 0, 0, "NaN"],
        "positionCovarianceType": "APPROXIMATED",
    }
    rows = rows_of("foxglove.LocationFix", decoded([message] * N))
    assert np.allclose(np.degrees(rows.lla[:, :2]), [48.0, 11.5])
    assert np.isnan(rows.lla[:, 2]).all()
    assert np.allclose(np.diagonal(rows.cov_pos, axis1=1, axis2=2)[:, :2], [4.0, 1.0])


def test_vectors_whose_zeros_were_left_out() -> None:
    columns = decoded([{"angular_velocity": {"z": 0.5}}, {"angular_velocity": {"x": 1, "y": 2, "z": 3}}])
    assert columns["angular_velocity"].tolist() == [[0, 0, 0.5], [1, 2, 3]]


@pytest.mark.parametrize(
    ("code", "expected"),
    [(-2, 0), (-1, NO_FIX), (0, FixStatus.SINGLE), (1, FixStatus.DIFFERENTIAL), (2, FixStatus.FIXED), (7, FixStatus.UNKNOWN)],
)
def test_status_of_nav_sat_fix(code: int, expected: int) -> None:
    columns = fixes(position_covariance=np.tile(np.eye(3).ravel() * 1e-4, (N, 1)), **{"status.status": np.full(N, code)})
    assert rows_of("sensor_msgs/NavSatFix", columns).status.tolist() == [expected] * N


@pytest.mark.parametrize(
    ("code", "expected"),
    [(-1, NO_FIX), (0, FixStatus.SINGLE), (18, FixStatus.DIFFERENTIAL), (19, FixStatus.FIXED), (20, FixStatus.FLOAT), (99, 0)],
)
def test_status_of_gps_fix(code: int, expected: int) -> None:
    assert rows_of("gps_msgs/GPSFix", fixes(**{"status.status": np.full(N, code)})).status.tolist() == [expected] * N


def test_speed_that_was_never_filled_is_unknown() -> None:
    empty = {name: np.zeros(N) for name in ("speed", "track", "climb", "err_speed", "err_climb")}
    assert np.isnan(rows_of("gps_msgs/GPSFix", fixes(**empty)).vel).all()
    standing = rows_of("gps_msgs/GPSFix", fixes(**(empty | {"err_speed": np.full(N, 0.4), "err_climb": np.full(N, 0.4)})))
    assert (standing.vel == 0).all()


def test_climb_that_was_never_filled_has_no_weight() -> None:
    moving = {"speed": np.full(N, 3.0), "track": np.full(N, 90.0), "climb": np.zeros(N), "err_speed": np.full(N, 0.4)}
    rows = rows_of("gps_msgs/GPSFix", fixes(**moving))
    assert np.allclose(rows.vel, [0.0, 3.0, 0.0])
    assert np.allclose(np.diagonal(rows.cov_vel, axis1=1, axis2=2), [0.04, 0.04, 1e4])


@pytest.mark.parametrize("field", ["angular_velocity", "linear_acceleration"])
def test_imu_that_lacks_a_sensor(field: str) -> None:
    rng = np.random.default_rng(1)
    columns = {name: rng.normal(size=(N, 3)) for name in ("angular_velocity", "linear_acceleration")}
    told = np.zeros((N, 9))
    told[:, 0] = -1
    part = {"angular_velocity": "gyro", "linear_acceleration": "accel"}[field]
    said = rows_of("sensor_msgs/Imu", columns | {f"{field}_covariance": told})
    assert getattr(said, part) is not None, "a driver that says so wrongly still measured something"
    assert getattr(rows_of("sensor_msgs/Imu", columns | {field: np.zeros((N, 3))}), part) is None
    assert (
        getattr(rows_of("sensor_msgs/Imu", columns | {field: np.full((N, 3), 2.0), f"{field}_covariance": told}), part) is None
    )


@pytest.mark.parametrize("known", [0, 2])
def test_position_without_height_counts_over_ground(known: int) -> None:
    lla = np.tile([0.8, 0.2, np.nan], (5, 1))
    lla[:known, 2] = 100.0
    cov = np.tile(np.diag([1.0, 4.0, 9.0]), (5, 1, 1))
    cov[4] = np.nan
    rows, told = fill_unknown_heights(Rows(lla=lla, cov_pos=cov, status=np.full(5, FixStatus.FIXED, dtype=np.int8)))
    assert told.startswith(f"{5 - known} of 5 positions have no height")
    assert np.isfinite(rows.lla).all()
    assert np.array_equal(rows.cov_pos[:known], cov[:known])
    assert np.allclose(np.diagonal(rows.cov_pos[3])[:2], [1.0, 4.0])
    assert np.allclose(np.diagonal(rows.cov_pos[4])[:2], 0.02**2)
    assert (rows.cov_pos[known:, 2, 2] >= 1e4).all()


def test_elements_of_fields() -> None:
    columns = {"linear": np.arange(6.0).reshape(2, 3), "list": np.array([[1.0, 2.0], [3.0]], dtype=object)}
    assert find_field(columns, "linear.z").tolist() == [2.0, 5.0]
    assert find_field(columns, "linear[1]").tolist() == [1.0, 4.0]
    assert np.array_equal(find_field(columns, "list[1]"), [2.0, np.nan], equal_nan=True)
    assert find_field(columns, "linear.w") is None
    assert find_field(columns, "angular.x") is None
