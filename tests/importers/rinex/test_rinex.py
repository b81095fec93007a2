"""RINEX and SP3: layouts, and what is wrong with them told in one line."""

from pathlib import Path

import numpy as np
import pytest

from importers import InputSettings, LogError, load_timeline, open_log
from importers.rinex.text import exponent_numbers, plain_numbers
from navreplay.timeline import Timeline
from synthetic_logs import SCENARIOS, simulate, with_duration, write

LOG = simulate(with_duration(SCENARIOS["ranges-open"], 3.0), 7)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """An observation file of four epochs and its navigation file."""
    write(LOG, tmp_path / "log.obs")
    return tmp_path / "log.obs", tmp_path / "log.nav"


def load(*paths: Path, **settings: object) -> Timeline:
    return load_timeline(paths, InputSettings.model_validate(settings))


def rejected(timeline: Timeline, role: str) -> dict[str, int]:
    return next(dict(use.rejected) for use in timeline.provenance.channels if use.role == role)


def test_plain_numbers_are_rounded_as_python_does() -> None:
    texts = [
        "  20576396.770",
        "-0.5          ",
        "   1064.326   ",
        "              ",
        " 12.3 4       ",
        "1e5           ",
        "--1   ",
    ]
    chars = np.array([list(text.ljust(14).encode()) for text in texts], dtype=np.uint8)
    expected = [20576396.770, -0.5, 1064.326, np.nan, np.nan, np.nan, np.nan]
    assert np.array_equal(plain_numbers(chars), expected, equal_nan=True)


def test_exponents_may_be_written_with_d() -> None:
    texts = [" -.344484578818D-03", "  1.5E+01          ", "                   ", "  what             "]
    chars = np.array([list(text.encode()) for text in texts], dtype=np.uint8)
    assert np.array_equal(exponent_numbers(chars), [-0.344484578818e-3, 15.0, np.nan, np.nan], equal_nan=True)
    assert np.array_equal(exponent_numbers(chars[:3]), [-0.344484578818e-3, 15.0, np.nan], equal_nan=True)


