"""Simple redundant-measurement adaptive filter (SRMAKF): R from differences of consecutive epochs.

Source: the RMAE of Ge et al., Sensors 20 (2020) 6041, (12)-(18): R = E[d d'] / 2, with d the difference over one epoch of what
the receiver measured and of what the INS predicted (see `trails`), averaged over a window. Each component is taken by itself,
and what is averaged is the ratio to the told variance, which scales the told R; with a constant R that is (17).
Assumes: noise that is white from epoch to epoch, and an INS whose error grows little within one. Errors of the state drop
out, so neither Q nor a wrong position disturbs it.
Fails: on noise that is correlated in time, whose differences are small: of Gauss-Markov noise with time constant T it finds
the share 1 - exp(-1 / T), which is 0.18, 0.05, 0.02 for 5, 20, 60 epochs; and on constant biases, which it cannot see.
In white noise one estimate scatters by sqrt(3 / window) of its value.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.redundant.trails import Trails, extend_trails, stack_trails
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Srmakf"]


@dataclass(frozen=True, slots=True)
class Srmakf:
    """window [epochs]: M, at most. least [epochs]: until a component has so many differences the told R holds for it.
    longest_step [s]: no difference reaches further. floor: least ratio of used to told variance."""

    window: int = 30
    least: int = 10
    longest_step: float = 1.5
    floor: float = 0.01

    def init(self) -> Trails:
        """Nothing seen yet."""
        return {}

    def adapt(self, state: Trails, prior: Gaussian, innovation: Innovation) -> Adaptation[Trails]:
        """R scaled by half the mean square of each component's differences."""
        trails = extend_trails(state, innovation, self.window, self.longest_step)
        differences, count = stack_trails(list(trails.values()), self.window)
        ratio = (differences**2).sum(axis=1) / (2 * np.maximum(count, 1))
        ratio = np.where(count >= self.least, np.maximum(ratio, self.floor), 1.0)
        return Adaptation(prior, scale_noise(innovation.noise, ratio), {**state, **trails})
