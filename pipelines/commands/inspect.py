"""``navreplay inspect``: what logs hold and what looks wrong in them."""

import argparse
import json

from importers.inspection import inspect_logs
from pipelines.commands.options import read_config
from pipelines.report.inspection import describe_inspection, inspection_values

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Prints channels, assumptions and findings. Raises LogError for a file that cannot be opened."""
    inspection = inspect_logs(arguments.logs, read_config(arguments).input)
    if arguments.json:
        print(json.dumps(inspection_values(inspection), indent=2))
    else:
        print("\n".join(describe_inspection(inspection)))
