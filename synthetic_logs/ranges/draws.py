"""Random numbers for the rows of a log of ranges."""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from navreplay.timeline import Floats
from synthetic_logs.sensors.imu_errors import draw_gauss_markov
from synthetic_logs.sensors.seeding import generator_for

__all__ = ["Draws", "exponential"]


@dataclass(frozen=True, eq=False, slots=True)
class Draws:
    """Numbers for k rows, each of an epoch (k,) among n_epochs, interval [s] apart, and a satellite (k,) among n_satellites.

    They are drawn for every epoch and satellite and then picked, so that a change of what is seen leaves them as they are.
    correlation_time [s]: of correlated numbers. Every purpose has a generator of its own.
    """

    seed: int
    epoch: NDArray[np.intp]
    satellite: NDArray[np.intp]
    n_epochs: int
    n_satellites: int
    interval: float
    correlation_time: float

    def rows(self, kept: NDArray[np.bool_]) -> "Draws":
        """The same numbers for the rows where kept (k,) is true."""
        return replace(self, epoch=self.epoch[kept], satellite=self.satellite[kept])

    def normal(self, purpose: str) -> Floats:
        """(k,) independent standard normal numbers."""
        rng = generator_for(self.seed, purpose)
        return rng.standard_normal((self.n_epochs, self.n_satellites))[self.epoch, self.satellite]

    def uniform(self, purpose: str) -> Floats:
        """(k,) independent numbers from 0 to 1."""
        return generator_for(self.seed, purpose).random((self.n_epochs, self.n_satellites))[self.epoch, self.satellite]

    def correlated(self, purpose: str) -> Floats:
        """(k,) standard normal numbers, a Gauss-Markov process for each satellite, steady from the first epoch."""
        rng = generator_for(self.seed, purpose)
        tau = self.correlation_time
        start = rng.standard_normal(self.n_satellites)
        return draw_gauss_markov(rng, start, sqrt(2 / tau), tau, self.interval, self.n_epochs)[self.epoch, self.satellite]

    def per_visit(self, purpose: str, visits: NDArray[np.intp], count: int) -> Floats:
        """(k,) numbers from 0 to 1 that a satellite keeps during one of count visits; visits: (n_epochs,) from 0 to count."""
        rng = generator_for(self.seed, purpose)
        return rng.random((count + 1, self.n_satellites))[visits[self.epoch], self.satellite]


def exponential(normal: Floats) -> Floats:
    """Exponential numbers of mean 1 from standard normal ones, in the same order."""
    return np.asarray(-log_ndtr(-normal))
