"""What a notebook asks for: configurations from keywords, results with tables, finished runs, the recording shown."""

import json
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from navreplay.filters.presets import build_method
from navreplay.timeline import LogError
from pipelines.config.spec import Config, validate
from pipelines.drive import process
from pipelines.drive.headline import FIGURES, headline
from pipelines.drive.process import Drive
from pipelines.drive.result import RunResult
from pipelines.frames import Frame, TabularSolution, error_frame, innovation_frame
from pipelines.trajectory.solution_csv import find_solution, read_columns

if TYPE_CHECKING:
    import pandas

__all__ = ["FinishedRun", "Result", "choose_filter", "compare", "configure", "filter_drive", "open_run"]


def configure(**sections: dict[str, Any]) -> Config:
    """A configuration from sections as keywords, such as `configure(imu={"grade": "tactical"})`. Raises LogError as a file
    would."""
    return validate(sections, "configure()")


def choose_filter(config: Config, name: str, **parameters: object) -> Config:
    """The configuration with another method, such as `choose_filter(config, "student-t", freedom=4.0)`. Raises LogError for one
    that does not exist."""
    build_method(name, parameters)
    return config.model_copy(update={"filter": config.filter.model_copy(update={"name": name, "parameters": parameters})})


@dataclass(frozen=True, eq=False)
class Result(RunResult):
    """A filtered drive, with its tables: `solution.to_pandas()`, `errors.to_pandas()`,
    `innovations("position").to_pandas()`."""

    solution: TabularSolution

    @property
    def errors(self) -> Frame:
        """Errors against the reference, a column per component. Raises LogError without a reference."""
        return error_frame(self.evaluation)

    def innovations(self, kind: str) -> Frame:
        """Innovations of a kind of measurement, such as ``position``. Raises LogError, with those there are, for another."""
        for series in self.solution.innovations:
            if series.kind == kind:
                return innovation_frame(series)
        known = ", ".join(series.kind for series in self.solution.innovations) or "none"
        raise LogError(f"the run has no innovations of '{kind}'; it has: {known}")

    def show(self) -> None:
        """The recording in a notebook's cell, or else in a viewer that is started for it."""
        _show(self)


def filter_drive(drive: Drive, config: Config) -> Result:
    """The drive through the configured filter, evaluated against the reference if there is one. Raises LogError."""
    result = process.filter_drive(drive, config)
    parts = {field.name: getattr(result, field.name) for field in fields(RunResult)}
    return Result(**{**parts, "solution": TabularSolution.of(result.solution)})


def compare(drive: Drive, config: Config, *names: str) -> "pandas.DataFrame":
    """The headline figures of several methods on one drive, a row each under its name; a method that cannot run has its
    ``reason`` in place of figures. Raises LogError for one that does not exist."""
    import pandas

    configs = [choose_filter(config, name) if name != config.filter.name else config for name in names]
    rows = {name: _headline(drive, one) for name, one in zip(names, configs, strict=True)}
    columns = [name for name in FIGURES if any(row.get(name) is not None for row in rows.values())]
    return pandas.DataFrame.from_dict(rows, orient="index", columns=[*columns, "reason"])


def _headline(drive: Drive, config: Config) -> dict[str, Any]:
    try:
        return {**headline(process.filter_drive(drive, config)), "reason": ""}
    except LogError as error:
        return {"reason": str(error)}


@dataclass(frozen=True, eq=False, slots=True)
class FinishedRun:
    """A run read back from its folder. solution: its rows. report: report.json as written."""

    folder: Path
    solution: Frame
    report: dict[str, Any]


def open_run(folder: str | Path) -> FinishedRun:
    """What `write_outputs` or `navreplay run` left in a folder. Raises LogError where it is none of these."""
    folder = Path(folder)
    t_ns, columns = read_columns(find_solution(folder))
    try:
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogError(
            f"{folder}: report.json cannot be read; is this folder what `navreplay run -o` wrote? ({error})"
        ) from error
    return FinishedRun(folder, Frame(t_ns, columns), report)


def _show(result: RunResult) -> None:
    import rerun as rr

    from pipelines.recording.view import write_recording

    with TemporaryDirectory() as folder:
        path = Path(folder) / "recording.rrd"
        write_recording(path, result)
        stream = rr.RecordingStream("navreplay")
        if _in_notebook():
            stream.log_file_from_path(path)
            stream.notebook_show()
        else:
            stream.spawn()
            stream.log_file_from_path(path)
            stream.flush()


def _in_notebook() -> bool:
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and hasattr(shell, "kernel")
