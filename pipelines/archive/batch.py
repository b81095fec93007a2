"""A batch: what there is to do of an archive, done by an executor, recorded as it ends."""

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from navreplay.timeline import LogError
from pipelines.archive.destination import Destination
from pipelines.archive.executors import Executor
from pipelines.archive.job import Job, Outcome, run_job
from pipelines.archive.manifest import Entry, OpenManifest, code_version, config_hash, input_hash
from pipelines.archive.sources.rules import Assigned
from pipelines.archive.sources.seen import SeenFiles
from pipelines.config.spec import Config
from pipelines.files.remote import is_address

__all__ = ["Plan", "Planned", "Summary", "plan_batch", "run_batch"]

_BASE_BYTES = 400e6
_BYTES_PER_BYTE = 6.0
"""Memory of a worker: what it needs by itself, and per byte of a compressed log (measured: 2.5 GB for ten hours at 200 Hz, 0.53
GB of MCAP)."""

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
        return _BASE_BYTES + _BYTES_PER_BYTE * self.bytes

    @property
    def bytes(self) -> int:
        """Of all its files."""
        return sum(size for _, size, _, _ in self.entries[0].files)


@dataclass(frozen=True, slots=True)
class Plan:
    """todo: in the order of names. kept: entries that stand. broken: entries that fail before they begin, with the reason.
    problems: drives that are left out, with the reason."""

    todo: tuple[Planned, ...]
    kept: tuple[Entry, ...]
    broken: tuple[Entry, ...]
    problems: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """done, failed: jobs by outcome; skipped: entries that stood. reasons: of failures, by kind with their count."""

    done: int
    failed: int
    skipped: int
    reasons: dict[str, int]


def plan_batch(
    drives: Sequence[Assigned],
    methods: Sequence[str],
    destination: Destination,
    seen: SeenFiles,
    resume: bool,
    retry_failed: bool,
) -> Plan:
    """What is to be done. Raises LogError where the destination holds another batch and resume was not asked for."""
    before = destination.before
    if before and not resume and not retry_failed:
        raise LogError(f"{destination.out}: holds a batch already; go on with it by --resume, or choose another -o")
    holders: dict[str, str] = {}
    hashed: dict[tuple[int, str, str], str] = {}
    todo, kept, broken, problems = [], [], [], []
    for assigned in drives:
        name, stamps = assigned.drive.name, seen.stamps(assigned.drive.files)
        content = " ".join(sorted(digest for _, _, _, digest in seen.stamps(assigned.drive.logs)))
        holder = holders.setdefault(content, name) if content.strip() else name
        if holder != name:
            problems.append((name, f"holds the same as {holder}; it is left out"))
            continue
        problem = seen.problem(assigned.drive.files)
        wanted, reasons = [], []
        for method in methods or (assigned.config.filter.name,):
            key = (id(assigned.config), assigned.vehicle, method)
            made = hashed[key] = hashed.get(key) or config_hash(assigned, method)
            entry = Entry(name, method, input_hash(stamps), made, code_version(), stamps, "planned")
            why = _why(before.get(entry.key), entry, destination, retry_failed)
            if problem:
                broken.append(replace(entry, status="failed", reason=problem))
            elif why:
                wanted.append(entry)
                reasons.append(why)
            else:
                kept.append(before[entry.key])
        if wanted:
            todo.append(Planned(assigned, tuple(wanted), "; ".join(dict.fromkeys(reasons))))
    return Plan(tuple(todo), tuple(kept), tuple(broken), tuple(problems))


def _why(old: Entry | None, new: Entry, destination: Destination, retry_failed: bool) -> str:
    """Why a job is to be done, empty where what there is stands."""
    if old is None:
        return "new"
    changed = [name for name in ("inputs", "config", "code") if getattr(old, name) != getattr(new, name)]
    if changed:
        words = {"inputs": "its files changed", "config": "its configuration changed", "code": "the program changed"}
        return ", ".join(words[name] for name in changed)
    if old.status == "failed":
        return "failed before" if retry_failed else ""
    return "" if destination.has(new.drive, new.method) else "its output is gone"


