"""The experiments by name, one file each."""

from pipelines.experiment import Experiment
from pipelines.experiments.ermakf_city import ERMAKF_CITY
from pipelines.experiments.redundant_noise import REDUNDANT_NOISE

__all__ = ["EXPERIMENTS"]

EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in (ERMAKF_CITY, REDUNDANT_NOISE)}
"""All experiments by name."""
