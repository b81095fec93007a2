"""A batch: what there is to do of an archive, done by an executor, recorded as it ends."""

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from navreplay.timeline import LogError
from pipelines.archive.catalogue import write_catalogue
from pipelines.archive.executors import Executor
from pipelines.archive.index_page import write_index
from pipelines.archive.job import Job, clear_parts, run_job
from pipelines.archive.manifest import (
    Entry,
    append_entry,
    code_version,
    config_hash,
    file_stamps,
    input_hash,
    read_manifest,
    write_manifest,
)
from pipelines.archive.rules import Assigned
from pipelines.config.spec import Config

__all__ = ["Plan", "Planned", "Summary", "plan_batch", "run_batch"]

_BASE_BYTES = 400e6
_BYTES_PER_BYTE = 9.0
"""Memory of a worker: what it needs by itself, and per byte of a compressed log (measured: 0.86 GB for an hour at 200 Hz)."""

Tell = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Planned:
    """A drive to process by these methods. why: it is processed; entries: what the manifest will say but for the outcome."""

    assigned: Assigned
    entries: tuple[Entry, ...]
    why: str

    @property
    def memory(self) -> float:
        """What a worker may need [bytes]."""
        return _BASE_BYTES + _BYTES_PER_BYTE * sum(size for _, size, _, _ in self.entries[0].files)


@dataclass(frozen=True, slots=True)
class Plan:
    """todo: in the order of names. kept: entries that stand, with why. problems: drives that cannot be read, with the
    reason."""

    todo: tuple[Planned, ...]
    kept: tuple[tuple[Entry, str], ...]
    problems: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """done, failed: jobs by outcome; skipped: entries that stood. reasons: of failures, by kind with their count."""

    done: int
    failed: int
    skipped: int
    reasons: dict[str, int]


def plan_batch(drives: Sequence[Assigned], methods: Sequence[str], folder: Path, resume: bool, retry_failed: bool) -> Plan:
    """What is to be done. Raises LogError where the destination holds another batch and resume was not asked for."""
    before = read_manifest(folder)
    if before and not resume and not retry_failed:
        raise LogError(f"{folder}: holds a batch already; go on with it by --resume, or choose another -o")
    known = {stamp[0]: stamp for entry in before.values() for stamp in entry.files}
    seen: dict[str, str] = {}
    todo, kept, problems = [], [], []
    for assigned in drives:
        try:
            stamps = file_stamps(assigned, known)
        except LogError as error:
            problems.append((assigned.drive.name, str(error)))
            continue
        inputs = input_hash(stamps)
        logs = {str(path) for path in assigned.drive.logs}
        content = " ".join(sorted(digest for path, _, _, digest in stamps if path in logs))
        if content and content in seen:
            problems.append((assigned.drive.name, f"holds the same as {seen[content]}; it is left out"))
            continue
        seen[content] = assigned.drive.name
        wanted, reasons = [], []
        for method in methods or (assigned.config.filter.name,):
            made = config_hash(assigned, method)
            entry = Entry(assigned.drive.name, method, inputs, made, code_version(), stamps, "planned")
            why = _why(before.get(entry.key), entry, folder, retry_failed)
            if why:
                wanted.append(entry)
                reasons.append(why)
            else:
                kept.append((before[entry.key], "as it was"))
        if wanted:
            todo.append(Planned(assigned, tuple(wanted), "; ".join(dict.fromkeys(reasons))))
    return Plan(tuple(todo), tuple(kept), tuple(problems))


def _why(old: Entry | None, new: Entry, folder: Path, retry_failed: bool) -> str:
    """Why a job is to be done, empty where what there is stands."""
    if old is None:
        return "new"
    changed = [name for name in ("inputs", "config", "code") if getattr(old, name) != getattr(new, name)]
    if changed:
        words = {"inputs": "its files changed", "config": "its configuration changed", "code": "the program changed"}
        return ", ".join(words[name] for name in changed)
    if old.status == "failed":
        return "failed before" if retry_failed else ""
    return "" if (folder / "drives" / new.drive / new.method / "report.json").exists() else "its output is gone"


def run_batch(plan: Plan, folder: Path, executor: Executor, budget: float, tell: Tell) -> Summary:
    """Does what is planned, records each outcome as it comes, and writes manifest, catalogue and index when all are in."""
    (folder / "drives").mkdir(parents=True, exist_ok=True)
    clear_parts(folder / "drives")
    log = _Log(folder / "log")
    entries = {entry.key: entry for entry, _ in plan.kept}
    jobs = [_job(planned, folder) for planned in plan.todo]
    by_name = {planned.assigned.drive.name: planned for planned in plan.todo}
    done = failed = 0
    reasons: dict[str, int] = {}
    log.write({"event": "begin", "jobs": len(jobs), "kept": len(plan.kept)})
    for drive, reason in plan.problems:
        tell({"event": "left out", "drive": drive, "reason": reason})
        log.write({"event": "left out", "drive": drive, "reason": reason})
    for number, (job, outcomes, lost) in enumerate(
        executor.run(run_job, jobs, [planned.memory for planned in plan.todo], budget), start=1
    ):
        for entry in by_name[job.drive].entries:
            outcome = None if outcomes is None else next(one for one in outcomes if one.method == entry.method)
            reason = lost if outcome is None else outcome.reason
            ended = Entry(
                *(entry.drive, entry.method, entry.inputs, entry.config, entry.code, entry.files),
                *("failed" if reason else "done", reason, {} if outcome is None else outcome.row),
            )
            entries[ended.key] = ended
            append_entry(folder, ended)
            done, failed = done + (not reason), failed + bool(reason)
            if reason:
                kind = _kind(reason)
                reasons[kind] = reasons.get(kind, 0) + 1
            told = {"event": ended.status, "drive": ended.drive, "method": ended.method, "reason": reason}
            tell({**told, "number": number, "of": len(jobs)})
            log.write({**told, "timing_s": {} if outcome is None else outcome.timing_s})
    write_manifest(folder, entries.values())
    write_catalogue(folder, entries.values())
    write_index(folder, entries.values())
    log.write({"event": "end", "done": done, "failed": failed})
    return Summary(done, failed, len(plan.kept), reasons)


def _job(planned: Planned, folder: Path) -> Job:
    assigned = planned.assigned
    config = assigned.config
    if assigned.drive.reference is not None and config.input.reference.file is None:
        reference = config.input.reference.model_copy(update={"file": assigned.drive.reference.resolve()})
        config = config.model_copy(update={"input": config.input.model_copy(update={"reference": reference})})
    configs = tuple((entry.method, _by_method(config, entry.method)) for entry in planned.entries)
    place = folder / "drives" / assigned.drive.name
    logs = tuple(str(path) for path in assigned.drive.logs)
    return Job(assigned.drive.name, logs, configs, str(place), assigned.vehicle)


def _by_method(config: Config, method: str) -> Config:
    if config.filter.name == method:
        return config
    return config.model_copy(update={"filter": config.filter.model_copy(update={"name": method, "parameters": {}})})


def _kind(reason: str) -> str:
    """What failures of one kind have in common: the sentence without files and figures."""
    words = [word for word in reason.split() if not any(letter.isdigit() or letter == "/" for letter in word)]
    return " ".join(words[:10])


class _Log:
    """Lines of JSON with the time of day, a file per batch; not part of what is compared."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
        self._path = folder / f"{stamp}-{os.getpid()}.jsonl"
        self._begin = time.perf_counter()

    def write(self, values: dict[str, Any]) -> None:
        """Adds a line."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"after_s": round(time.perf_counter() - self._begin, 3), **values}) + "\n")
