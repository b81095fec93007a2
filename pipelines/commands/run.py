"""``navreplay run``: one drive, one method; solution, report and recording."""

import argparse
import json
import os
import sys

from pipelines.commands.options import read_config
from pipelines.drive.process import process
from pipelines.files.destination import check_folder
from pipelines.outputs import write_outputs
from pipelines.progress import show_progress
from pipelines.report.summary import describe_outputs, describe_verdict_lines, headline_figures, summarise_run

__all__ = ["run"]


_POOR = 3


def run(arguments: argparse.Namespace) -> int:
    """Processes the logs and writes OUT; the exit code, which is 3 where the verdict is poor and --strict was given.

    Raises LogError for anything the user has to change.
    """
    config = read_config(arguments)
    check_folder(arguments.out, arguments.force)
    with show_progress(arguments.quiet or arguments.json) as progress:
        result = process(arguments.logs, config, progress, not arguments.quick)
        if progress is not None:
            progress("writing", 0.0)
        outputs = write_outputs(result, arguments.out)
    if "recording.rrd" not in outputs:
        (arguments.out / "recording.rrd").unlink(missing_ok=True)  # of an earlier run, which --force overwrites
    if arguments.json:
        print(json.dumps(headline_figures(result) | {"outputs": {name: str(path) for name, path in outputs.items()}}, indent=2))
    elif not arguments.quiet:
        print("\n".join(summarise_run(result) + describe_outputs(outputs)))
        colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        print("\n".join(describe_verdict_lines(result, colour)))
    return _POOR if arguments.strict and result.verdict.grade == "poor" else 0
