"""What a run by ranges shows of its satellites: directions, use, dilution; in the report and in the recording."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from navreplay.evaluation.sky import view_sky
from navreplay.measurements.least_squares import solve_points
from navreplay.options import RangeOptions
from navreplay.timeline import RangeSeries, Timeline
from pipelines.config.spec import validate
from pipelines.drive.process import Drive, filter_drive
from pipelines.drive.result import RunResult
from pipelines.outputs import write_outputs
from pipelines.plotting.sky import epoch_shares
from tests.helpers.range_samples import SKY, make_ranges

EPOCHS = 30
FAULTY, FAULTY_EPOCH = "G12", 20


def faulty_ranges() -> RangeSeries:
    """Exact but for one pseudorange; a satellite goes down after ten epochs."""
    ranges = make_ranges(EPOCHS, noise=(0.3, 0.02), told=(0.5, 0.03))
    epoch = (ranges.t_ns - ranges.t_ns[0]) // 1_000_000_000
    bent = np.where((epoch == FAULTY_EPOCH) & (ranges.sat == FAULTY), 60.0, 0.0)
    kept = (ranges.sat != "E19") | (epoch < 10)
    columns = {name: getattr(ranges, name)[kept] for name in RangeSeries.__dataclass_fields__ if name in COLUMNS}
    return replace(ranges, **columns | {"pseudorange": (ranges.pseudorange + bent)[kept]})


COLUMNS = {"t_ns", "sat", "signal", "range_rate", "pseudorange_std", "range_rate_std", "cn0", "sat_pos_e", "sat_vel_e"}


@pytest.fixture(scope="module")
def result() -> RunResult:
    config = validate({"motion": {"horizontal": 0.1, "vertical": 0.1}, "range": {"elevation_mask_deg": 22.0}}, "test")
    return filter_drive(Drive(Timeline(ranges=faulty_ranges()), ()), config)


@pytest.fixture(scope="module")
def folder(result: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sky")
    write_outputs(result, path)
    return path


def test_directions_are_those_of_the_satellites(result: RunResult) -> None:
    assert result.sky is not None
    for name, (elevation_deg, azimuth_deg) in SKY.items():
        rows = result.sky.sat == name
        assert np.degrees(result.sky.elevation[rows][0]) == pytest.approx(elevation_deg, abs=0.05)
        turn = np.degrees(result.sky.azimuth[rows][0]) - azimuth_deg
        assert (turn + 180) % 360 - 180 == pytest.approx(0, abs=0.2)


def test_masked_and_rejected_ranges_are_told_apart(result: RunResult) -> None:
    sky = result.sky
    assert sky is not None
    assert not sky.judged[sky.sat == "G23"].any()
    refused = sky.judged & ~sky.used
    epoch = (sky.t_ns - result.timeline.ranges.t_ns[0]) // 1_000_000_000
    assert (sky.sat[refused].tolist(), epoch[refused].tolist()) == ([FAULTY], [FAULTY_EPOCH])
    assert sky.used_count[0] == len(SKY) - 1
    assert sky.used_count[-1] == len(SKY) - 2


def test_dilution_is_that_of_least_squares(result: RunResult) -> None:
    points, _, _ = solve_points(result.timeline.ranges, RangeOptions(elevation_mask=np.radians(22.0)))
    epochs = np.searchsorted(points.t_ns, result.sky.epoch_ns)
    same = points.used[epochs] == result.sky.used_count
    assert same.sum() > EPOCHS - 5
    np.testing.assert_allclose(result.sky.dop[same], points.dop[epochs][same], rtol=1e-3)


def test_too_few_satellites_have_no_dilution() -> None:
    three = ("G01", "G05", "G12")
    whole = make_ranges(20, noise=(0.1, 0.01))
    epoch = (whole.t_ns - whole.t_ns[0]) // 1_000_000_000
    kept = np.isin(whole.sat, three) | (epoch < 10)
    ranges = replace(whole, pseudorange=whole.pseudorange[kept], **{name: getattr(whole, name)[kept] for name in COLUMNS})
    run = filter_drive(Drive(Timeline(ranges=ranges), ()), validate({}, "test"))
    assert run.sky is not None
    assert np.isnan(run.sky.dop[run.sky.used_count == 3]).all()
    assert np.isfinite(run.sky.dop[run.sky.used_count > 6]).all()


def test_a_run_without_ranges_has_no_sky(result: RunResult) -> None:
    assert view_sky(result.timeline.ranges, replace(result.solution, innovations=())) is None


def test_shares_of_an_epoch_are_its_own() -> None:
    t_ns = np.array([1, 1, 1, 2, 2, 2, 2, 3])
    times, shares = epoch_shares(t_ns, np.array([3.0, 1.0, 2.0, 40.0, 10.0, 30.0, 20.0, 7.0]), (0.0, 0.5, 1.0))
    assert times.tolist() == [1, 2, 3]
    assert shares.tolist() == [[1, 2, 3], [10, 30, 40], [7, 7, 7]]


def test_report_shows_and_counts_the_satellites(folder: Path) -> None:
    satellites = json.loads((folder / "report.json").read_text())["satellites"]
    assert set(satellites["list"]) == set(SKY)
    faulty = satellites["list"][FAULTY]
    assert (faulty["received"], faulty["judged"], faulty["used"]) == (EPOCHS - 1, EPOCHS - 1, EPOCHS - 2)
    assert faulty["range"]["residual"]["rms"] < 2
    assert satellites["list"]["G23"]["range"]["residual"]["count"] == 0
    assert satellites["used"]["most"] == len(SKY) - 1
    page = (folder / "report.html").read_text()
    for title in ("Sky", "Satellites and dilution of precision", "Innovations by satellite: range", "Noise: range_rate"):
        assert f"<h2>{title}</h2>" in page
    assert "nan" not in page.partition("<script>")[0]
    assert "## Satellites" in (folder / "report.md").read_text()


def test_recording_holds_the_sky_and_its_paths_need_no_escapes(folder: Path) -> None:
    chunks = list(RrdReader(folder / "recording.rrd").stream())
    paths = {chunk.entity_path for chunk in chunks}
    assert {f"/sky/satellites/{name}" for name in SKY} < paths
    assert {"/satellites/number/used", "/satellites/dilution/position", "/noise/range/used", "/innovations/range/G01"} < paths
    assert not any(character in path for path in paths for character in " \\")
    gone = [chunk for chunk in chunks if chunk.entity_path == "/sky/satellites/E19" and not chunk.is_static]
    places = [place for chunk in gone for place in chunk.to_record_batch().to_pydict()["Points2D:positions"]]
    assert len(places) == 10  # nine epochs behind the start, and the one at which it is gone
    assert places[-1] == []
