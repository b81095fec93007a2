"""``navreplay export``: the trajectory of a finished run in the format of another program."""

import argparse

from pipelines.files.destination import check_file
from pipelines.trajectory.export import export

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Writes the file. Raises LogError for a folder without a solution or a file that cannot be written."""
    path = arguments.out or arguments.folder / f"trajectory.{arguments.format}"
    check_file(path, arguments.force)
    export(arguments.folder, arguments.format, path)
    print(path)
