"""``navreplay batch``: an archive of drives, each as `run` would do it, with a catalogue of all."""

import argparse
import json
import os
from datetime import datetime
from pathlib import Path

from importers.containers.remote import address_of
from navreplay.filters.presets import build_method
from navreplay.timeline import LogError
from pipelines.archive.batch import Plan, Summary, plan_batch, run_batch
from pipelines.archive.destination import Destination
from pipelines.archive.executors import choose_executor
from pipelines.archive.manifest import code_version
from pipelines.archive.progress import show_batch
from pipelines.archive.sources.drives import find_drives
from pipelines.archive.sources.listing import list_files
from pipelines.archive.sources.rules import Assigned, assign, read_rules
from pipelines.archive.sources.seen import SOURCES, SeenFiles
from pipelines.commands.options import read_config
from pipelines.files.remote import is_address, status_of

__all__ = ["run"]

_SHARE = 0.7
"""Of the machine's memory, for all workers."""


def run(arguments: argparse.Namespace) -> int | None:
    """Plans and does a batch; 2 where some drives failed. Raises LogError for what the user has to change."""
    config = read_config(arguments)
    methods = tuple(arguments.filters.split(",")) if arguments.filters else ()
    for method in methods:
        build_method(method)
    _check_apart(arguments)
    workers = arguments.workers or os.cpu_count() or 1
    _check_reach(arguments, workers)
    files = [path for path in list_files(arguments.sources, arguments.match) if _within(path, arguments)]
    if not files:
        raise LogError(f"{', '.join(arguments.sources)}: holds no files{_restricted(arguments)}")
    destination = Destination(arguments.out)
    seen = SeenFiles(config.input, code_version())
    seen.read(destination.here / SOURCES)
    drives, others = find_drives(files, _root(arguments.sources), seen)
    assigned = assign(drives, read_rules(arguments.rules), arguments.rules, config)
    if not assigned:
        listed = "; ".join(f"{path.name}: {why}" for path, why in list(others.items())[:3])
        raise LogError(
            f"{', '.join(arguments.sources)}: no drive was recognised among {len(files)} files ({listed or 'all are skipped'})"
        )
    plan = plan_batch(assigned, methods, destination, seen, arguments.resume, arguments.retry_failed)
    budget = _memory() * _SHARE
    if arguments.dry_run:
        _show_plan(plan, assigned, others, budget, arguments)
        return None
    executor = choose_executor(arguments.scheduler, workers)
    with show_batch(len(plan.todo), arguments.json, arguments.quiet) as tell:
        summary = run_batch(plan, destination, seen, executor, budget, tell)
    _tell_summary(summary, plan, arguments)
    return 2 if summary.failed else None


def _check_apart(arguments: argparse.Namespace) -> None:
    """Raises LogError where the destination lies inside a source, or is a file."""
    out = arguments.out if is_address(arguments.out) else arguments.out.resolve()
    if out.is_file():
        raise LogError(f"-o {arguments.out}: is a file, but -o names a folder for the results")
    for source in arguments.sources:
        place = Path(source) if is_address(Path(source)) else Path(source).resolve()
        if (place.is_dir() or is_address(place)) and (out == place or place in out.parents):
            raise LogError(
                f"-o {arguments.out} lies inside {source}, so its own results would be read as logs; choose a folder beside it"
            )


def _check_reach(arguments: argparse.Namespace, workers: int) -> None:
    """Raises LogError for an address that lives in this process alone while others are to work."""
    apart = arguments.scheduler is not None or workers > 1
    own = [one for one in (*arguments.sources, str(arguments.out)) if one.startswith("memory:")]
    if apart and own:
        raise LogError(f"{own[0]}: is the memory of this process, which other workers do not see; use --workers 1")


def _within(path: Path, arguments: argparse.Namespace) -> bool:
    since, until = arguments.since, arguments.until
    if since is None and until is None:
        return True
    try:
        changed = datetime.fromtimestamp(status_of(path)[1] / 1e9, since.tzinfo if since else until.tzinfo)
    except OSError:
        return True  # which is told where it is read
    return (since is None or changed >= since) and (until is None or changed <= until)


def _restricted(arguments: argparse.Namespace) -> str:
    return " that match --match, --since and --until" if arguments.match != "*" or arguments.since or arguments.until else ""


def _root(sources: list[str]) -> Path:
    places = [Path(source) for source in sources]
    folders = [place for place in places if place.is_dir() or (is_address(place) and not place.suffix)]
    if len(folders) == 1 or any(map(is_address, places)):
        return folders[0] if folders else places[0].parent
    return Path(os.path.commonpath([Path(source).resolve() for source in sources]))


def _memory() -> float:
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _show_plan(
    plan: Plan, assigned: list[Assigned], others: dict[Path, str], budget: float, arguments: argparse.Namespace
) -> None:
    todo = {planned.assigned.drive.name: planned for planned in plan.todo}
    if arguments.json:
        drives = [
            {
                "drive": one.drive.name,
                "logs": [str(path) for path in one.drive.logs],
                "reference": None if one.drive.reference is None else str(one.drive.reference),
                "why": one.drive.why,
                "todo": todo[one.drive.name].why if one.drive.name in todo else "",
            }
            for one in assigned
        ]
        print(json.dumps({"drives": drives, "no_logs": {str(path): why for path, why in others.items()}}, indent=2))
        return
    for one in assigned:
        drive = one.drive
        reference = "" if drive.reference is None else f"; reference {drive.reference.name}"
        print(f"{drive.name}: {', '.join(path.name for path in drive.logs)}{reference} ({drive.why})")
        if drive.name in todo:
            planned = todo[drive.name]
            names = ", ".join(entry.method for entry in planned.entries)
            print(f"    {names}: {planned.why}; about {planned.memory / 1e9:.1f} GB")
    for name, reason in plan.problems:
        print(f"{name}: left out: {reason}")
    for entry in plan.broken:
        print(f"{entry.drive}: {entry.reason}")
    for path, why in others.items():
        print(f"{path}: {why}")
    print(f"{len(plan.todo)} of {len(assigned)} drives to process; workers share {budget / 1e9:.1f} GB")


def _tell_summary(summary: Summary, plan: Plan, arguments: argparse.Namespace) -> None:
    if arguments.json:
        totals = {"done": summary.done, "failed": summary.failed, "skipped": summary.skipped, "left_out": len(plan.problems)}
        print(json.dumps({"event": "end", **totals, "reasons": summary.reasons}))
        return
    if arguments.quiet:
        return
    left = f", {len(plan.problems)} left out" if plan.problems else ""
    print(f"{summary.done} done, {summary.failed} failed, {summary.skipped} as they were{left}")
    for reason, count in sorted(summary.reasons.items(), key=lambda one: -one[1]):
        print(f"  {count} x {reason}")
    out = address_of(str(arguments.out)) or arguments.out
    print(f"{out}/index.html\n{out}/catalog.parquet")
