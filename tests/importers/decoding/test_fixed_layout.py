"""Decoding by the column equals rosbags' own decoding, bit for bit, and falls back by itself."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from importers.decoding.fixed_layout import derive_layout, matching_rows
from importers.decoding.leaves import columns_of_messages
from importers.decoding.ros import RosDecoder
from importers.decoding.ros_definitions import find_type
from navreplay.timeline import LogError
from tests.helpers.log_samples import FIX, IMU, ROS1, ROS2, START_NS, imu, imu_rows

TYPES = (
    IMU,
    FIX,
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/QuaternionStamped",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/TimeReference",
    "sensor_msgs/msg/Range",
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/Point32",
    "std_msgs/msg/Bool",
    "std_msgs/msg/String",
)
FIXED = [name for name in TYPES if not name.endswith("JointState")]
SPECIAL = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324])


def random_value(store: Typestore, desc: Any, rng: np.random.Generator, texts: list[str]) -> Any:
    """A value of a field, any bit pattern; texts are drawn from those given."""
    node, detail = desc
    if node == Nodetype.NAME:
        fields = store.fielddefs[detail][1]
        return store.types[detail](*(random_value(store, field, rng, texts) for _, field in fields))
    if node == Nodetype.BASE:
        basic = detail[0]
        if basic == "string":
            return str(rng.choice(np.array(texts, dtype=object)))
        if basic == "bool":
            return bool(rng.integers(2))
        return random_numbers(basic, 1, rng)[0].item()
    element, count = detail
    length = count if node == Nodetype.ARRAY else int(rng.integers(3))
    if element[1][0] == "string":
        return [random_value(store, element, rng, texts) for _ in range(length)]
    return random_numbers(element[1][0], length, rng)


def random_numbers(basic: str, count: int, rng: np.random.Generator) -> np.ndarray:
    """Numbers of any bit pattern, special values among the floats; a float32 NaN only as it survives conversion."""
    dtype = np.dtype(basic)
    values = np.frombuffer(rng.bytes(count * dtype.itemsize), dtype=dtype).copy()
    if dtype.kind == "f":
        odd = rng.random(count) < 0.3
        values[odd | np.isnan(values)] = rng.choice(SPECIAL, int((odd | np.isnan(values)).sum())).astype(dtype)
    return values


def serialize(store: Typestore, message: Any, name: str, little: bool) -> bytes:
    if store is ROS1:
        return bytes(store.serialize_ros1(message, name))
    return bytes(store.serialize_cdr(message, name, little_endian=little))


def packed(raws: list[bytes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Buffer, start, stop of messages with some bytes between them."""
    gap = b"\xaa\xbb\xcc"
    stop = np.cumsum([len(raw) + len(gap) for raw in raws])
    start = stop - [len(raw) for raw in raws]
    return np.frombuffer(b"".join(gap + raw for raw in raws), dtype=np.uint8), start, stop


def expected_columns(store: Typestore, name: str, raws: list[bytes]) -> dict[str, np.ndarray]:
    deserialize = store.deserialize_ros1 if store is ROS1 else store.deserialize_cdr
    leaves = find_type(name, "", "msg", encoding_of(store)).leaves
    return columns_of_messages(leaves, [deserialize(raw, name) for raw in raws])


def encoding_of(store: Typestore) -> str:
    return "ros1" if store is ROS1 else "cdr"


def assert_equal_columns(found: Any, expected: dict[str, np.ndarray]) -> None:
    assert list(found) == list(expected)
    for path, column in expected.items():
        assert found[path].dtype == column.dtype, path
        assert found[path].shape == column.shape, path
        if column.dtype == object:
            assert [repr(np.array(value).tolist()) for value in found[path]] == [
                repr(np.array(value).tolist()) for value in column
            ], path
        else:
            assert found[path].tobytes() == column.tobytes(), path


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(TYPES),
    store=st.sampled_from([ROS1, ROS2]),
    seed=st.integers(0, 2**32 - 1),
    texts=st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=12), min_size=1, max_size=4),
    little=st.lists(st.booleans(), min_size=1, max_size=2),
    count=st.integers(1, 12),
)
def test_columns_equal_the_library(
    name: str, store: Typestore, seed: int, texts: list[str], little: list[bool], count: int
) -> None:
    rng = np.random.default_rng(seed)
    messages = [random_value(store, (Nodetype.NAME, name), rng, texts) for _ in range(count)]
    raws = [serialize(store, message, name, little[i % len(little)]) for i, message in enumerate(messages)]
    decoder = RosDecoder(find_type(name, "", "msg", encoding_of(store)), encoding_of(store))
    decoded = decoder.decode(*packed(raws))
    assert decoded.kept.tolist() == list(range(count))
    assert_equal_columns(decoded.columns, expected_columns(store, name, raws))


@pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "cdr"])
@pytest.mark.parametrize("name", FIXED)
def test_fixed_layout_is_used(name: str, store: Typestore) -> None:
    """Messages of one layout never reach the slow path: the layout itself matches them all."""
    rng = np.random.default_rng(0)
    messages = [random_value(store, (Nodetype.NAME, name), rng, ["base_link"]) for _ in range(20)]
    raws = [serialize(store, message, name, True) for message in messages]
    ros_type = find_type(name, "", "msg", encoding_of(store))
    layout = derive_layout(ros_type.leaves, raws[0], encoding_of(store))
    assert ros_type.fixed
    assert layout is not None
    places, rows = matching_rows(layout, *packed(raws))
    assert places.tolist() == list(range(20))
    assert len(rows) == 20


def test_ever_new_string_lengths_fall_back() -> None:
    rows = imu_rows(60)
    raws = [bytes(ROS2.serialize_cdr(imu(ROS2, START_NS, row, "x" * i), IMU)) for i, row in enumerate(rows)]
    decoded = RosDecoder(find_type(IMU, "", "msg", "cdr"), "cdr").decode(*packed(raws))
    assert decoded.columns["header.frame_id"].tolist() == ["x" * i for i in range(60)]
    assert_equal_columns(decoded.columns, expected_columns(ROS2, IMU, raws))


@pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "cdr"])
def test_only_damaged_messages_are_lost(store: Typestore) -> None:
    raws = [serialize(store, imu(store, START_NS, row), IMU, True) for row in imu_rows(8)]
    frame_at = raws[0].index(b"imu_link")
    raws[0] = raws[0][:40]
    raws[3] = raws[3][:frame_at] + b"\xff" + raws[3][frame_at + 1 :]
    raws[5] = raws[5][: frame_at - 4] + b"\xff\xff\xff\xff" + raws[5][frame_at:]
    raws[6] = b""
    decoded = RosDecoder(find_type(IMU, "", "msg", encoding_of(store)), encoding_of(store)).decode(*packed(raws))
    assert decoded.kept.tolist() == [1, 2, 4, 7]
    assert decoded.reason == "not decodable as sensor_msgs/msg/Imu"
    assert_equal_columns(decoded.columns, expected_columns(store, IMU, [raws[i] for i in (1, 2, 4, 7)]))


def test_cdr_padding_behind_a_message_is_accepted_up_to_three_bytes() -> None:
    raws = [bytes(ROS2.serialize_cdr(imu(ROS2, START_NS, row), IMU)) + b"\0" * i for i, row in enumerate(imu_rows(5))]
    decoded = RosDecoder(find_type(IMU, "", "msg", "cdr"), "cdr").decode(*packed(raws))
    assert decoded.kept.tolist() == [0, 1, 2, 3]


def test_definition_in_the_log_wins_over_the_standard_one() -> None:
    text = (
        "float64 speed\nstring<=8 unit\nuint8[3] levels\nmy_msgs/Part part\n"
        + "=" * 80
        + "\nMSG: my_msgs/Part\nfloat32 x\nbool on\n"
    )
    ros_type = find_type("my_msgs/msg/Speed", text, "msg", "cdr")
    assert [(leaf.path, leaf.kind.value) for leaf in ros_type.leaves] == [
        ("speed", "number"),
        ("unit", "text"),
        ("levels", "array"),
        ("part.x", "number"),
        ("part.on", "number"),
    ]
    assert ros_type.fixed


def test_idl_definition() -> None:
    text = "module my_msgs { module msg { struct Speed { double speed; float covariance[4]; }; }; };"
    ros_type = find_type("my_msgs/msg/Speed", text, "idl", "cdr")
    assert [(leaf.path, leaf.count) for leaf in ros_type.leaves] == [("speed", 1), ("covariance", 4)]


def test_unknown_type_is_named() -> None:
    with pytest.raises(LogError, match="type my_msgs/msg/Speed is not defined in the log, is no standard type of ROS"):
        find_type("my_msgs/msg/Speed", "", "msg", "cdr")


@pytest.mark.parametrize(
    "text", ["float64 = = =", "my_msgs/Missing part", "my_msgs/Missing[] parts", "wstring name", "\x00\x01"]
)
def test_broken_definition_is_told(text: str) -> None:
    with pytest.raises(LogError, match=r"the definition of type my_msgs/msg/Speed in the log .*is the file damaged\?"):
        find_type("my_msgs/msg/Speed", text, "msg", "cdr")
