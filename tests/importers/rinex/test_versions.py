"""RINEX 2, Compact RINEX, and types that change within a file: the same observations, however they are written."""

import re
from collections.abc import Sequence
from pathlib import Path

import hatanaka
import ncompress
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from importers import InputSettings, LogError, load_timeline, open_log
from importers.rinex.version_2 import modern_observation
from importers.rows.log import Table
from navreplay.timeline import RangeSeries
from synthetic_logs import SCENARIOS, simulate, with_duration, write

LOG = simulate(with_duration(SCENARIOS["ranges-open"], 3.0), 7)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """An observation file of four epochs and its navigation file."""
    write(LOG, tmp_path / "log.obs")
    return tmp_path / "log.obs", tmp_path / "log.nav"


def ranges_of(*paths: Path, **settings: object) -> RangeSeries:
    ranges = load_timeline(paths, InputSettings.model_validate(settings)).ranges
    assert ranges is not None
    return ranges


def table_of(path: Path, text: str) -> Table:
    path.write_text(text)
    log = open_log(path)
    name = log.channels()[0].name
    return log.read((name,))[name]


def version_2(text: str) -> str:
    """Observations of types C, D, S of version 3 as C1, L1, D1, S1, C2, P2: a phase and two empty columns more."""
    header, body = text.split("END OF HEADER", 1)
    kept = [line for line in header.splitlines() if "SYS / " not in line][:-1]
    kept[0] = "     2.11" + kept[0][9:]
    kept.append("     6    C1    L1    D1    S1    C2    P2".ljust(60) + "# / TYPES OF OBSERV")
    lines = [*kept, " " * 60 + "END OF HEADER"]
    epochs = [part.splitlines() for part in body.split("\n> ")[1:]]
    for head, *rows in epochs:
        names = [row[:3] for row in rows]
        first = f" {head[2:4]}{head[4:27]}  {head[29]}{len(names):3d}"
        lines.append(first + "".join(names[:12]))
        lines += [" " * 32 + "".join(names[start : start + 12]) for start in range(12, len(names), 12)]
        for row in rows:
            code, doppler, strength = (row[3 + 16 * i : 17 + 16 * i].ljust(14) for i in range(3))
            lines.append(f"{code}  {'':14}  {doppler}  {strength}  ".rstrip())
            lines.append("")
    return "\n".join(lines) + "\n"


def test_version_2_gives_the_same_observations(files: tuple[Path, Path], tmp_path: Path) -> None:
    observations, navigation = files
    before = ranges_of(observations, navigation)
    (tmp_path / "log.24o").write_text(version_2(observations.read_text()))
    after = ranges_of(tmp_path / "log.24o", navigation)
    assert before.t_ns.size > 12 * 4
    for name in ("t_ns", "sat", "pseudorange", "range_rate", "cn0", "sat_pos_e"):
        assert np.array_equal(getattr(before, name), getattr(after, name)), name


def test_version_2_navigation_gives_the_same_satellites(files: tuple[Path, Path], tmp_path: Path) -> None:
    observations, navigation = files
    header, body = navigation.read_text().split("END OF HEADER", 1)
    lines = body.splitlines()[1:]
    starts = [row for row, line in enumerate(lines) if line.startswith("G")]
    old = ["     2.11           N: GPS NAV DATA".ljust(60) + "RINEX VERSION / TYPE"]
    for line in header.splitlines():
        for name, label in (("GPSA", "ION ALPHA"), ("GPSB", "ION BETA")):
            if line.startswith(name):
                old.append(f"  {line[5:53]}".ljust(60) + label)
    old.append(" " * 60 + "END OF HEADER")
    for row in starts:
        first = lines[row]
        old.append(f"{int(first[1:3]):2d} {first[6:8]}{first[8:20]}{int(first[21:23]):3d}.0{first[23:]}")
        old += [line[1:] for line in lines[row + 1 : row + 8]]
    (tmp_path / "log.24n").write_text(re.sub(r"E(?=[+-]\d\d)", "D", "\n".join(old)) + "\n")
    before = ranges_of(observations, navigation, range={"systems": ["G"]})
    after = ranges_of(observations, tmp_path / "log.24n", range={"systems": ["G"]})
    assert np.array_equal(before.sat_pos_e, after.sat_pos_e)
    assert np.array_equal(before.pseudorange, after.pseudorange)
    assert before.klobuchar is not None
    assert after.klobuchar is not None
    np.testing.assert_allclose(after.klobuchar, before.klobuchar)


def test_compact_rinex_of_either_version_gives_the_same(files: tuple[Path, Path], tmp_path: Path) -> None:
    observations, navigation = files
    text = observations.read_text()
    before = ranges_of(observations, navigation)
    for name, version in (("modern.crx", text), ("old.24d", version_2(text))):
        (tmp_path / name).write_text(hatanaka.rnx2crx(version))
        assert np.array_equal(ranges_of(tmp_path / name, navigation).pseudorange, before.pseudorange)


