"""``navreplay synth``: a synthetic log and its truth."""

import argparse
import difflib

from navreplay.timeline import LogError
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import simulate
from synthetic_logs.writers import write

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Writes the log, or lists the scenarios. Raises LogError for an unknown scenario or a file that cannot be written."""
    if arguments.scenario == "list":
        width = max(len(name) for name in SCENARIOS)
        for scenario in SCENARIOS.values():
            print(f"{scenario.name:<{width}}  {scenario.description}")
        return
    if arguments.scenario not in SCENARIOS:
        nearest = difflib.get_close_matches(arguments.scenario, SCENARIOS, n=1, cutoff=0.0)[0]
        raise LogError(f"unknown scenario '{arguments.scenario}'; the nearest is '{nearest}'; 'navreplay synth list' lists all")
    if arguments.out is None:
        raise LogError("synth: name the file to write with -o; its extension names the format, for example -o drive.mcap")
    for path in write(simulate(SCENARIOS[arguments.scenario], arguments.seed), arguments.out, arguments.force):
        print(path)
