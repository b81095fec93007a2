"""One drive in a worker: read once, filtered by each method, written whole or not at all."""

import contextlib
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from navreplay.timeline import LogError
from pipelines.archive.catalogue import track_of
from pipelines.config.spec import Config
from pipelines.drive.headline import headline
from pipelines.drive.process import Drive, filter_drive, read_drive
from pipelines.outputs import write_outputs

__all__ = ["Job", "Outcome", "clear_parts", "run_job"]


@dataclass(frozen=True, slots=True)
class Job:
    """drive: name. logs: its files. configs: by method, with the reference in them. folder: where DEST/drives/NAME is."""

    drive: str
    logs: tuple[str, ...]
    configs: tuple[tuple[str, Config], ...]
    folder: str
    vehicle: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one method: the reason why it failed, empty where it did not; the row of the catalogue; seconds by stage."""

    method: str
    reason: str
    row: dict[str, Any]
    timing_s: dict[str, float]


def run_job(job: Job) -> list[Outcome]:
    """Processes a drive. What is wrong with its logs is an outcome, not an error."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    started = time.perf_counter()
    try:
        drive = read_drive(list(job.logs), job.configs[0][1])
    except (LogError, OSError, MemoryError) as error:
        return [Outcome(method, _reason(error), {}, {}) for method, _ in job.configs]
    reading = time.perf_counter() - started
    return [_run_method(job, drive, method, config, reading) for method, config in job.configs]


def _run_method(job: Job, drive: Drive, method: str, config: Config, reading: float) -> Outcome:
    try:
        started = time.perf_counter()
        result = filter_drive(replace(drive, timing_s={}), config)
        filtered = time.perf_counter()
        # seconds differ from run to run, and the tree must not
        result = replace(result, timing_s={})
        _write_whole(Path(job.folder) / method, lambda folder: write_outputs(result, folder, layer=(job.drive, method)))
        written = time.perf_counter()
    except (LogError, OSError, MemoryError) as error:
        return Outcome(method, _reason(error), {}, {})
    timing = {"reading": reading, "filtering": filtered - started, "writing": written - filtered}
    row = {"vehicle": job.vehicle, **headline(result), "track": track_of(np.degrees(result.solution.lla[:, :2]))}
    return Outcome(method, "", row, timing)


def _reason(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "the worker ran out of memory; give it more, or fewer workers"
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {error.strerror or error}"
    return " ".join(str(error).split())


def _write_whole(folder: Path, write: Callable[[Path], object]) -> None:
    """Lets write fill a folder beside, which then takes the place of folder."""
    part = folder.with_name(f".{folder.name}.part")
    old = folder.with_name(f".{folder.name}.old")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        write(part)
        if folder.exists():
            folder.rename(old)
        part.rename(folder)
    finally:
        with contextlib.suppress(OSError):
            shutil.rmtree(part, ignore_errors=True)
            shutil.rmtree(old, ignore_errors=True)


def clear_parts(folder: Path) -> None:
    """Removes what a batch that was killed left half done."""
    for name in ("*.part", "*.old"):
        for path in folder.rglob(f".{name}"):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