def test_a_navigation_file_may_be_named_in_the_settings(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    timeline = load(observations, range={"navigation": [str(navigation)]})
    assert timeline.ranges is not None
    assert [use.role for use in timeline.provenance.channels] == ["range", "ephemeris"]
    with pytest.raises(LogError, match=r"no ephemeris \d+; add the navigation file"):
        load(observations)


def test_a_header_that_miscounts_its_types_is_refused(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    text = observations.read_text()
    types = next(line for line in text.splitlines() if "SYS / # / OBS TYPES" in line)
    observations.write_text(text.replace(types, types[:3] + "  9" + types[6:]))
    with pytest.raises(LogError, match=r"announces 9 observation types for \w but lists \d"):
        load(observations, navigation)


def test_a_header_that_names_other_types_costs_all_and_says_so(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = observations.read_text().splitlines(keepends=True)
    swapped = [
        line.replace("C1C", "x").replace("D1C", "C1C").replace("x", "D1C") if "OBS TYPES" in line and line[0] in "GE" else line
        for line in lines
    ]
    observations.write_text("".join(swapped))
    with pytest.raises(LogError, match=r"absurd pseudorange \d+.*; do its header or mapping name the right column"):
        load(observations, navigation, range={"systems": ["G", "E"]})


def test_lines_with_more_than_the_header_allows_are_rejected(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = observations.read_text().splitlines()
    row = next(i for i, line in enumerate(lines) if line.startswith("G"))
    body = next(i for i, line in enumerate(lines) if line.startswith(">")) + 1
    row = max(row, body)
    lines[row] = lines[row].ljust(200) + "1.000"
    observations.write_text("\n".join(lines) + "\n")
    assert rejected(load(observations, navigation), "range") == {"more observations than the header's types": 1}


def test_damaged_epochs_and_events_are_counted(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = observations.read_text().splitlines()
    epochs = [i for i, line in enumerate(lines) if line.startswith(">")]
    count = epochs[1] - epochs[0] - 1
    lines[epochs[0]] = lines[epochs[0]].replace(" 20", " xx", 1)
    event = [">" + " " * 30 + "4  1", "THE RECEIVER WAS MOVED".ljust(60) + "COMMENT"]
    empty = [lines[epochs[-1]][:32] + "  0"]
    observations.write_text("\n".join([*lines, *event, *empty]) + "\n")
    assert rejected(load(observations, navigation), "range") == {"epoch line damaged": count, "epoch without satellites": 1}


def test_duplicate_satellites_and_absurd_ranges_are_rejected(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = observations.read_text().splitlines()
    last = max(i for i, line in enumerate(lines) if line.startswith(">"))
    lines[last] = lines[last][:32] + f"{len(lines) - last:3d}"
    lines.append(lines[-1])
    lines[last + 1] = lines[last + 1][:3] + f"{5.0:14.3f}" + lines[last + 1][17:]
    observations.write_text("\n".join(lines) + "\n")
    assert rejected(load(observations, navigation), "range") == {"satellite twice in an epoch": 1, "absurd pseudorange": 1}


def test_ephemerides_of_another_week_are_told(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    year = next(line for line in observations.read_text().splitlines() if line.startswith(">"))[2:6]
    lines = observations.read_text().replace(f"> {year}", f"> {int(year) + 1}")
    observations.write_text(lines)
    with pytest.raises(LogError, match=r"ephemeris beyond its validity \d+; is the navigation file of another day"):
        load(observations, navigation)


def test_stamps_in_another_time_scale_are_told(files: tuple[Path, Path]) -> None:
    with pytest.raises(LogError, match=r"its pseudoranges meet nowhere.*leap seconds: set input\.range\.time_offset_s"):
        load(*files, range={"time_offset_s": -18.0})


def test_unhealthy_satellites_are_rejected(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = navigation.read_text().splitlines()
    sat = next(line for line in observations.read_text().splitlines() if line.startswith("G") and "." in line[:20])[:3]
    for i in [i for i, line in enumerate(lines) if line.startswith(sat)]:
        lines[i + 6] = lines[i + 6][:23] + f"{1.0:19.12E}" + lines[i + 6][42:]
    navigation.write_text("\n".join(lines) + "\n")
    assert rejected(load(observations, navigation), "range") == {"satellite unhealthy": 4}


def test_cut_and_damaged_records_are_counted(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    lines = navigation.read_text().splitlines()
    starts = [i for i, line in enumerate(lines) if line[:1] in ("G", "E", "C") and line[3:4] == " "]
    lines[starts[0] + 2] = lines[starts[0] + 2][:30] + "?" + lines[starts[0] + 2][31:]
    navigation.write_text("\n".join(lines[:-3]) + "\n")
    assert rejected(load(observations, navigation), "ephemeris") == {"damaged ephemeris": 1, "record cut short": 1}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("     3.", "     1.", 1), r"RINEX 1\.\d\d is not read, only versions 2 to 4"),
        (lambda text: text.replace("     3.", "     2.", 1), "holds no pseudorange of a chosen signal"),
        (lambda text: text.replace("END OF HEADER", "END OF       "), "its RINEX header has no end"),
        (lambda text: text.replace("SYS / # / OBS TYPES", "COMMENT            "), "lists no observation types"),
        (lambda text: text[: text.index("END OF HEADER") + 14], "holds no pseudorange of a chosen signal"),
        (lambda text: text.replace("C1C", "C5Q").replace("C2I", "C6I"), "has none of the signals of input.range.signals"),
    ],
)
def test_files_that_cannot_be_used_say_why(files: tuple[Path, Path], change: object, message: str) -> None:
    assert callable(change)
    observations, navigation = files
    observations.write_text(change(observations.read_text()))
    with pytest.raises(LogError, match=message) as caught:
        load(observations, navigation)
    assert "\n" not in str(caught.value)


def as_version_4(text: str) -> str:
    """The same ephemerides as RINEX 4 messages, with one message of a kind that is not read."""
    header, body = text.split("END OF HEADER", 1)
    kinds = {"G": "LNAV", "E": "INAV", "C": "D1"}
    lines = []
    for line in body.splitlines()[1:]:
        if line[:1] in kinds:
            lines.append(f"> EPH {line[:3]} {kinds[line[0]]}")
        lines.append(line)
    ionosphere = ["> ION G01 LNAV", " " * 23 + "".join(f"{value:19.12E}" for value in (1e-8, 2e-8, 3e-8))]
    ionosphere.append(" " * 4 + "".join(f"{value:19.12E}" for value in (4e-8, 5e4, 6e4, 7e4)))
    ionosphere.append(" " * 4 + f"{8e4:19.12E}")
    first = lines.index(next(line for line in lines if line.startswith("G")))
    other = ["> EPH G05 CNAV", *lines[first : first + 8]]
    kept = [line for line in header.splitlines(keepends=True) if "IONOSPHERIC CORR" not in line]
    start = "".join(kept).replace("     3.0", "     4.0", 1)
    return f"{start}END OF HEADER\n" + "\n".join([*ionosphere, *lines, *other]) + "\n"


def test_version_4_gives_the_same(files: tuple[Path, Path]) -> None:
    observations, navigation = files
    before = load(observations, navigation).ranges
    navigation.write_text(as_version_4(navigation.read_text()))
    timeline = load(observations, navigation)
    assert before is not None
    assert timeline.ranges is not None
    assert np.array_equal(timeline.ranges.sat_pos_e, before.sat_pos_e)
    assert rejected(timeline, "ephemeris") == {"message of another kind": 1}
    assert timeline.ranges.klobuchar is not None
    np.testing.assert_allclose(timeline.ranges.klobuchar, [1e-8, 2e-8, 3e-8, 4e-8, 5e4, 6e4, 7e4, 8e4])


@pytest.mark.parametrize("version", [3, 4])
def test_the_ionosphere_of_beidou_is_taken_where_there_is_no_other(files: tuple[Path, Path], version: int) -> None:
    observations, navigation = files
    text = navigation.read_text()
    before = load(observations, navigation).ranges
    if version == 4:
        text = as_version_4(text).replace("> ION G01 LNAV", "> ION C06 D1D2")
    navigation.write_text(text.replace("GPSA", "BDSA").replace("GPSB", "BDSB"))
    timeline = load(observations, navigation)
    assert timeline.ranges is not None
    assert timeline.ranges.klobuchar is not None
    assert before is not None
    assert before.klobuchar_system == "G"
    assert timeline.ranges.klobuchar_system == "C"
    expected = before.klobuchar if version == 3 else [1e-8, 2e-8, 3e-8, 4e-8, 5e4, 6e4, 7e4, 8e4]
    np.testing.assert_allclose(timeline.ranges.klobuchar, expected)


def sp3_text(epochs: int, ranges_start_ns: int) -> str:
    """Satellites G01 and R02 on circles."""
    start = np.datetime64("1980-01-06") + np.timedelta64(ranges_start_ns // 10**9 - 5 * 900, "s")
    lines = ["#dP", "##  ", "%c M  cc GPS ccc cccc"]
    for k in range(epochs):
        year, month, day, hour, minute, second = (
            str(start + np.timedelta64(900 * k, "s")).translate(str.maketrans("-T:", "   ")).split()
        )
        lines.append(f"*  {year} {month:>2} {day:>2} {hour:>2} {minute:>2} {float(second):11.8f}")
        angle = 0.05 * k
        place = f"{26000 * np.cos(angle):14.6f}{26000 * np.sin(angle):14.6f}{100.0:14.6f}"
        lines += [f"PG01{place}{12.5:14.6f}", f"PR02{place}{999999.999999:14.6f}"]
    return "\n".join([*lines, "EOF"]) + "\n"


def test_sp3_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.sp3"
    path.write_text(sp3_text(12, 1_300_000_000 * 10**9))
    log = open_log(path)
    (channel,) = log.channels()
    assert channel.type == "sp3"
    table = log.read((channel.name,))[channel.name]
    assert table.columns["t_gps_ns"][10] == 1_300_000_000 * 10**9
    assert table.columns["pos"][0].tolist() == [26e6, 0.0, 1e5]
    assert table.columns["clock"][:2].tolist() == pytest.approx([12.5e-6, np.nan], nan_ok=True)
    path.write_text(sp3_text(5, 1_300_000_000 * 10**9))
    with pytest.raises(LogError, match="fewer than 10 epochs"):
        open_log(path).read(("a.sp3",))
