"""The recording: verified by Rerun itself and read back."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.time_scales import utc_from_gps
from pipelines.config.sections import FilterSection
from pipelines.drive.result import RunResult
from pipelines.recording.view import recording_id, write_recording
from tests.helpers.sample_drive import make_result


@pytest.fixture(scope="module")
def result() -> RunResult:
    return make_result()


@pytest.fixture(scope="module")
def recording(result: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rerun") / "recording.rrd"
    write_recording(path, result)
    return path


def read_entity(recording: Path, path: str, static: bool = False) -> pa.Table:
    """All rows of an entity."""
    chunks = [chunk for chunk in RrdReader(recording).stream() if chunk.entity_path == path and chunk.is_static == static]
    return pa.Table.from_batches([chunk.to_record_batch() for chunk in chunks]).drop_columns("rerun.controls.RowId")


def test_rerun_verifies_it(recording: Path) -> None:
    command = [str(Path(sys.executable).parent / "rerun"), "rrd", "verify", str(recording)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "verified without error" in done.stdout + done.stderr


def test_it_brings_its_layout_and_the_run_as_its_name(recording: Path, result: RunResult) -> None:
    reader = RrdReader(recording)
    assert [entry.recording_id for entry in reader.recordings()] == [recording_id(result)]
    assert len(reader.blueprints()) == 1


def test_identity_follows_inputs_and_configuration(result: RunResult) -> None:
    other = result.config.model_copy(update={"filter": FilterSection(name="iae")})
    assert recording_id(result) == recording_id(replace(result))
    assert recording_id(result) != recording_id(replace(result, config=other))


def test_errors_come_back_on_both_timelines(recording: Path, result: RunResult) -> None:
    assert result.evaluation is not None
    table = read_entity(recording, "/errors/position/north/error")
    values = np.array([row[0] for row in table["Scalars:scalars"].to_pylist()])
    assert np.array_equal(values, result.evaluation.errors["position"].error[:, 0])
    times = table["time"].to_numpy().astype("datetime64[ns]").astype(np.int64)
    assert np.array_equal(times, utc_from_gps(result.evaluation.t_ns))
    elapsed = table["elapsed"].to_numpy().astype("timedelta64[ns]").astype(np.int64)
    assert np.array_equal(elapsed, result.evaluation.t_ns - result.solution.t_ns[0])


def test_track_is_local_and_body_moves_along_it(recording: Path, result: RunResult) -> None:
    solution = result.solution
    enu = ned_between(solution.lla[0], solution.lla)[:, [1, 0, 2]] * [1, 1, -1]
    strip = np.array(read_entity(recording, "/local/solution", static=True)["LineStrips3D:strips"].to_pylist()[0][0])
    assert np.allclose(strip, enu, atol=1e-3)
    body = read_entity(recording, "/local/body")
    assert np.allclose([row[0] for row in body["Transform3D:translation"].to_pylist()], enu, atol=1e-3)


def test_rejected_innovations_are_told_apart(recording: Path, result: RunResult) -> None:
    series = result.solution.innovations[0]
    for name, rows in (("used", series.used), ("rejected", ~series.used)):
        assert len(read_entity(recording, f"/innovations/position/north/{name}")) == rows.sum() > 0


def test_events_hold_outages_and_findings(recording: Path) -> None:
    table = read_entity(recording, "/events")
    texts = [row[0] for row in table["TextLog:text"].to_pylist()]
    assert "The IMU rate varies by 12 %." in texts
    assert any(text.startswith("outage of 10.0 s (no fixes) begins, horizontal error at its end") for text in texts)
    assert {row[0] for row in table["TextLog:level"].to_pylist()} == {"INFO", "WARN"}


def test_the_verdict_is_the_first_event_and_a_property(recording: Path, result: RunResult) -> None:
    first = read_entity(recording, "/events")["TextLog:text"].to_pylist()[0][0]
    assert first.startswith(f"verdict: {result.verdict.grade}")
    document = read_entity(recording, "/verdict", static=True)["TextDocument:text"].to_pylist()[0][0]
    assert document.startswith(f"**Verdict: {result.verdict.grade}")
    assert "- positions: " in document
    table = read_entity(recording, "/__properties/run", static=True)
    assert table["verdict"].to_pylist() == [[result.verdict.grade]]


def test_run_without_reference_and_fixes_is_recorded(tmp_path: Path) -> None:
    result = make_result(with_reference=False)
    bare = replace(result, used=replace(result.used, fixes=None), timeline=replace(result.timeline, fixes=None))
    write_recording(tmp_path / "r.rrd", bare)
    sigma = read_entity(tmp_path / "r.rrd", "/sigma/position/down/sigma")
    assert len(sigma) == len(bare.solution)
