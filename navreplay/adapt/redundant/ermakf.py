"""Enhanced redundant-measurement adaptive filter (ERMAKF), as printed.

Source: Ge et al., Sensors 20 (2020) 6041: differences over one epoch (12)-(14) as in `srmakf`, averaged with random weights
(17)-(19); a kernel density of the window tells whether the newest difference is credible (20)-(24); where several in a row
are not, the sequence counts as correlated, and its variance is (29): the mean square over 1 - sum of a_i beta_i, a_i the
coefficients of Burg's model (25)-(28) of Akaike's order, beta_i the autocorrelation. R is half the variance.
Readings: (19) prints both 1 / M and weights that sum to one; one of the two normalisations is used. The paper gives neither
the window nor the number of doubtful differences nor the largest order. A denominator below least_denominator is raised to it.
Assumes: that differences which are not credible mean correlated noise, and that (29) undoes the correlation.
Fails: in substance. Differencing has removed most of a correlated error before anything is estimated, and what is left looks
white, so that Gauss-Markov noise of 5, 20, 60 epochs comes out at 0.2, 0.05, 0.02 of its variance, as it does without (29).
White noise makes differences correlated (-1/2 at one epoch), and (29) calls it 1.9 to 2.3 times what it is; its numerator
is the variance already. One flat draw of weights adds scatter and is no guard against outliers. `ermakf_derived` mends this.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.redundant.autoregression import explained_share
from navreplay.adapt.redundant.kernel_density import is_credible
from navreplay.adapt.redundant.random_weights import random_weights
from navreplay.adapt.redundant.trails import Trail, Trails, extend_trails, stack_trails
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Ermakf", "correlated_variance"]


def correlated_variance(differences: Floats, max_order: int, least_denominator: float) -> Floats:
    """(k,) the variance (29) of differences (k, n)."""
    denominator = np.maximum(1 - explained_share(differences, max_order), least_denominator)
    return np.asarray((differences**2).mean(axis=1) / denominator)


@dataclass(frozen=True, slots=True)
class Ermakf:
    """window [epochs]: M and N, at most. least [epochs]: until a component has so many differences the told R holds for it.
    longest_step [s]: no difference reaches further. concentration, draws, seed: of the random weights. doubtful: differences
    in a row that are not credible from which a component counts as correlated; a full window is needed to doubt. max_order:
    of the autoregressive model. least_denominator: of (29). floor: least ratio of used to told variance."""

    window: int = 30
    least: int = 10
    longest_step: float = 1.5
    concentration: float = 1.0
    draws: int = 1
    seed: int = 1
    doubtful: int = 3
    max_order: int = 8
    least_denominator: float = 0.1
    floor: float = 0.01

    def init(self) -> Trails:
        """Nothing seen yet."""
        return {}

    def adapt(self, state: Trails, prior: Gaussian, innovation: Innovation) -> Adaptation[Trails]:
        """R scaled by half the variance of each component's differences."""
        trails = extend_trails(state, innovation, self.window, self.longest_step)
        trails = self._doubt(state, trails)
        differences, count = stack_trails(list(trails.values()), self.window)
        weights = random_weights(self.seed, innovation.t_ns, count, self.window, self.concentration, self.draws)
        variance = (weights * differences**2).sum(axis=1)
        correlated = np.array([trail.doubtful >= self.doubtful for trail in trails.values()])
        if correlated.any():
            variance[correlated] = correlated_variance(differences[correlated], self.max_order, self.least_denominator)
        ratio = np.where(count >= self.least, np.maximum(variance / 2, self.floor), 1.0)
        return Adaptation(prior, scale_noise(innovation.noise, ratio), {**state, **trails})

    def _doubt(self, before: Trails, now: dict[str, Trail]) -> dict[str, Trail]:
        """Counts doubtful differences in a row, judged by the full window before each."""
        full = [label for label in now if now[label].differences and len(before[label].differences) == self.window]
        if not full:
            return now
        samples, _ = stack_trails([before[label] for label in full], self.window)
        newest = np.array([now[label].differences[-1] for label in full])
        credible = dict(zip(full, is_credible(samples, newest).tolist(), strict=True))
        return {
            label: trail._replace(doubtful=0 if credible.get(label, True) else trail.doubtful + 1)
            for label, trail in now.items()
        }
