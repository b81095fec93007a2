"""``navreplay experiment``: methods against each other and against a paper, over many seeds."""

import argparse
import difflib
import os

from navreplay.timeline import LogError
from pipelines.experiments import EXPERIMENTS
from pipelines.files.destination import check_folder
from pipelines.monte_carlo.experiment import run_experiment
from pipelines.monte_carlo.report import write_experiment
from pipelines.progress import show_progress
from pipelines.report.summary import describe_outputs

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Runs the experiment and writes OUT, or lists the experiments. Raises LogError for an unknown one or an OUT that cannot be
    written."""
    if arguments.experiment == "list":
        width = max(len(name) for name in EXPERIMENTS)
        for experiment in EXPERIMENTS.values():
            print(f"{experiment.name:<{width}}  {experiment.description}")
        return
    if arguments.experiment not in EXPERIMENTS:
        nearest = difflib.get_close_matches(arguments.experiment, EXPERIMENTS, n=1, cutoff=0.0)[0]
        raise LogError(
            f"unknown experiment '{arguments.experiment}'; the nearest is '{nearest}'; 'navreplay experiment list' lists all"
        )
    if arguments.out is None:
        raise LogError("experiment: name the folder for the results with -o")
    check_folder(arguments.out, arguments.force)
    experiment = EXPERIMENTS[arguments.experiment]
    jobs = arguments.jobs or os.cpu_count() or 1
    with show_progress(arguments.quiet) as progress:
        outcomes = run_experiment(experiment, arguments.seeds, jobs, progress)
    outputs = write_experiment(experiment, outcomes, arguments.out)
    if not arguments.quiet:
        print("\n".join(describe_outputs(outputs)))
