"""Whatever unpacks is bounded, and what is no log is refused in one line."""

import bz2
import gzip
import lzma
import zipfile
from pathlib import Path

import numpy as np
import pytest
import zstandard

import importers.containers.compression as compression
import importers.containers.packed as packed
import importers.decoding.ros as ros
import importers.rinex.text as rinex_text
import importers.text.unix_compress as unix_compress
from importers.formats import open_log
from navreplay.timeline import LogError

MIB = 1 << 20
ZEROS = bytes(8 * MIB)


@pytest.fixture(autouse=True)
def low_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (packed, unix_compress, rinex_text):
        monkeypatch.setattr(module, "_NEVER_ABSURD", MIB)
    monkeypatch.setattr(ros, "_LARGEST_MESSAGE", MIB)


@pytest.mark.parametrize(
    ("suffix", "pack"),
    [(".gz", gzip.compress), (".bz2", bz2.compress), (".xz", lzma.compress), (".zst", zstandard.ZstdCompressor().compress)],
)
def test_a_packed_file(tmp_path: Path, suffix: str, pack: object) -> None:
    path = tmp_path / f"log.csv{suffix}"
    path.write_bytes(pack(ZEROS))  # type: ignore[operator]
    with pytest.raises(LogError, match=r"unpacks to more than 1 MiB from .* bytes, which no log does"):
        open_log(path)


def test_a_zip_by_all_of_its_files_together(tmp_path: Path) -> None:
    path = tmp_path / "bag.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(4):
            archive.writestr(f"bag/bag_{number}.mcap", bytes(MIB * 3 // 4))
    with pytest.raises(LogError, match="unpacks to more than 1 MiB"):
        open_log(path)


def test_packings_in_packings(tmp_path: Path) -> None:
    content = b"t,lat,lon,height\n1,2,3,4\n"
    for _ in range(4):
        content = gzip.compress(content)
    path = tmp_path / "log.gz"
    path.write_bytes(content)
    with pytest.raises(LogError, match="is packed more than 3 times over") as told:
        open_log(path)
    assert str(told.value).startswith(str(path))


def test_unix_compress(tmp_path: Path) -> None:
    ncompress = pytest.importorskip("ncompress")
    path = tmp_path / "site.24o.Z"
    path.write_bytes(ncompress.compress(ZEROS))
    with pytest.raises(LogError, match="unpacks to more than 1 MiB"):
        open_log(path)


def test_compact_rinex() -> None:
    head = f"{'G  999 C1C':<60}SYS / # / OBS TYPES\n".encode()
    with pytest.raises(LogError, match="which no log does"):
        rinex_text._check_compact_size("a.crx", head + b"\n" * 10_000)
    rinex_text._check_compact_size("a.crx", f"{'G    4 C1C L1C D1C S1C':<60}SYS / # / OBS TYPES\n".encode() + b"line\n" * 1000)


@pytest.mark.parametrize("name", ["zstd", "lz4", "bz2"])
def test_a_chunk_of_a_container(name: str) -> None:
    import lz4.frame

    packs = {"zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress, "bz2": bz2.compress}
    data = packs[name](ZEROS)
    try:
        assert len(compression.decompress(name, data, MIB)) == MIB, "no more than it declares"
    except compression.DamagedDataError:
        assert name == "zstd", "which declares its size in the frame, too"
    with pytest.raises(compression.DamagedDataError, match="absurd"):
        compression.decompress(name, data, 1 << 40)


@pytest.mark.parametrize("name", ["zstd", "lz4", "bz2"])
def test_what_is_left_of_a_chunk(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import lz4.frame

    monkeypatch.setattr(compression, "MAX_CHUNK_BYTES", MIB)
    packs = {"zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress, "bz2": bz2.compress}
    assert compression.decompress_prefix(name, packs[name](ZEROS)) == bytes(MIB)


def test_a_message_packed_by_itself() -> None:
    frames = [zstandard.ZstdCompressor().compress(content) for content in (b"\x00\x01small", ZEROS)]
    buffer = np.frombuffer(b"".join(frames), dtype=np.uint8)
    ends = np.cumsum([len(frame) for frame in frames])
    expanded, start, stop = ros._expand(buffer, ends - [len(frame) for frame in frames], ends)
    assert [bytes(expanded[a:b]) for a, b in zip(start, stop, strict=True)] == [b"\x00\x01small", b""]
