"""``navreplay compare``: one drive, several methods, one report."""

import argparse
import json

from pipelines.commands.options import read_settings
from pipelines.drive.compare import compare, name_methods, plan_variants
from pipelines.files.destination import check_folder
from pipelines.outputs import write_comparison, write_each
from pipelines.progress import show_progress
from pipelines.report.comparison_summary import comparison_values, summarise_comparison
from pipelines.report.summary import describe_outputs

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Processes the logs with each method and writes OUT. Raises LogError for anything the user has to change."""
    variants = plan_variants(name_methods(arguments.filters), read_settings(arguments))
    check_folder(arguments.out, arguments.force)
    with show_progress(arguments.quiet or arguments.json) as progress:
        comparison = write_each(compare(arguments.logs, variants, progress), arguments.out)
        if progress is not None:
            progress("writing", 0.0)
        outputs = write_comparison(comparison, arguments.out)
    if arguments.json:
        figures = comparison_values(comparison)
        print(json.dumps(figures | {"outputs": {name: str(path) for name, path in outputs.items()}}, indent=2))
    elif not arguments.quiet:
        print("\n".join(summarise_comparison(comparison) + describe_outputs(outputs)))
