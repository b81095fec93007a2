"""Damaged files of raw ranges: whatever the damage, rows are counted or one clear line is raised, never a traceback."""

from pathlib import Path

import numpy as np
import pytest

from importers import InputSettings, LogError, inspect_logs, load_timeline
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.paths import DATA
from tests.helpers.receiver_at_rest import received, satellites
from tests.importers.conversion.test_ranges import settings, write_table
from tests.importers.rinex.test_rinex import as_version_4, sp3_text
from tests.importers.text.test_fuzz import damage
from tests.importers.text.test_smartphone import HEAD, row

SAMPLE = DATA / "walk_0827.ubx"
SEEDS = range(20)
LOG = simulate(with_duration(SCENARIOS["ranges-open"], 2.0), 3)


def assert_told(paths: list[Path], options: InputSettings) -> None:
    """Accounts balance (checked where they are made), or one line says what is wrong; the same from inspect."""
    told = ""
    try:
        load_timeline(paths, options)
        inspect_logs(paths, options)
    except LogError as error:
        told = str(error)
    assert "\n" not in told


def shaken(whole: bytes, random: np.random.Generator) -> bytes:
    """Damage, and numbers of the body exchanged for others."""
    data = bytearray(damage(whole, random))
    for _ in range(int(random.integers(0, 40))):
        place = int(random.integers(len(data)))
        if chr(data[place]).isdigit():
            data[place] = ord(str(int(random.integers(10))))
    return bytes(data)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("part", ["log.obs", "log.nav", "version 4"])
def test_rinex(tmp_path: Path, part: str, seed: int) -> None:
    write(LOG, tmp_path / "log.obs")
    if part == "version 4":
        (tmp_path / "log.nav").write_text(as_version_4((tmp_path / "log.nav").read_text()))
        part = "log.nav"
    path = tmp_path / part
    path.write_bytes(shaken(path.read_bytes(), np.random.default_rng(seed)))
    assert_told([tmp_path / "log.obs", tmp_path / "log.nav"], InputSettings())


@pytest.mark.parametrize("seed", SEEDS)
def test_sp3_beside_observations(tmp_path: Path, seed: int) -> None:
    write(LOG, tmp_path / "log.obs")
    assert LOG.ranges is not None
    text = sp3_text(12, int(LOG.ranges.t_ns[0])).encode()
    (tmp_path / "a.sp3").write_bytes(shaken(text, np.random.default_rng(seed)))
    assert_told([tmp_path / "log.obs", tmp_path / "log.nav", tmp_path / "a.sp3"], InputSettings())


@pytest.mark.parametrize("seed", SEEDS)
def test_ubx(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    data = bytearray(damage(SAMPLE.read_bytes(), random))
    place = int(random.integers(len(data)))
    data[place : place + 2] = b"\xff\xff"
    (tmp_path / "a.ubx").write_bytes(data)
    assert_told([tmp_path / "a.ubx"], InputSettings())


@pytest.mark.parametrize("seed", SEEDS)
def test_navigation_words_of_any_content(seed: int) -> None:
    from importers.broadcast.words import decode_words
    from importers.ublox.stream import UbxLog
    from navreplay.geodesy.time_scales import LEAP_SECONDS

    random = np.random.default_rng(seed)
    columns = UbxLog(str(SAMPLE)).read(("RXM-SFRBX",))["RXM-SFRBX"].columns
    words = columns["dwrd"] ^ np.where(
        random.random(columns["dwrd"].shape) < 0.1, random.integers(0, 2**32, columns["dwrd"].shape), 0
    )
    gnss = np.where(random.random(len(words)) < 0.2, random.integers(0, 9, len(words)), columns["gnssId"])
    number = np.where(random.random(len(words)) < 0.1, random.integers(0, 256, len(words)), columns["svId"])
    _, known = decode_words(gnss, number, number, words, 1_440_437_000 * 10**9, LEAP_SECONDS)
    assert known.shape == (len(words),)


@pytest.mark.parametrize("seed", SEEDS)
def test_tables(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    table = write_table(tmp_path / "a.csv", 1e5, "pseudorange")
    table.write_bytes(shaken(table.read_bytes(), random))
    assert_told([table], settings("pseudorange"))
    pseudorange, _ = received(0, 0.0)
    rows = [row("GPS_L1_CA", i + 1, pseudorange[i], satellites(0)[i]) for i in range(8)]
    phone = tmp_path / "phone.csv"
    phone.write_bytes(shaken("\n".join([HEAD, *rows]).encode(), random))
    options = {"csv": [{"match": "no", "role": "fix", "time": {"column": 1}, "columns": {"lat": 1}}]}
    assert_told([phone], InputSettings.model_validate(options))