def test_files_of_unix_compress_are_unpacked(files: tuple[Path, Path], tmp_path: Path) -> None:
    compressed = [tmp_path / "log.24d.Z", tmp_path / "log.24n.Z"]
    contents = (hatanaka.rnx2crx(version_2(files[0].read_text())), files[1].read_text())
    for path, content in zip(compressed, contents, strict=True):
        path.write_bytes(ncompress.compress(content.encode()))
    assert np.array_equal(ranges_of(*compressed).pseudorange, ranges_of(*files).pseudorange)
    compressed[1].write_bytes(compressed[1].read_bytes()[:3] + b"\xff" * 40)
    with pytest.raises(LogError, match=r"no intact file of Unix compress"):
        ranges_of(*compressed)


def test_damaged_compact_rinex_is_told_in_one_line(files: tuple[Path, Path], tmp_path: Path) -> None:
    compact = hatanaka.rnx2crx(files[0].read_text())
    (tmp_path / "cut.crx").write_text(compact[:200])
    with pytest.raises(LogError, match=r"cannot be unpacked|header has no end|no version") as caught:
        load_timeline([tmp_path / "cut.crx"])
    assert "\n" not in str(caught.value)


def header(types: Sequence[str], system: str = "G", scale: str = "GPS") -> list[str]:
    return [
        f"     3.04           OBSERVATION DATA    {system}".ljust(60) + "RINEX VERSION / TYPE",
        f"{system if system != 'M' else 'G'}  {len(types):3d} {' '.join(types)}".ljust(60) + "SYS / # / OBS TYPES",
        f"  2024     3     5     6     7    8.0000000     {scale}".ljust(60) + "TIME OF FIRST OBS",
    ]


END = " " * 60 + "END OF HEADER"


def epoch(second: int, values: Sequence[float], sat: str = "G05") -> list[str]:
    row = "".join(f"{value:14.3f}  " for value in values)
    return [f"> 2024 03 05 06 07 {second:2d}.0000000  0  1", sat + row]


def test_an_event_may_change_the_types(tmp_path: Path) -> None:
    first, later = ["C1C", "D1C", "S1C"], ["C5Q", "S1C", "C1C", "D1C"]
    lines = [*header(first), END, *epoch(8, [2.1e7, -500.0, 45.0])]
    lines += [">" + " " * 30 + "4  1", header(later)[1]]
    lines += epoch(9, [9.9e6, 44.0, 2.1e7 + 1, -501.0])
    table = table_of(tmp_path / "log.obs", "\n".join(lines) + "\n")
    assert table.columns["pseudorange"].tolist() == [2.1e7, 2.1e7 + 1]
    assert table.columns["cn0"].tolist() == [45.0, 44.0]
    assert np.diff(table.columns["range_rate"])[0] == pytest.approx(0.1903, abs=1e-4)
    assert not table.rejected


def test_scaled_observations_are_scaled_back(tmp_path: Path) -> None:
    types = ["C1C", "D1C", "S1C"]
    scaled = [f"G {100:4d}  {1:2d} D1C".ljust(60) + "SYS / SCALE FACTOR", f"G {10:4d}  {0:2d}".ljust(60) + "SYS / SCALE FACTOR"]
    for lines, values in ((scaled[:1], [2.1e7, -50_000.0, 45.0]), (scaled[1:], [2.1e8, -5000.0, 450.0])):
        table = table_of(tmp_path / "log.obs", "\n".join([*header(types), *lines, END, *epoch(8, values)]) + "\n")
        assert table.columns["pseudorange"].tolist() == [2.1e7]
        assert table.columns["cn0"].tolist() == [45.0]
        assert table.columns["range_rate"][0] == pytest.approx(500 * 299_792_458.0 / 1575.42e6)


def test_version_2_may_change_its_types_too(tmp_path: Path) -> None:
    lines = ["     2.10           OBSERVATION DATA    G".ljust(60) + "RINEX VERSION / TYPE"]
    lines += ["     2    C1    S1".ljust(60) + "# / TYPES OF OBSERV", END]
    lines += [" 99  3  5  6  7  8.0000000  0  1 5".replace(" 1 5", " 1G 5"), f"{2.1e7:14.3f}  {45.0:14.3f}"]
    lines += [
        " " * 28 + "4  2",
        "     3    P1    S1    C1".ljust(60) + "# / TYPES OF OBSERV",
        "new antenna".ljust(60) + "COMMENT",
    ]
    lines += [" 99  3  5  6  7  9.0000000  0  1  5", f"{9.9e6:14.3f}  {44.0:14.3f}  {2.1e7 + 1:14.3f}"]
    table = table_of(tmp_path / "log.99o", "\n".join(lines) + "\n")
    rows = zip(*(table.columns[name].tolist() for name in ("sat", "signal", "pseudorange", "cn0")), strict=True)
    assert sorted(rows) == [
        ("G05", "1C", 2.1e7, 45.0),
        ("G05", "1C", 2.1e7 + 1, 44.0),
        ("G05", "1W", 9.9e6, pytest.approx(np.nan, nan_ok=True)),
    ]
    assert np.diff(np.unique(table.columns["t_gps_ns"])).tolist() == [10**9]
    assert not table.rejected


