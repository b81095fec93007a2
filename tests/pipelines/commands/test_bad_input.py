"""What the command line says to logs that are wrong: one line that names what, where and what to do, or a result and a note."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipelines import cli
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import simulate
from synthetic_logs.writers import write

SECOND = 1_000_000_000
GYRO = [f"gyro_{axis}_radps" for axis in "xyz"]
ACCEL = [f"accel_{axis}_mps2" for axis in "xyz"]
Change = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a drive of two minutes: car.imu.csv, car.fix.csv, car.truth.csv."""
    folder = tmp_path_factory.mktemp("drive")
    write(simulate(SCENARIOS["car-short"], 1), folder / "car.csv")
    return folder


def changed(drive: Path, folder: Path, kind: str, change: Change) -> list[str]:
    """The logs and the reference as arguments, the table of one kind changed."""
    for path in drive.glob("car.*"):
        shutil.copy(path, folder)
    path = folder / f"car.{kind}.csv"
    change(pd.read_csv(path)).to_csv(path, index=False)
    return [str(folder / "car.imu.csv"), str(folder / "car.fix.csv"), "--reference", str(folder / "car.truth.csv")]


def run(folder: Path, arguments: list[str]) -> int:
    return cli.main(["run", *arguments, "-o", str(folder / "out"), "--set", "output.recording=false"])


def error_of(capsys: pytest.CaptureFixture[str], folder: Path, arguments: list[str]) -> str:
    assert run(folder, arguments) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("navreplay: error: ")
    assert printed.err.count("\n") == 1
    assert not (folder / "out").exists()
    return printed.err


def scaled(columns: list[str], *factors: float) -> Change:
    return lambda table: table.assign(**{name: table[name] * f for name, f in zip(columns, factors, strict=True)})


def moved(seconds: float) -> Change:
    return lambda table: table.assign(t_gps_ns=table["t_gps_ns"] + round(seconds * SECOND))


def on_its_side(table: pd.DataFrame) -> pd.DataFrame:
    turned = {new: table[old] for names in (GYRO, ACCEL) for new, old in zip(names, names[::-1], strict=True)}
    return table.assign(**turned)


def upside_down(table: pd.DataFrame) -> pd.DataFrame:
    return scaled(GYRO + ACCEL, 1, -1, -1, 1, -1, -1)(table)


@pytest.mark.parametrize(
    ("kind", "change", "expected"),
    [
        ("imu", scaled(ACCEL, *[1 / 9.80665] * 3), "seem to be in g. Set input.imu.accel_unit = 'g'"),
        ("imu", scaled(GYRO, *[57.29577951] * 3), "seems to be in deg/s. Set input.imu.gyro_unit = 'deg/s'"),
        ("imu", upside_down, "forward-left-up and were taken for forward-right-down. Set input.imu.axes = 'flu'"),
        ("imu", on_its_side, "Gravity lies on a horizontal axis"),
        ("imu", lambda table: table.iloc[:0], "car.imu.csv: the file holds a header but no rows"),
        ("imu", lambda table: table.assign(accel_x_mps2=np.nan), "car.imu.csv: none of its 12001 samples is usable"),
        ("imu", moved(-1_393_000_000), "car.imu.csv: 12001 of 12001 stamps lie before 1990"),
        ("fix", moved(3600), "IMU and GNSS do not overlap in time; they begin 3600 s apart"),
        ("fix", moved(18), "in another of UTC and GPS time. Set input.imu.time_base or input.fix.time_base"),
        ("truth", moved(86400), "The reference does not overlap the log in time"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, change: Change, expected: str
) -> None:
    assert expected in error_of(capsys, tmp_path, changed(drive, tmp_path, kind, change))


def every_fiftieth(value: float) -> Change:
    return lambda table: table.assign(accel_z_mps2=table["accel_z_mps2"].where(table.index % 50 != 7, value))


def swapped_in_pairs(table: pd.DataFrame) -> pd.DataFrame:
    order = np.arange(len(table))
    order[: len(order) // 2 * 2] ^= 1
    return table.iloc[order]


def without(start_s: float, end_s: float) -> Change:
    def cut(table: pd.DataFrame) -> pd.DataFrame:
        """The table without the rows between the two times."""
        t_s = (table["t_gps_ns"] - table["t_gps_ns"].iloc[0]) / SECOND
        return table[(t_s <= start_s) | (t_s >= end_s)]

    return cut


@pytest.mark.parametrize(
    ("kind", "change", "expected"),
    [
        ("imu", every_fiftieth(np.nan), "rejected: car.imu.csv: 240 of 12001 messages (not finite)"),
        ("imu", every_fiftieth(np.inf), "rejected: car.imu.csv: 240 of 12001 messages (not finite)"),
        ("imu", lambda table: table.iloc[np.repeat(np.arange(len(table)), 2)], "12001 of 24002 messages (time not increasing)"),
        ("imu", swapped_in_pairs, "6000 stamps were out of order by at most 0.01 s; the samples were sorted"),
        ("imu", without(60, 60.3), "gaps of the IMU that are bridged: 1, 0.300 s in all"),
        ("imu", without(40, 80), "The IMU has 1 gap of more than 0.03 s, the longest 40 s"),
        ("fix", lambda table: table.assign(std_n_m=0.0), "120 of 120 fixes do not tell their accuracy"),
    ],
)
def test_what_can_be_mended_is_told(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, change: Change, expected: str
) -> None:
    assert run(tmp_path, changed(drive, tmp_path, kind, change)) == 0
    assert expected in capsys.readouterr().out + (tmp_path / "out" / "report.json").read_text()


def test_gaps_are_refused_where_so_configured(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = changed(drive, tmp_path, "imu", without(60, 65))
    message = error_of(capsys, tmp_path, [*arguments, "--set", "gaps.longer=refuse"])
    assert "a gap of 5.000 s is longer than gaps.bridge_s = 0.5" in message


def test_a_series_that_is_missing_is_named(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "There is no IMU in the log" in error_of(capsys, tmp_path, [str(drive / "car.fix.csv")])
    assert "There are no GNSS fixes in the log" in error_of(capsys, tmp_path, [str(drive / "car.imu.csv")])


def test_a_log_damaged_in_every_chunk_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, _ = write(simulate(SCENARIOS["car-short"], 1), tmp_path / "car.mcap")
    data = bytearray(path.read_bytes())
    for place in range(200, len(data) - 40_000, 20_000):
        data[place] ^= 0x10
    path.write_bytes(data)
    assert "holds no readable message of " in error_of(capsys, tmp_path, [str(path)])
