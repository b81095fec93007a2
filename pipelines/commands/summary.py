"""``navreplay summary``: an archive as a whole, on one page of text."""

import argparse
import json

from pipelines.archive.survey import survey, survey_text

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Prints it. Raises LogError where there is no archive."""
    values = survey(arguments.folder)
    print(json.dumps(values, indent=2) if arguments.json else survey_text(values))
