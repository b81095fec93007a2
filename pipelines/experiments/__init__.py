"""The experiments by name, one file each."""

from pipelines.experiments.auto_noise import AUTO_EXPERIMENTS
from pipelines.experiments.emkf_spiral import EMKF_SPIRAL
from pipelines.experiments.ermakf_city import ERMAKF_CITY
from pipelines.experiments.immae import IMMAE_1, IMMAE_2
from pipelines.experiments.mlckf_inaccurate_r import MLCKF_INACCURATE_R
from pipelines.experiments.mlckf_mixture import MLCKF_MIXTURE
from pipelines.experiments.psteckf_uav import PSTECKF_UAV
from pipelines.experiments.redundant_noise import REDUNDANT_NOISE
from pipelines.monte_carlo.experiment import Experiment

__all__ = ["EXPERIMENTS"]

_PAPERS = (ERMAKF_CITY, IMMAE_1, IMMAE_2, MLCKF_INACCURATE_R, MLCKF_MIXTURE, PSTECKF_UAV, EMKF_SPIRAL)
_ALL = (*_PAPERS, REDUNDANT_NOISE, *AUTO_EXPERIMENTS)
EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in _ALL}
"""All experiments by name."""
