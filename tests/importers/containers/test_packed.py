"""Packed logs, bags without metadata, addresses, and what cannot be read told in one line."""

import bz2
import gzip
import lzma
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

import importers.containers.packed as packed
from importers.containers.remote import address_of
from importers.formats import open_log
from importers.load import load_timeline
from importers.settings import CsvMapping, CsvTime, InputSettings
from navreplay.timeline import LogError
from pipelines.config.spec import load_config
from tests.helpers.log_samples import IMU, ROS2, assert_imus, raw_imus, write_mcap, write_ros1_bag

COUNT = 60


def zipped(data: bytes) -> bytes:
    import io

    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("log.any", data)
    return target.getvalue()


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
    ".zst": zstandard.ZstdCompressor().compress,
    ".zip": zipped,
}


def write_bag(path: Path, plugin: StoragePlugin) -> Path:
    with Writer2(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/imu", IMU, typestore=ROS2)
        for t_ns, raw in raw_imus(ROS2, COUNT):
            writer.write(connection, t_ns + 1, raw)
    return path


@pytest.mark.parametrize("suffix", PACKERS)
@pytest.mark.parametrize("kind", ["mcap", "bag", "db3"])
def test_any_packing_around_any_container(tmp_path: Path, kind: str, suffix: str) -> None:
    if kind == "db3":
        plain = next(write_bag(tmp_path / "bag", StoragePlugin.SQLITE3).glob("*.db3"))
    elif kind == "bag":
        plain = write_ros1_bag(tmp_path / "log.bag", COUNT)
    else:
        plain = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT))
    path = tmp_path / f"log.{kind}{suffix}"
    path.write_bytes(PACKERS[suffix](plain.read_bytes()))
    log = open_log(path)
    assert log.path == str(path)
    assert_imus(log.read(("/imu",))["/imu"], COUNT)
    files = load_timeline([path], InputSettings()).provenance.files
    assert [(file.path, file.size) for file in files] == [(str(path), path.stat().st_size)]


@pytest.mark.parametrize("match", ["fix.csv", "fix.csv.gz", "*.gz"])
def test_a_packed_table_is_mapped_by_either_name(tmp_path: Path, match: str) -> None:
    path = tmp_path / "fix.csv.gz"
    path.write_bytes(gzip.compress(b"t,lat,lon,height\n" + b"".join(b"%d,48,11,500\n" % (1_700_000_000 + i) for i in range(9))))
    told = CsvMapping(
        match=match, role="fix", time=CsvTime(column="t", base="utc"), columns={"lat": "lat", "lon": "lon", "height": "height"}
    )
    assert open_log(path, InputSettings(csv=(told,))).channels()[0].type == "csv/fix"


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("suffix", ["", ".zstd"])
def test_bag_folder_without_metadata(tmp_path: Path, plugin: StoragePlugin, suffix: str) -> None:
    folder = write_bag(tmp_path / "bag", plugin)
    (folder / "metadata.yaml").unlink()
    if suffix:
        for file in list(folder.iterdir()):
            file.with_name(file.name + suffix).write_bytes(zstandard.ZstdCompressor().compress(file.read_bytes()))
            file.unlink()
    log = open_log(folder)
    assert_imus(log.read(("/imu",))["/imu"], COUNT)
    assert any("metadata.yaml is missing" in note for note in log.notes)


