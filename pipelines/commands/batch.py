"""``navreplay batch``: an archive of drives, each as `run` would do it, with a catalogue of all."""

import argparse
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from navreplay.filters.presets import build_method
from navreplay.timeline import LogError
from pipelines.archive.batch import Plan, Summary, plan_batch, run_batch
from pipelines.archive.drives import find_drives
from pipelines.archive.executors import choose_executor
from pipelines.archive.listing import list_files
from pipelines.archive.rules import Assigned, assign, read_rules
from pipelines.commands.options import read_config

__all__ = ["run"]

_SHARE = 0.7
"""Of the machine's memory, for all workers."""


def run(arguments: argparse.Namespace) -> int | None:
    """Plans and does a batch; 2 where some drives failed. Raises LogError for what the user has to change."""
    config = read_config(arguments)
    methods = tuple(arguments.filters.split(",")) if arguments.filters else ()
    for method in methods:
        build_method(method)
    out = arguments.out.resolve()
    for source in arguments.sources:
        place = Path(source).resolve()
        if place.is_dir() and (out == place or place in out.parents):
            raise LogError(
                f"-o {arguments.out} lies inside {source}, so its own results would be read as logs; choose a folder beside it"
            )
    files = [path for path in list_files(arguments.sources, arguments.match) if _within(path, arguments)]
    if not files:
        raise LogError(f"{', '.join(arguments.sources)}: holds no files{_restricted(arguments)}")
    drives, others = find_drives(files, _root(arguments.sources), config.input)
    assigned = assign(drives, read_rules(arguments.rules), arguments.rules, config)
    if not assigned:
        listed = "; ".join(f"{path.name}: {why}" for path, why in list(others.items())[:3])
        raise LogError(
            f"{', '.join(arguments.sources)}: no drive was recognised among {len(files)} files ({listed or 'all are skipped'})"
        )
    plan = plan_batch(assigned, methods, arguments.out, arguments.resume, arguments.retry_failed)
    budget = _memory() * _SHARE
    if arguments.dry_run:
        _show_plan(plan, assigned, others, budget, arguments)
        return None
    executor = choose_executor(arguments.scheduler, arguments.workers or os.cpu_count() or 1)
    with _progress(arguments, sum(len(planned.entries) for planned in plan.todo)) as tell:
        summary = run_batch(plan, arguments.out, executor, budget, tell)
    _tell_summary(summary, plan, arguments)
    return 2 if summary.failed else None


def _within(path: Path, arguments: argparse.Namespace) -> bool:
    changed = datetime.fromtimestamp(path.stat().st_mtime)
    since, until = arguments.since, arguments.until
    return (since is None or changed >= since) and (until is None or changed <= until)


def _restricted(arguments: argparse.Namespace) -> str:
    return " that match --match, --since and --until" if arguments.match != "*" or arguments.since or arguments.until else ""


def _root(sources: list[str]) -> Path:
    folders = [Path(source) for source in sources if Path(source).is_dir()]
    return folders[0] if len(folders) == 1 else Path(os.path.commonpath([Path(source).resolve() for source in sources]))


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
    for path, why in others.items():
        print(f"{path}: {why}")
    print(f"{len(plan.todo)} of {len(assigned)} drives to process; workers share {budget / 1e9:.1f} GB")


@contextmanager
def _progress(arguments: argparse.Namespace, total: int) -> Iterator[Any]:
    if arguments.json:
        yield lambda values: print(json.dumps(values), flush=True)
        return
    if arguments.quiet:
        yield lambda values: None
        return
    from tqdm import tqdm

    with tqdm(total=total, unit="run", disable=None, leave=False) as bar:

        def tell(values: dict[str, Any]) -> None:
            """Moves the bar; failures stand above it."""
            if values["event"] == "left out":
                bar.write(f"{values['drive']}: left out: {values['reason']}", file=sys.stderr)
                return
            bar.update(1)
            bar.set_postfix_str(values["drive"])
            if values["reason"]:
                bar.write(f"{values['drive']} ({values['method']}): {values['reason']}", file=sys.stderr)

        yield tell


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
    print(f"{arguments.out / 'index.html'}\n{arguments.out / 'catalog.parquet'}")