def run_batch(plan: Plan, destination: Destination, seen: SeenFiles, executor: Executor, budget: float, tell: Tell) -> Summary:
    """Does what is planned, records each outcome as it comes, and writes manifest, catalogue and index when all are in. Raises
    LogError where the destination cannot be written."""
    with destination.open() as manifest:
        work = _Work(plan, destination, manifest, tell)
        for drive, reason in plan.problems:
            work.report({"event": "left out", "drive": drive, "reason": reason})
        for entry in plan.broken:
            work.record(entry, None)
        jobs = [_job(planned, destination.out) for planned in plan.todo]
        for job, outcomes, lost in executor.run(run_job, jobs, [one.memory for one in plan.todo], budget, work.start):
            work.end(job, outcomes, lost)
        destination.finish(work.entries.values(), seen)
        return work.summary()


class _Work:
    """A batch that runs: what has ended, and what is told of it."""

    def __init__(self, plan: Plan, destination: Destination, manifest: OpenManifest, tell: Tell) -> None:
        self._destination, self._manifest, self._tell = destination, manifest, tell
        self.entries = {entry.key: entry for entry in plan.kept}
        self._kept = len(plan.kept)
        self._planned = {planned.assigned.drive.name: planned for planned in plan.todo}
        self._bytes = sum(planned.bytes for planned in plan.todo)
        self._bytes_done = 0.0
        self._drives_done = self._done = self._failed = 0
        self._reasons: dict[str, int] = {}
        self._log = _Log(destination.here / "log")
        self._log.write({"event": "begin", "jobs": len(plan.todo), "kept": self._kept})

    def start(self, job: Job) -> None:
        """A worker has a drive now."""
        self.report({"event": "started", "drive": job.drive})

    def end(self, job: Job, outcomes: list[Outcome] | None, lost: str) -> None:
        """A drive has ended, by itself or with its worker."""
        planned = self._planned[job.drive]
        self._bytes_done += planned.bytes
        self._drives_done += 1
        for entry in planned.entries:
            outcome = None if outcomes is None else next(one for one in outcomes if one.method == entry.method)
            reason = lost if outcome is None else outcome.reason
            row = {} if outcome is None else outcome.row
            ended = replace(entry, status="failed" if reason else "done", reason=reason, row=row)
            self.record(ended, outcome)
        self._destination.push()

    def record(self, entry: Entry, outcome: Outcome | None) -> None:
        """An entry of the manifest as it is now."""
        self.entries[entry.key] = entry
        self._manifest.add(entry)
        self._done += entry.status == "done"
        if entry.status == "failed":
            self._failed += 1
            kind = _kind(entry.reason)
            self._reasons[kind] = self._reasons.get(kind, 0) + 1
        told = {"event": entry.status, "drive": entry.drive, "method": entry.method, "reason": entry.reason}
        self._tell({**told, "number": self._drives_done, "of": len(self._planned), "left_s": self._left_s()})
        trace = {"traceback": outcome.trace} if outcome is not None and outcome.trace else {}
        self._log.write({**told, "timing_s": {} if outcome is None else outcome.timing_s, **trace})

    def report(self, told: dict[str, Any]) -> None:
        """Tells it and writes it to the log."""
        self._tell(told)
        self._log.write(told)

    def summary(self) -> Summary:
        """Of all that has ended."""
        self._log.write({"event": "end", "done": self._done, "failed": self._failed})
        return Summary(self._done, self._failed, self._kept, self._reasons)

    def _left_s(self) -> float | None:
        """By the bytes of logs that are done and those that are not, None before the first."""
        if not self._bytes_done:
            return None
        return round(self._log.after_s * (self._bytes - self._bytes_done) / self._bytes_done, 1)


def _job(planned: Planned, out: Path) -> Job:
    assigned = planned.assigned
    config = assigned.config
    if assigned.drive.reference is not None and config.input.reference.file is None:
        reference = config.input.reference.model_copy(update={"file": _absolute(assigned.drive.reference)})
        config = config.model_copy(update={"input": config.input.model_copy(update={"reference": reference})})
    configs = tuple((entry.method, _by_method(config, entry.method)) for entry in planned.entries)
    place = out / "drives" / assigned.drive.name
    logs = tuple(str(path) for path in assigned.drive.logs)
    return Job(assigned.drive.name, logs, configs, str(place), assigned.vehicle, planned.entries[0].files)


def _absolute(path: Path) -> Path:
    return path if is_address(path) else path.resolve()


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

    @property
    def after_s(self) -> float:
        """Since the batch began."""
        return time.perf_counter() - self._begin

    def write(self, values: dict[str, Any]) -> None:
        """Adds a line."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"after_s": round(self.after_s, 3), **values}) + "\n")
