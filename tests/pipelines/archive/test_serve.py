"""The archive in Rerun, asked by the catalogue's own client."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pipelines import cli
from pipelines.archive.catalogue import read_catalogue
from synthetic_logs import SCENARIOS, simulate, with_duration, write

pytest.importorskip("datafusion")
METHODS = ("checked", "huber")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives by two methods, each with an outage of 12 s and one of 6 s."""
    folder = tmp_path_factory.mktemp("served")
    for seed in (1, 2):
        write(simulate(with_duration(SCENARIOS["car-short"], 60.0), seed), folder / "in" / f"day{seed}" / "drive.bag")
    begin = 210782
    windows = [[begin + 20, begin + 32], [begin + 40, begin + 46]]
    sets = ["--filters", ",".join(METHODS), "--set", f"outages.windows_gps_tow={windows}"]
    assert cli.main(["batch", str(folder / "in"), "-o", str(folder / "out"), "--quiet", "--workers", "1", *sets]) == 0
    return folder / "out"


@pytest.fixture(scope="module")
def dataset(archive: Path) -> Iterator[Any]:
    from pipelines.archive.serve import NAME, open_server

    server = open_server(archive)
    assert server.host() == "127.0.0.1"
    yield server.client().get_dataset(NAME)
    server.shutdown()


def test_a_drive_is_a_segment_and_a_method_a_layer_of_it(dataset: Any) -> None:
    table = dataset.segment_table().to_pandas()
    assert sorted(table["rerun_segment_id"]) == ["day1/drive", "day2/drive"]
    assert all(sorted(layers) == list(METHODS) for layers in table["rerun_layer_names"])


def test_headline_figures_are_properties(dataset: Any, archive: Path) -> None:
    table = dataset.segment_table().to_pandas().set_index("rerun_segment_id")
    for row in read_catalogue(archive).itertuples():
        for figure in ("horizontal_rms_m", "position_nees", "outages", "verdict", "attention"):
            assert table.loc[row.drive, f"property:{row.method}:{figure}"][0] == getattr(row, figure)


def test_the_table_of_segments_has_its_layout(dataset: Any) -> None:
    assert dataset.default_segment_table_blueprint() in dataset.blueprints()


def test_a_query_over_all_drives_finds_the_nees_at_the_end_of_long_outages(dataset: Any) -> None:
    from datafusion import col, lit

    rows = dataset.filter_contents(["/checked/outages"]).reader(index="time")
    length, nees = col('"/checked/outages:length_s"')[0], col('"/checked/outages:end_nees"')[0]
    found = rows.filter(length > lit(10.0)).select("rerun_segment_id", length.alias("length_s"), nees.alias("nees")).to_pandas()
    assert sorted(found["rerun_segment_id"]) == ["day1/drive", "day2/drive"]
    assert found["length_s"].between(12.0, 13.1).all()  # an outage begins at the last fix that was used
    assert (found["nees"] > 0).all()


def test_methods_do_not_mix_in_a_segment(dataset: Any) -> None:
    tracks = {column.entity_path for column in dataset.schema().component_columns() if column.entity_path.endswith("/solution")}
    assert tracks == {f"/{method}/{view}/solution" for method in METHODS for view in ("local", "map")}


def test_recordings_made_again_are_equal(archive: Path) -> None:
    again = archive.parent / "again"
    command = ["batch", str(archive.parent / "in"), "-o", str(again), "--quiet", "--workers", "1", "--match", "*drive.bag"]
    config = archive / "drives/day1/drive/checked/config.toml"
    assert cli.main([*command, "-c", str(config)]) == 0
    recordings = [str(folder / "drives/day1/drive/checked/recording.rrd") for folder in (archive, again)]
    rerun = str(Path(sys.executable).parent / "rerun")
    compare = subprocess.run([rerun, "rrd", "compare", "--unordered", *recordings], capture_output=True, text=True, check=False)
    assert compare.returncode == 0, compare.stderr
    other = str(archive / "drives/day2/drive/checked/recording.rrd")
    assert subprocess.run(
        [rerun, "rrd", "compare", "--unordered", recordings[0], other], capture_output=True, check=False
    ).returncode


def test_what_cannot_be_served_is_one_line(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["catalog", str(archive), "--serve", "--host", "203.0.113.1"]) == 1
    line = capsys.readouterr().err
    assert "cannot be served there" in line
    assert line.count("\n") == 1