def test_comments_between_satellites_are_none(tmp_path: Path) -> None:
    first, sat = epoch(8, [2.1e7, 45.0])
    comment = "G05 antenna height 0.077".ljust(60) + "COMMENT"
    table = table_of(tmp_path / "log.obs", "\n".join([*header(["C1C", "S1C"]), END, first, comment, sat]) + "\n")
    assert table.columns["pseudorange"].tolist() == [2.1e7]
    assert not table.rejected


@pytest.mark.parametrize(
    ("system", "scale", "behind_s"), [("C", "   ", 14), ("C", "GPS", 0), ("R", "   ", 18), ("G", "   ", 0)]
)
def test_a_blank_time_system_is_that_of_the_satellites(tmp_path: Path, system: str, scale: str, behind_s: int) -> None:
    types = ["C2I" if system == "C" else "C1C"]
    lines = [*header(types, system, scale), END, *epoch(8, [2.1e7], f"{system}11")]
    told = [*header(types, "M", "GPS"), END, *epoch(8, [2.1e7], "G11")]
    told[1] = "G    1 C1C".ljust(60) + "SYS / # / OBS TYPES"
    times = [
        int(table_of(tmp_path / f"{i}.obs", "\n".join(text) + "\n").columns["t_gps_ns"][0])
        for i, text in enumerate((lines, told))
    ]
    assert (times[0] - times[1]) / 1e9 == behind_s


def test_what_rinex_holds_besides_is_named(tmp_path: Path) -> None:
    (tmp_path / "prod.clk").write_text("     3.00           C".ljust(60) + "RINEX VERSION / TYPE\n" + END + "\n")
    with pytest.raises(LogError, match="a RINEX file of satellite clocks, which is not used"):
        open_log(tmp_path / "prod.clk")
    lines = ["     3.04           N: GNSS NAV DATA    S: SBAS".ljust(60) + "RINEX VERSION / TYPE", END]
    lines += ["S23 2023 11 14 00 00 00-9.000000000000D-08 5.400000000000D-12 5.180000000000D+05", *[" " * 4] * 3]
    with pytest.raises(LogError, match=r"no ephemeris that can be read, of 1 records \(message of another kind 1\)"):
        table_of(tmp_path / "sbas.nav", "\n".join(lines) + "\n")


OLD = [
    "     2.11           OBSERVATION DATA    M (MIXED)".ljust(60) + "RINEX VERSION / TYPE",
    "     6    C1    L1    D1    S1    P2    C2".ljust(60) + "# / TYPES OF OBSERV",
    END,
]


def old_epoch(second: int) -> list[str]:
    rows = [f"{2e7 + 100 * second + i:14.3f}  {'':14}  {-500.0:14.3f}  {45.0:14.3f}\n" for i in range(3)]
    return f" 24  3  5  6  7 {second:2d}.0000000  0  3G05G07R11\n{''.join(f'{row}{chr(10)}' for row in rows)}".split("\n")[:-1]


@settings(max_examples=150, deadline=None)
@given(
    line=st.integers(0, 6),
    column=st.integers(0, 79),
    letter=st.characters(min_codepoint=32, max_codepoint=126),
    lines_lost=st.integers(0, 3),
)
def test_damage_to_an_epoch_of_version_2_costs_no_other(line: int, column: int, letter: str, lines_lost: int) -> None:
    epochs = [old_epoch(second) for second in range(10, 15)]
    row = epochs[2][line].ljust(80)
    epochs[2][line : line + 1 + lines_lost] = [row[:column] + letter + row[column + 1 :]]
    text = modern_observation("\n".join([*OLD, *(line for part in epochs for line in part)]) + "\n").split("\n")
    for second in (10, 11, 13, 14):
        start = text.index(f"> 2024  3  5  6  7 {second:2d}.0000000  0  3")
        assert [row[:17] for row in text[start + 1 : start + 4]] == [
            f"{sat}{2e7 + 100 * second + i:14.3f}" for i, sat in enumerate(("G05", "G07", "R11"))
        ]
