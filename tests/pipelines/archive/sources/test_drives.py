"""Which files are one drive: by name, by number, by the time that they share."""

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from importers.settings import InputSettings
from pipelines.archive.sources.drives import ArchiveDrive, find_drives
from pipelines.archive.sources.listing import list_files
from pipelines.archive.sources.seen import SeenFiles
from synthetic_logs import SCENARIOS, simulate, with_duration, write


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives of the same times, each as MCAP and as tables."""
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in ((1, "one.mcap"), (1, "one.csv"), (2, "two.mcap"), (2, "two.csv")):
        write(simulate(with_duration(SCENARIOS["car-short"], 20.0), seed), folder / name, force=True)
    return folder


def cut(source: Path, target: Path, from_s: float, to_s: float, shift_s: float = 0.0) -> None:
    """The messages of a stretch, moved in time."""
    with source.open("rb") as stream, target.open("wb") as out:
        reader, writer = make_reader(stream), Writer(out)
        writer.start()
        channels: dict[int, int] = {}
        begin = reader.get_summary().statistics.message_start_time
        for schema, channel, message in reader.iter_messages():
            if not from_s * 1e9 <= message.log_time - begin < to_s * 1e9:
                continue
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            moved = message.log_time + int(shift_s * 1e9)
            writer.add_message(channels[channel.id], moved, message.data, moved)
        writer.finish()


def find(folder: Path) -> dict[str, ArchiveDrive]:
    return {drive.name: drive for drive in find_drives(list_files([str(folder)]), folder, SeenFiles(InputSettings(), ""))[0]}


def names(drive: ArchiveDrive) -> list[str]:
    return [path.name for path in drive.logs]


def test_a_drive_is_found_with_its_reference(logs: Path, tmp_path: Path) -> None:
    for name in ("one.mcap", "one.truth.csv", "two.imu.csv", "two.fix.csv", "two.truth.csv"):
        shutil.copy(logs / name, tmp_path / name)
    (tmp_path / "notes.md").write_text("no log")
    drives, others = find_drives(list_files([str(tmp_path)]), tmp_path, SeenFiles(InputSettings(), ""))
    found = {drive.name: (names(drive), drive.reference and drive.reference.name) for drive in drives}
    assert found == {"one": (["one.mcap"], "one.truth.csv"), "two": (["two.fix.csv", "two.imu.csv"], "two.truth.csv")}
    assert [path.name for path in others] == ["notes.md"]


def test_splits_follow_each_other_in_time(logs: Path, tmp_path: Path) -> None:
    for number, begin in ((0, 0), (1, 4), (2, 8), (10, 12)):
        cut(logs / "one.mcap", tmp_path / f"drive_{number}.mcap", begin, begin + 4)
    (drive,) = find(tmp_path).values()
    assert (drive.name, names(drive)) == ("drive", [f"drive_{number}.mcap" for number in (0, 1, 2, 10)])
    assert drive.why == "splits of one recording"


def test_numbered_drives_of_other_times_are_apart(logs: Path, tmp_path: Path) -> None:
    shutil.copy(logs / "one.mcap", tmp_path / "drive1.mcap")
    shutil.copy(logs / "two.mcap", tmp_path / "drive2.mcap")
    cut(logs / "one.mcap", tmp_path / "drive3.mcap", 0, 20, shift_s=3600)
    for number in (1, 2, 10):
        shutil.copy(logs / "one.truth.csv", tmp_path / f"drive{number}.truth.csv")
    found = find(tmp_path)
    assert {name: names(drive) for name, drive in found.items()} == {f"drive{n}": [f"drive{n}.mcap"] for n in (1, 2, 3)}
    assert [drive.reference and drive.reference.name for drive in found.values()] == [
        "drive1.truth.csv",
        "drive2.truth.csv",
        None,
    ]


def test_a_receivers_file_goes_with_the_drive_whose_time_it_shares(logs: Path, tmp_path: Path) -> None:
    cut(logs / "one.mcap", tmp_path / "morning.mcap", 0, 20)
    cut(logs / "one.mcap", tmp_path / "noon.mcap", 0, 20, shift_s=7200)
    shutil.copy(logs / "two.fix.csv", tmp_path / "receiver.fix.csv")
    found = find(tmp_path)
    assert names(found["morning"]) == ["morning.mcap", "receiver.fix.csv"]
    assert "files of its time" in found["morning"].why
    assert names(found["noon"]) == ["noon.mcap"]


def test_what_was_made_at_another_time_stays_alone(logs: Path, tmp_path: Path) -> None:
    cut(logs / "one.mcap", tmp_path / "noon.mcap", 0, 20, shift_s=7200)
    shutil.copy(logs / "two.fix.csv", tmp_path / "receiver.fix.csv")
    assert {name: names(drive) for name, drive in find(tmp_path).items()} == {
        "noon": ["noon.mcap"],
        "receiver": ["receiver.fix.csv"],
    }


def test_the_files_of_a_folder_with_names_of_their_own_are_one_drive(logs: Path, tmp_path: Path) -> None:
    shutil.copy(logs / "one.imu.csv", tmp_path / "xsens.imu.csv")
    shutil.copy(logs / "one.fix.csv", tmp_path / "ublox.fix.csv")
    (drive,) = find(tmp_path).values()
    assert names(drive) == ["ublox.fix.csv", "xsens.imu.csv"]


def test_a_folder_is_a_bag_by_its_metadata_and_a_storage_file_alone_is_a_log(tmp_path: Path) -> None:
    for seed, name in ((1, "day/a.db3"), (2, "day/b.mcap"), (3, "day/c"), (4, "day/d.bag")):
        write(simulate(with_duration(SCENARIOS["car-short"], 20.0), seed), tmp_path / name)
    found = find(tmp_path)
    assert {name: names(drive) for name, drive in found.items()} == {
        "day/a": ["a.db3"],
        "day/b": ["b.mcap"],
        "day/c": ["c"],
        "day/d": ["d.bag"],
    }
    assert all(drive.reference is not None for drive in found.values())
