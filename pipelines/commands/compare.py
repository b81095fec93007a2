"""``navreplay compare``: one drive, several methods, one report."""

import argparse
import json

from navreplay.timeline import LogError
from pipelines.commands.options import read_config
from pipelines.compare import compare
from pipelines.destination import check_folder
from pipelines.outputs import write_comparison
from pipelines.progress import show_progress
from pipelines.summary import describe_outputs, headline_figures, summarise_run

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Processes the logs with each method and writes OUT. Raises LogError for anything the user has to change."""
    names = [name.strip() for name in arguments.filters.split(",") if name.strip()]
    if not names:
        raise LogError("compare: --filters names no method; 'navreplay filters' lists them")
    config = read_config(arguments)
    check_folder(arguments.out, arguments.force)
    with show_progress(arguments.quiet or arguments.json) as progress:
        results = compare(arguments.logs, config, names, progress)
        if progress is not None:
            progress("writing", 0.0)
        outputs = write_comparison(results, arguments.out)
    if arguments.json:
        figures = {"methods": [headline_figures(result) for result in results]}
        print(json.dumps(figures | {"outputs": {name: str(path) for name, path in outputs.items()}}, indent=2))
    elif not arguments.quiet:
        print("\n".join([line for result in results for line in summarise_run(result)] + describe_outputs(outputs)))
