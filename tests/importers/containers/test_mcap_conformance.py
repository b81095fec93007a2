"""MCAP files with every feature of the format there or not, written byte by byte as the specification says (https://mcap.dev/spec)."""

import itertools
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from importers.containers.mcap import McapLog
from importers.inspection import inspect_logs
from navreplay.timeline import LogError

MAGIC = b"\x89MCAP0\r\n"
SECTIONS = ("chunks", "message_index", "statistics", "schemas", "channels", "chunk_index", "attachment_index", "offsets")
T_NS = 1_700_000_000_000_000_000


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


@dataclass
class Drawer:
    """Writes a file. features: what it has of `SECTIONS`, ``crc``, and ``padding`` (bytes behind the known fields of records,
    which a reader must pass over)."""

    features: frozenset[str]
    data: bytearray = field(default_factory=lambda: bytearray(MAGIC))

    def record(self, opcode: int, content: bytes, padded: bool = True) -> bytes:
        if padded and "padding" in self.features:
            content += b"\1\2\3"
        return struct.pack("<BQ", opcode, len(content)) + content

    def crc(self, content: bytes) -> int:
        return zlib.crc32(content) if "crc" in self.features else 0


SCHEMA = struct.pack("<H", 1) + text("Example") + text("jsonschema") + text("{}")


def channel_record(schema: int) -> bytes:
    return struct.pack("<HH", 1, schema) + text("example") + text("json") + struct.pack("<I", 0)


def write(path: Path, features: frozenset[str], messages: int, schema: int, extras: bool) -> Path:
    """A file with messages on one channel (none: no channel either), an attachment and metadata among them."""
    drawer = Drawer(features)
    drawer.data += drawer.record(0x01, text("") + text(""))
    head = [drawer.record(0x03, SCHEMA)] if schema and messages else []
    head += [drawer.record(0x04, channel_record(schema))] if messages else []
    bodies = [
        drawer.record(0x05, struct.pack("<HIQQ", 1, i, T_NS + i, T_NS + i) + b'{"value": %d}' % i, padded=False)
        for i in range(messages)
    ]
    chunk_index = b""
    if "chunks" in features and messages:
        chunk_index = write_chunk(drawer, head, bodies)
    else:
        drawer.data += b"".join(head + bodies)
    attachment_index = write_extras(drawer) if extras else b""
    drawer.data += drawer.record(0x0F, struct.pack("<I", drawer.crc(bytes(drawer.data))))
    write_summary(drawer, head, messages, schema, chunk_index, attachment_index)
    path.write_bytes(drawer.data)
    return path


def write_chunk(drawer: Drawer, head: list[bytes], bodies: list[bytes]) -> bytes:
    """A chunk with its message index; returns the chunk index record."""
    records = b"".join(head + bodies)
    start = len(drawer.data)
    span = struct.pack("<QQ", T_NS, T_NS + len(bodies) - 1)
    content = span + struct.pack("<QI", len(records), drawer.crc(records)) + text("") + struct.pack("<Q", len(records))
    drawer.data += drawer.record(0x06, content + records)
    chunk_length, index_at, offsets = len(drawer.data) - start, len(drawer.data), b""
    if "message_index" in drawer.features:
        at, entries = sum(map(len, head)), b""
        for i, body in enumerate(bodies):
            entries += struct.pack("<QQ", T_NS + i, at)
            at += len(body)
        offsets = struct.pack("<HQ", 1, index_at)
        drawer.data += drawer.record(0x07, struct.pack("<HI", 1, len(entries)) + entries)
    index = span + struct.pack("<QQ", start, chunk_length) + struct.pack("<I", len(offsets)) + offsets
    index += struct.pack("<Q", len(drawer.data) - index_at) + text("") + struct.pack("<QQ", len(records), len(records))
    return drawer.record(0x08, index)


def write_extras(drawer: Drawer) -> bytes:
    """An attachment and metadata; returns their index records."""
    start = len(drawer.data)
    attachment = struct.pack("<QQ", 2, 1) + text("photo") + text("image/raw") + struct.pack("<Q", 3) + b"\1\2\3"
    drawer.data += drawer.record(0x09, attachment + struct.pack("<I", drawer.crc(attachment)), padded=False)
    index = struct.pack("<QQQQQ", start, len(drawer.data) - start, 2, 1, 3) + text("photo") + text("image/raw")
    at = len(drawer.data)
    drawer.data += drawer.record(0x0C, text("origin") + struct.pack("<I", 0))
    metadata = struct.pack("<QQ", at, len(drawer.data) - at) + text("origin")
    return drawer.record(0x0A, index) + drawer.record(0x0D, metadata)


