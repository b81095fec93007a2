"""One drive in a worker: read once, filtered by each method, written whole or not at all."""

import errno
import os
import shutil
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from navreplay.timeline import LogError
from pipelines.archive.catalogue import track_of
from pipelines.config.spec import Config
from pipelines.drive.headline import headline
from pipelines.drive.process import Drive, filter_drive, read_drive
from pipelines.files.remote import is_address, status_of, store_folder
from pipelines.outputs import write_outputs

__all__ = ["DestinationFullError", "Job", "Outcome", "run_job"]

_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})


class DestinationFullError(LogError):
    """Nothing more can be written, whatever the drive."""


@dataclass(frozen=True, slots=True)
class Job:
    """drive: name. logs: its files. configs: by method, with the reference in them. folder: where DEST/drives/NAME is. stamps:
    path, size, time of change and digest of its files, as they were when it was planned."""

    drive: str
    logs: tuple[str, ...]
    configs: tuple[tuple[str, Config], ...]
    folder: str
    vehicle: str = ""
    stamps: tuple[tuple[str, int, int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one method: the reason why it failed, empty where it did not; the row of the catalogue; seconds by stage; trace:
    where the program itself is at fault."""

    method: str
    reason: str
    row: dict[str, Any]
    timing_s: dict[str, float]
    trace: str = ""


def run_job(job: Job) -> list[Outcome]:
    """Processes a drive. What is wrong with its logs is an outcome, not an error. Raises DestinationFullError."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    started = time.perf_counter()
    try:
        drive = read_drive(list(job.logs), job.configs[0][1])
        _check_unchanged(job)
    except Exception as error:  # one drive must not end the batch, whatever is wrong with it or with us
        return [_failure(method, error) for method, _ in job.configs]
    reading = time.perf_counter() - started
    return [_run_method(job, drive, method, config, reading) for method, config in job.configs]


def _run_method(job: Job, drive: Drive, method: str, config: Config, reading: float) -> Outcome:
    try:
        started = time.perf_counter()
        result = filter_drive(replace(drive, timing_s={}), config)
        filtered = time.perf_counter()
        # seconds differ from run to run, and the tree must not
        result = replace(result, timing_s={})
        try:
            _write_whole(Path(job.folder) / method, lambda folder: write_outputs(result, folder, layer=(job.drive, method)))
        except (LogError, OSError) as error:
            _stop_where_full(job, error)
            raise
        written = time.perf_counter()
    except DestinationFullError:
        raise
    except Exception as error:  # as above
        return _failure(method, error)
    timing = {"reading": reading, "filtering": filtered - started, "writing": written - filtered}
    row = {"vehicle": job.vehicle, **headline(result), "track": track_of(np.degrees(result.solution.lla[:, :2]))}
    return Outcome(method, "", row, timing)


def _failure(method: str, error: Exception) -> Outcome:
    if isinstance(error, MemoryError):
        return Outcome(method, "the worker ran out of memory; give it more, or fewer workers", {}, {})
    if isinstance(error, OSError):
        return Outcome(method, f"{error.filename or 'a file'}: {error.strerror or error}", {}, {})
    if isinstance(error, LogError):
        return Outcome(method, " ".join(str(error).split()), {}, {})
    trace = traceback.format_exc()
    reason = f"the program is at fault ({type(error).__name__}); its traceback is in the batch's log, please report it"
    return Outcome(method, reason, {}, {}, trace)


def _write_whole(folder: Path, write: Callable[[Path], object]) -> None:
    """Lets write fill a folder beside, which then takes the place of folder; at an address, see `store_folder`."""
    if is_address(folder):
        with TemporaryDirectory(prefix="navreplay-") as scratch:
            write(Path(scratch))
            store_folder(Path(scratch), folder)
        return
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
        shutil.rmtree(part, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _stop_where_full(job: Job, error: BaseException) -> None:
    """Raises DestinationFullError where no drive could be written, which ends the batch and leaves the drive to be done."""
    cause = error if isinstance(error, OSError) else error.__cause__
    if isinstance(cause, OSError) and cause.errno in _FULL:
        raise DestinationFullError(
            f"{job.folder}: cannot be written: {cause.strerror}; make room, and go on with --resume"
        ) from error


def _check_unchanged(job: Job) -> None:
    """Raises LogError where a file is not what it was when the batch was planned."""
    for path, size, mtime_ns, _ in job.stamps:
        if status_of(Path(path)) != (size, mtime_ns):
            raise LogError(f"{path}: changed while the batch ran; when it is complete, run the batch again with --resume")
