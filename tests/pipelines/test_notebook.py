"""The door for notebooks: what is not on its page."""

from dataclasses import fields

import pytest
import rerun as rr

from navreplay.timeline import LogError
from pipelines.config.spec import Config
from pipelines.drive.process import read_drive
from pipelines.drive.result import RunResult
from pipelines.frames import TabularSolution
from pipelines.notebook import Result, choose_filter, compare, configure, filter_drive, open_run
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.sample_drive import make_result


def result(with_reference: bool = True) -> Result:
    made = make_result(with_reference=with_reference)
    parts = {field.name: getattr(made, field.name) for field in fields(RunResult)}
    return Result(**{**parts, "solution": TabularSolution.of(made.solution)})


def test_a_recording_is_shown_in_a_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    monkeypatch.setattr(rr.RecordingStream, "spawn", lambda self, **_: calls.append("spawn"))
    monkeypatch.setattr(
        rr.RecordingStream, "log_file_from_path", lambda self, path, **_: calls.append(path.stat().st_size > 1000)
    )
    result().show()
    assert calls == ["spawn", True]


def test_what_is_not_there_is_one_line(tmp_path) -> None:
    with pytest.raises(LogError, match="the run had no reference"):
        result(with_reference=False).errors.to_pandas()
    with pytest.raises(LogError, match="no innovations of 'magic'; it has: "):
        result().innovations("magic")
    with pytest.raises(LogError, match="cannot read the solution"):
        open_run(tmp_path)
    with pytest.raises(LogError, match="did you mean 'huber'"):
        choose_filter(Config(), "hubr")


def test_methods_are_compared_in_one_table(tmp_path) -> None:
    log = simulate(with_duration(SCENARIOS["car-short"], 30.0), 1)
    write(log, tmp_path / "drive.bag")
    config = configure(input={"reference": {"file": str(tmp_path / "drive.truth.csv")}})
    drive = read_drive([tmp_path / "drive.bag"], config)
    table = compare(drive, config, "fixed", "huber", "mmae")
    assert list(table.index) == ["fixed", "huber", "mmae"]
    fixed = filter_drive(drive, choose_filter(config, "fixed"))
    assert table.loc["fixed", "horizontal_rms_m"] == fixed.evaluation.statistics["all"]["position"]["horizontal"].rms
    assert (table["reason"] == "").all()
    with pytest.raises(LogError, match="did you mean 'huber'"):
        compare(drive, config, "hubr")