def test_zipped_bag_folder(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    path = tmp_path / "bag.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for file in folder.iterdir():
            archive.write(file, f"bag/{file.name}")
    assert_imus(open_log(path).read(("/imu",))["/imu"], COUNT)


@pytest.mark.parametrize("suffix", [".gz", ".bz2", ".xz", ".zst"])
def test_a_packed_log_cut_short_is_read_as_far_as_it_goes(tmp_path: Path, suffix: str) -> None:
    rows = b"".join(b"%d,48,11,%d\n" % (1_700_000_000 + i, i * i * 7919 % 1000) for i in range(200_000))
    whole = PACKERS[suffix](b"t_gps_ns,lat_deg,lon_deg,height_m\n" + rows)
    path = tmp_path / f"fix.csv{suffix}"
    path.write_bytes(whole[: len(whole) * 3 // 4])
    log = open_log(path)
    assert log.read(("fix.csv",))["fix.csv"].read > 1000
    assert any("is cut off" in note for note in log.notes)


def test_a_bomb_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed, "_NEVER_ABSURD", 1 << 20)
    path = tmp_path / "log.mcap.gz"
    path.write_bytes(gzip.compress(bytes(8 << 20)))
    with pytest.raises(LogError, match=r"unpacks to more than 1 MiB from .* bytes, which no log does"):
        open_log(path)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.bag", b"#ROSBAG V1.2\n" + bytes(4096), "a ROS bag of the old format V1.2; write it anew with ROS 1: rosbag filter"),
        ("a.bag", b"#ROSRECORD V1.1\n" + bytes(4096), "a ROS bag of the old format V1.1"),
        ("a.gz", b"\x1f\x8b" + bytes(100), "is packed by gzip, but does not unpack"),
        ("a.zip", b"PK\x03\x04" + bytes(100), "is packed by zip, but does not unpack"),
        ("a.tgz", gzip.compress(bytes(257) + b"ustar" + bytes(250)), "holds a tar archive; unpack it"),
        ("a.csv.gz", gzip.compress(b"what is this?\n" * 9), "a.csv.gz: unknown format"),
    ],
    ids=["v12", "v11", "gzip", "zip", "tar", "unknown"],
)
def test_what_cannot_be_read_is_told(tmp_path: Path, name: str, content: bytes, problem: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError, match=problem) as told:
        open_log(path)
    assert str(told.value).startswith(str(path))
    assert "navreplay-" not in str(told.value), "the scratch file is not the user's"


def test_a_zip_of_several_files_lists_them(tmp_path: Path) -> None:
    path = tmp_path / "logs.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("imu.csv", "a")
        archive.writestr("fix.csv", "b")
    with pytest.raises(LogError, match=r"holds 2 files \(imu.csv, fix.csv\); unpack it and name the logs"):
        open_log(path)


def test_standard_input_is_told() -> None:
    with pytest.raises(LogError, match="cannot come from standard input; save it to a file first"):
        open_log("-")


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_an_address_is_fetched(tmp_path: Path, suffix: str) -> None:
    fsspec = pytest.importorskip("fsspec")
    data = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT)).read_bytes()
    address = f"memory://bucket/log.mcap{suffix}"
    fsspec.filesystem("memory").pipe(address, PACKERS[suffix](data) if suffix else data)
    log = open_log(address)
    assert log.path == address
    assert_imus(log.read(("/imu",))["/imu"], COUNT)
    assert [file.path for file in load_timeline([address]).provenance.files] == [address]


def test_a_reference_at_an_address(tmp_path: Path) -> None:
    pytest.importorskip("fsspec")
    path = tmp_path / "truth.csv"
    rows = "".join(f"{1_384_035_218_000_000_000 + i * 10**8},48,11,500,1,0,0,0\n" for i in range(9))
    path.write_text("t_gps_ns,lat_deg,lon_deg,height_m,q_nb_w,q_nb_x,q_nb_y,q_nb_z\n" + rows)
    log = write_mcap(tmp_path / "log.mcap", raw_imus(ROS2, COUNT))
    config = load_config(None, [f"input.reference.file=file://{path}"])
    timeline = load_timeline([log], config.input)
    assert timeline.reference is not None
    assert len(timeline.reference) == 9


@pytest.mark.parametrize(
    ("path", "address"),
    [
        ("s3://b/k.mcap", "s3://b/k.mcap"), ("s3:/b/k.mcap", "s3://b/k.mcap"), ("file:/a/b", "file:///a/b"),
        ("C:/a.mcap", None),
        ("simplecache::s3://b/k", "simplecache::s3://b/k"), ("/data/a:b.mcap", None), ("a.mcap", None),
        ("https://h/x?a=b", "https://h/x?a=b"),
    ],
)  # fmt: skip
def test_addresses_are_told_from_files(path: str, address: str | None) -> None:
    assert address_of(path) == address


def test_a_bag_folder_at_an_address(tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    for file in write_bag(tmp_path / "bag", StoragePlugin.SQLITE3).iterdir():
        fsspec.filesystem("memory").pipe(f"memory://bags/one/{file.name}", file.read_bytes())
    assert np.isfinite(open_log("memory://bags/one").read(("/imu",))["/imu"].columns["angular_velocity"]).all()


@pytest.mark.parametrize(
    ("address", "problem"),
    [
        ("memory://bucket/none.mcap", "nothing is there"),
        ("nowhere://a/b.mcap", "nowhere"),
        ("file:///no/such.mcap", "nothing is there"),
    ],
)
def test_an_address_that_cannot_be_had_is_told(address: str, problem: str) -> None:
    pytest.importorskip("fsspec")
    with pytest.raises(LogError, match=f"^{address}: .*{problem}"):
        open_log(address)
