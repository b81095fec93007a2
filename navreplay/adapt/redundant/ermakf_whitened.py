"""Redundant-measurement filter for correlated noise that also allows for its staying.

Source: own, on top of `ermakf_derived`, which finds the variance s^2 of each component's noise, the share g of it that is
correlated, and its time constant T. A filter that takes noise for white averages it away sooner than it goes. White noise of
variance s^2 (1 - g + g (1 + rho) / (1 - rho)), with rho = exp(-interval / T), has the same spectral density at low
frequencies, hence the same effect on a slow state, and that is the R used here.
Assumes: as `ermakf_derived`; and states that change slowly against T, so that low frequencies are what counts.
Fails: as `ermakf_derived`, more so, since T multiplies what s^2 is uncertain by, and what looks constant is nearly left out,
which an IMU that drifts does not bear; velocities and attitudes that change within T
could learn more from correlated measurements than this R lets them.
"""

from dataclasses import dataclass
from math import exp

from navreplay.adapt.redundant.ermakf_derived import ErmakfDerived
from navreplay.adapt.redundant.lag_curve import Correlation

__all__ = ["ErmakfWhitened"]


@dataclass(frozen=True, slots=True)
class ErmakfWhitened(ErmakfDerived):
    """Parameters as of `ErmakfDerived`."""

    def _enlarge(self, correlation: Correlation, interval: float) -> float:
        rho = exp(-interval / correlation.time)
        return 1 - correlation.share + correlation.share * (1 + rho) / (1 - rho)
