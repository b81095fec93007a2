"""Messages of a release whose header has no idle_time, in a bag without definitions, are rejected and never misread."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from importers import load_timeline
from importers.drivers.packages import definitions_of
from importers.meanings.novatel_release import check_release
from navreplay.timeline import LogError
from tests.importers.meanings.test_mapped_messages import filled

T_NS = 1_700_000_000 * 10**9


def write_old(path: Path, kind: str, names: tuple[str, ...], old: bool, values: dict[str, object]) -> Path:
    """A bag of Humble; names: of frame and message, whose lengths move the fields behind them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, texts in definitions_of("novatel_oem7_msgs").items():
        text = texts[0].replace("uint8 idle_time\n", "") if old else texts[0]
        store.register(get_types_from_msg(text, name))
    type = f"novatel_oem7_msgs/msg/{kind}"
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/bestpos", type, typestore=store)
        for i in range(40):
            t_ns = T_NS + i * 10**9
            stamp = {"header.stamp.sec": t_ns // 10**9, "header.frame_id": names[0], "nov_header.message_name": names[1]}
            message = filled(store, type, stamp | values)
            writer.write(connection, t_ns, store.serialize_cdr(message, type))
    with sqlite3.connect(next(path.glob("*.db3"))) as connection:
        connection.execute("DROP TABLE IF EXISTS message_definitions")
    return path


BESTPOS = {"lat": 48.2, "lon": 11.6, "hgt": 545.0, "pos_type.type": 50, "lat_stdev": 0.01, "lon_stdev": 0.01, "hgt_stdev": 0.02}


@pytest.mark.parametrize("names", [("gps", "BESTPOS"), ("gps", "BESTPOSA"), ("antenna", "BESTPOS"), ("", "")])
def test_an_old_release_is_refused_and_the_newer_read(tmp_path: Path, names: tuple[str, ...]) -> None:
    fixes = load_timeline([write_old(tmp_path / "new", "BESTPOS", names, False, BESTPOS)]).fixes
    np.testing.assert_allclose(np.degrees(fixes.lla[:, :2]), np.tile([48.2, 11.6], (40, 1)))
    with pytest.raises(LogError, match=r"another release of novatel_oem7_msgs|not decodable as novatel_oem7_msgs"):
        load_timeline([write_old(tmp_path / "old", "BESTPOS", names, True, BESTPOS)])


def test_codes_that_no_receiver_tells_are_proof() -> None:
    sound = {"sol_status.status": np.zeros(9, int), "pos_type.type": np.full(9, 50), "lat": np.full(9, 48.0)}
    check_release(sound, "novatel_oem7_msgs/msg/BESTPOS")
    for change in (
        {"sol_status.status": np.full(9, 50)},
        {"pos_type.type": np.full(9, 1_202_590_842)},
        {"lat": np.full(9, 545.0)},
    ):
        with pytest.raises(LogError, match="another release"):
            check_release(sound | change, "novatel_oem7_msgs/msg/BESTPOS")
