"""Enhanced innovation-based adaptive filter (EIAKF): innovation covariance with a first-order autoregressive correction.

Source: Ghaleb et al., Pervasive and Mobile Computing 40 (2017) 139, as Ge et al., Sensors 20 (2020) 6041, describe and use it:
the innovations of a window are tested for randomness; where they are not random they count as AR(1), a by Yule-Walker, and
their variance is the mean square over 1 - a beta_1 = 1 - a^2, (29) with order one. R = C_nu - H P H', as in `iae`: of each
epoch's H P H', in ratios to the told variances, which scale the told R.
Readings: the test is |r_1| beyond 1.96 / sqrt(window), its two-sided 95 % bound for white noise; random innovations give plain
IAE; the denominator is kept above least_denominator.
Assumes: model and Q are right, and innovations are correlated because the noise is.
Fails: with Q or P wrong, which goes into R; a filter with too small an R has correlated innovations by itself; and the mean
square is the variance of an AR(1) sequence already, so that the correction overstates it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.redundant.autoregression import autocorrelation
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Eiakf", "Past", "corrected_variance"]


class Past(NamedTuple):
    """One label's window without a gap: innovations in units of the told standard deviation, variances of prediction over told
    variances, both oldest first; and the time of the last epoch."""

    innovations: tuple[float, ...]
    spreads: tuple[float, ...]
    t_ns: int


def corrected_variance(innovations: Floats, least_denominator: float) -> Floats:
    """(k,) variance of innovations (k, n), those that are not random as of an AR(1) sequence."""
    first = autocorrelation(innovations, 1)[:, 0]
    random = np.abs(first) <= 1.96 / np.sqrt(innovations.shape[1])
    denominator = np.where(random, 1.0, np.maximum(1 - first**2, least_denominator))
    return np.asarray((innovations**2).mean(axis=1) / denominator)


@dataclass(frozen=True, slots=True)
class Eiakf:
    """window [epochs]: length; until a component's is full the told R holds for it. longest_step [s]: a longer one between two
    epochs begins a new window. least_denominator: of the correction. floor: least ratio of used to told variance."""

    window: int = 30
    longest_step: float = 1.5
    least_denominator: float = 0.1
    floor: float = 0.05

    def init(self) -> Mapping[str, Past]:
        """Nothing seen yet."""
        return {}

    def adapt(self, state: Mapping[str, Past], prior: Gaussian, innovation: Innovation) -> Adaptation[Mapping[str, Past]]:
        """R scaled by the corrected variance of each component's innovations, less that of their predictions."""
        pasts = self._extend(state, innovation)
        ratio = np.ones(len(pasts))
        full = [i for i, past in enumerate(pasts.values()) if len(past.innovations) == self.window]
        if full:
            windows = list(pasts.values())
            innovations = np.array([windows[i].innovations for i in full])
            spread = np.array([windows[i].spreads for i in full]).mean(axis=1)
            ratio[full] = np.maximum(corrected_variance(innovations, self.least_denominator) - spread, self.floor)
        return Adaptation(prior, scale_noise(innovation.noise, ratio), {**state, **pasts})

    def _extend(self, state: Mapping[str, Past], innovation: Innovation) -> dict[str, Past]:
        told = np.diagonal(innovation.noise)
        values = (innovation.residual / np.sqrt(told)).tolist()
        spreads = (np.diagonal(innovation.spread) / told).tolist()
        oldest = innovation.t_ns - self.longest_step * 1e9
        pasts = {}
        for label, value, spread in zip(innovation.labels, values, spreads, strict=True):
            last = state.get(label)
            if last is None or last.t_ns < oldest:
                last = Past((), (), 0)
            innovations, variances = (*last.innovations, value), (*last.spreads, spread)
            pasts[label] = Past(innovations[-self.window :], variances[-self.window :], innovation.t_ns)
        return pasts