def write_summary(drawer: Drawer, head: list[bytes], messages: int, schema: int, chunks: bytes, attachments: bytes) -> None:
    start, groups = len(drawer.data), []
    if "schemas" in drawer.features and schema and messages:
        groups.append((0x03, head[0]))
    if "channels" in drawer.features and messages:
        groups.append((0x04, head[-1]))
    if "statistics" in drawer.features:
        counts = struct.pack("<HQ", 1, messages) if messages else b""
        fixed = struct.pack("<QHIIIIQQ", messages, bool(schema and messages), bool(messages), 0, 0, bool(chunks), 0, 0)
        groups.append((0x0B, drawer.record(0x0B, fixed + struct.pack("<I", len(counts)) + counts)))
    if "chunk_index" in drawer.features and chunks:
        groups.append((0x08, chunks))
    if "attachment_index" in drawer.features and attachments:
        groups.append((0x0A, attachments))
    at, offsets = start, b""
    for opcode, records in groups:
        offsets += drawer.record(0x0E, struct.pack("<BQQ", opcode, at, len(records)))
        at += len(records)
    summary = b"".join(records for _, records in groups)
    drawer.data += summary
    offset_start = len(drawer.data) if "offsets" in drawer.features and groups else 0
    drawer.data += offsets if offset_start else b""
    footer = struct.pack("<BQQQ", 0x02, 20, start if summary else 0, offset_start)
    drawer.data += footer + struct.pack("<I", drawer.crc(bytes(drawer.data[start:]) + footer)) + MAGIC


def combinations() -> list[frozenset[str]]:
    """Every feature of the first five there or not, each with the others all there, all missing, and one alone."""
    found = []
    for some in itertools.product((False, True), repeat=5):
        first = {name for name, there in zip(SECTIONS, some, strict=False) if there}
        for rest in ((), ("padding",), ("crc",), (*SECTIONS[5:], "crc", "padding"), *((name,) for name in SECTIONS[5:])):
            found.append(frozenset(first | set(rest)))
    return found


@pytest.mark.parametrize("extras", [False, True], ids=["plain", "attachment and metadata"])
@pytest.mark.parametrize(("messages", "schema"), [(0, 0), (1, 1), (1, 0), (10, 1)])
def test_every_feature_there_or_not(tmp_path: Path, messages: int, schema: int, extras: bool) -> None:
    for features in combinations():
        path = write(tmp_path / "log.mcap", features, messages, schema, extras)
        log = McapLog(str(path))
        assert log.notes == (), f"a file as the specification says, with {sorted(features)}"
        assert [(channel.name, channel.type, channel.count in (messages, None)) for channel in log.channels()] == (
            [("example", "Example" if schema else "", True)] if messages else []
        )
        if messages:
            table = log.read(("example",))["example"]
            assert (table.read, table.rejected) == (messages, {}), sorted(features)
            assert table.columns["value"].tolist() == list(range(messages))
            assert table.log_time_ns.tolist() == [T_NS + i for i in range(messages)]
        assert log.notes == ()


def test_a_file_without_messages_is_told_as_such(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", frozenset(SECTIONS), 0, 0, True)
    inspection = inspect_logs([path])
    assert inspection.channels == ()
    assert [finding.code for finding in inspection.findings if finding.code in ("damaged", "unreadable")] == []


@pytest.mark.parametrize("features", [frozenset(), frozenset({"chunks", "crc"}), frozenset((*SECTIONS, "crc"))], ids=len)
def test_a_recording_that_was_not_closed_is_told(tmp_path: Path, features: frozenset[str]) -> None:
    path = write(tmp_path / "log.mcap", features, 10, 1, False)
    path.write_bytes(path.read_bytes()[:-8])
    log = McapLog(str(path))
    assert any("was the recording closed?" in note for note in log.notes)
    assert log.read(("example",))["example"].columns["value"].tolist() == list(range(10))
    path.write_bytes(path.read_bytes()[:20])
    with pytest.raises(LogError, match="was cut off early, or is damaged beyond use"):
        McapLog(str(path))


def test_a_damaged_index_is_told_as_such(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mcap", frozenset((*SECTIONS, "crc")), 10, 1, False)
    content = bytearray(path.read_bytes())
    content[-40] ^= 1
    path.write_bytes(content)
    log = McapLog(str(path))
    assert log.notes == ("its index is damaged; the file was read through from its start",)
    assert log.read(("example",))["example"].read == 10
