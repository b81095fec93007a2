"""The experiments by name, one file each."""

from pipelines.experiment import Experiment
from pipelines.experiments.ermakf_city import ERMAKF_CITY
from pipelines.experiments.immae import IMMAE_1, IMMAE_2
from pipelines.experiments.mlckf_inaccurate_r import MLCKF_INACCURATE_R
from pipelines.experiments.mlckf_mixture import MLCKF_MIXTURE
from pipelines.experiments.psteckf_uav import PSTECKF_UAV
from pipelines.experiments.redundant_noise import REDUNDANT_NOISE

__all__ = ["EXPERIMENTS"]

_ALL = (ERMAKF_CITY, IMMAE_1, IMMAE_2, REDUNDANT_NOISE, MLCKF_INACCURATE_R, MLCKF_MIXTURE, PSTECKF_UAV)
EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in _ALL}
"""All experiments by name."""
