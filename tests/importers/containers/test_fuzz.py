"""Random damage: always tables that balance, or one line for the user; never a crash."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin

from importers.containers.mcap import McapLog
from importers.containers.ros1_bag import Ros1Bag
from importers.containers.ros2_bag import Ros2Bag
from importers.rows.log import Log
from navreplay.timeline import LogError
from tests.helpers.log_samples import ROS1, ROS2, raw_imus, write_mcap, write_ros1_bag
from tests.importers.containers.test_bags import write_ros2_bag
from tests.importers.containers.test_mcap import NO_INDEX, write_json

CASES = 40


def write_bare_sqlite(path: Path) -> Path:
    return write_ros2_bag(path.with_suffix(""), 60, StoragePlugin.SQLITE3) / f"{path.stem}.db3"


WRITERS: dict[str, tuple[Callable[[str], Log], Callable[[Path], Path]]] = {
    "mcap": (McapLog, lambda path: write_mcap(path, raw_imus(ROS2, 60), compression=CompressionType.NONE, chunk_size=4000)),
    "mcap zstd": (McapLog, lambda path: write_mcap(path, raw_imus(ROS2, 60), chunk_size=4000)),
    "mcap ros1 lz4": (McapLog, lambda path: write_mcap(path, raw_imus(ROS1, 60), "ros1", CompressionType.LZ4, chunk_size=4000)),
    "mcap no index": (McapLog, lambda path: write_mcap(path, raw_imus(ROS2, 60), use_chunking=False, **NO_INDEX)),
    "mcap no crc": (
        McapLog,
        lambda path: write_mcap(path, raw_imus(ROS2, 60), compression=CompressionType.NONE, chunk_size=4000, enable_crcs=False),
    ),
    "mcap json": (McapLog, lambda path: write_json(path, [b'{"t": {"sec": 1, "nsec": 2}, "v": [1, 2]}'] * 60)),
    "bag": (Ros1Bag, lambda path: write_ros1_bag(path, 60, chunk=4000)),
    "bag bz2": (Ros1Bag, lambda path: write_ros1_bag(path, 60, Writer1.CompressionFormat.BZ2, chunk=4000)),
    "bag lz4": (Ros1Bag, lambda path: write_ros1_bag(path, 60, Writer1.CompressionFormat.LZ4, chunk=4000)),
    "sqlite": (Ros2Bag, write_bare_sqlite),
}


def damage(content: bytes, rng: np.random.Generator) -> bytes:
    """Flip a few bits, overwrite a stretch, or cut."""
    broken = bytearray(content)
    kind = rng.integers(3)
    if kind == 0:
        for _ in range(rng.integers(1, 6)):
            broken[rng.integers(len(broken))] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        at, length = int(rng.integers(len(broken))), int(rng.integers(1, 200))
        broken[at : at + length] = rng.bytes(len(broken[at : at + length]))
    else:
        del broken[int(rng.integers(len(broken))) :]
    return bytes(broken)


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_files_give_tables_or_one_line(tmp_path: Path, name: str) -> None:
    open_log, write = WRITERS[name]
    suffix = {"m": ".mcap", "b": ".bag", "s": ".db3"}[name[0]]
    content = write(tmp_path / f"sound{suffix}").read_bytes()
    path = tmp_path / f"broken{suffix}"
    rng = np.random.default_rng(20)
    messages, refusals = 0, []
    for _ in range(CASES):
        path.write_bytes(damage(content, rng))
        try:
            log = open_log(str(path))
            tables = log.read(tuple(channel.name for channel in log.channels()))
        except LogError as error:
            refusals.append(str(error))
            continue
        for table in tables.values():
            assert table.read == len(table.log_time_ns) + sum(table.rejected.values())
            assert all(len(column) == len(table.log_time_ns) for column in table.columns.values())
            messages += len(table.log_time_ns)
    assert messages > CASES * 60 * 0.3
    assert not [text for text in refusals if "\n" in text]
