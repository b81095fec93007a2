"""Partially strong tracking: a fading factor on the predicted covariance of the states, but not on what they share with biases.

Source: Lou et al., Robust partially strong tracking extended consider Kalman filtering for INS/GNSS integrated navigation, IEEE
Access 7 (2019), eqs. (32), (44)-(48): P_k|k-1 = lambda P* + Q, lambda = max(1, tr(O) / tr(M)), M = H P* H',
O = V - N C' H' - H C N' - H Q H' - N P_pp N' - R, V_k = (rho V_k-1 + nu nu') / (1 + rho), V_1 = nu nu'. With S of lambda = 1,
O is V - (S - M). The biases are those of `ConsideredModel`; C and P_pp stay as they are. Traces over metres and metres per
second mean nothing: here each component is normalised by its nominal standard deviation, the square root of its S of the epoch.
lambda multiplies all of P*, also what no measurement sees (heading and sensor errors in straight flight): there nothing takes
back what each epoch adds, and P grows until it overflows. The guard: the standard deviations of states behind position and
velocity are inflated only as far as `ceiling` times those of the first epoch, by P + E P* E with diagonal E, which is
lambda P* + Q where no state is held, and positive semidefinite with C in any case. Position and velocity are not inflated at
all by attitudes alone, which see next to nothing of them: nothing would ever take that back.
Assumes: R and P_pp are right, so that an excess comes from the model.
Fails: rho = 0.95 is a memory of about two epochs, and where P* is small against R the quotient is mostly noise: lambda exceeds
1 about every other epoch in nominal conditions, which costs accuracy there. Outliers and noise larger than told are believed.
When well specified: mean NEES per state 0.75 to 1.1, NIS per component 0.75 to 0.95.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.error_models.ned import VELOCITY
from navreplay.timeline import Floats
from navreplay.update.gaussian import symmetric
from navreplay.update.measurement import Measurement

__all__ = ["PartialTracking", "Tracked"]

_KINEMATIC = frozenset({"position", "velocity", "range", "range_rate"})
"""Kinds that see position and velocity."""


class Tracked(NamedTuple):
    """faded: by kind and label, the normalised V. limits: (n,) variances up to which states are inflated; None before the first
    epoch."""

    faded: Mapping[tuple[str, str], float]
    limits: Floats | None


@dataclass(frozen=True, slots=True)
class PartialTracking:
    """forgetting: rho. ceiling: bound on inflated standard deviations of attitude, sensor errors and clock, in those of the
    first epoch."""

    forgetting: float = 0.95
    ceiling: float = 10.0

    def init(self) -> Tracked:
        """Nothing seen yet."""
        return Tracked({}, None)

    def inflate(self, state: Tracked, cov: Floats, process: Floats, measurement: Measurement) -> tuple[Floats, Tracked]:
        """The prior covariance cov (n + p, n + p) with its first n states inflated, process (n, n) being the Q of the interval
        and the measurement's Jacobian (m, n + p); and what is carried to the next epoch."""
        n = len(process)
        moved = symmetric(cov[:n, :n] - process)
        factor, faded = self._factor(state, cov, moved, measurement)
        limits = self._limits(np.diagonal(cov)[:n]) if state.limits is None else state.limits
        inflated = cov
        if factor > 1:
            variance = np.diagonal(moved)
            room = np.zeros(n)
            np.divide(np.maximum(limits - np.diagonal(cov)[:n], 0), variance, out=room, where=variance > 0)
            share = np.sqrt(np.minimum(factor - 1, room))
            share[: VELOCITY.stop] *= not _KINEMATIC.isdisjoint(measurement.kinds)
            inflated = cov.copy()
            inflated[:n, :n] += share[:, None] * moved * share
        return inflated, Tracked({**state.faded, **faded}, limits)

    def _limits(self, first: Floats) -> Floats:
        """(n,) of the variances (n,) at the first epoch."""
        limits = self.ceiling**2 * first
        limits[: VELOCITY.stop] = np.inf
        return limits

    def _factor(
        self, state: Tracked, cov: Floats, moved: Floats, measurement: Measurement
    ) -> tuple[float, dict[tuple[str, str], float]]:
        """c of eq. (46), and the faded squares V by component."""
        own = measurement.jacobian[:, : len(moved)]
        seen = ((own @ moved) * own).sum(axis=1)
        nominal = ((measurement.jacobian @ cov) * measurement.jacobian).sum(axis=1) + np.diagonal(measurement.noise)
        square = measurement.residual**2 / nominal
        components = list(zip(measurement.kinds, measurement.labels, strict=True))
        last = np.array([state.faded.get(key, now) for key, now in zip(components, square.tolist(), strict=True)])
        faded = (self.forgetting * last + square) / (1 + self.forgetting)
        factor = (faded - (nominal - seen) / nominal).sum() / (seen / nominal).sum()
        return float(factor), dict(zip(components, faded.tolist(), strict=True))
