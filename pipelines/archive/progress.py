"""How far a batch is: on a terminal a bar of the whole with the time left and a line per running drive, or lines of JSON."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["show_batch"]

Tell = Callable[[dict[str, Any]], None]


@contextmanager
def show_batch(drives: int, as_json: bool, quiet: bool) -> Iterator[Tell]:
    """A function to tell events to: ``started``, ``done``, ``failed`` and ``left out``. On standard error, but JSON on standard
    output. Without a terminal only failures are shown."""
    if as_json:
        yield lambda values: print(json.dumps(values), flush=True)
    elif quiet:
        yield lambda values: None
    elif not sys.stderr.isatty():
        yield _tell_failures
    else:
        with _bars(drives) as tell:
            yield tell


def _tell_failures(values: dict[str, Any]) -> None:
    line = _failure(values)
    if line:
        print(line, file=sys.stderr, flush=True)


def _failure(values: dict[str, Any]) -> str:
    if values["event"] == "left out":
        return f"{values['drive']}: left out: {values['reason']}"
    return f"{values['drive']} ({values['method']}): {values['reason']}" if values["event"] == "failed" else ""


@contextmanager
def _bars(drives: int) -> Iterator[Tell]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        *(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()),
        TextColumn("{task.fields[left]}", markup=False),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True) as progress:
        whole = progress.add_task("drives", total=drives, left="")
        running: dict[str, TaskID] = {}

        def tell(values: dict[str, Any]) -> None:
            """A line for each drive that runs, which goes when it ends; failures stay above."""
            drive = values["drive"]
            if values["event"] == "started":
                running[drive] = progress.add_task(f"  {drive}", total=None, left="")
                return
            if _failure(values):
                console.print(_failure(values), markup=False, highlight=False)
            if drive in running:
                progress.remove_task(running.pop(drive))
            if "number" in values:
                progress.update(whole, completed=values["number"], left=_left(values["left_s"]))

        yield tell


def _left(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f"{seconds:.0f} s left" if seconds < 120 else f"{seconds / 60:.0f} min left"
