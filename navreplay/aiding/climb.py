"""Aiding by vertical velocity: a barometer's, or none at all in outages (height hold)."""

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.error_model import ErrorModel
from navreplay.measurements.climb import climb_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GateOptions
from navreplay.timeline import Floats, Times
from navreplay.update.gate import Gate
from navreplay.update.verdict import EpochGate

__all__ = ["ClimbAiding", "unaided_times"]

_OUTAGE_NS = 2_000_000_000


class ClimbAiding:
    """Vertical velocities rate (e,) [m/s] upward with deviations std (e,) at t_ns (e,). kind: of the measurements."""

    name = "climbs"

    def __init__(self, t_ns: Times, rate: Floats, std: Floats, kind: str, model: ErrorModel) -> None:
        self.t_ns = t_ns
        self.kinds = frozenset({kind})
        self._rate, self._std, self._kind, self._size = rate, std, kind, model.size

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The vertical velocity with index epoch."""
        rate, std = float(self._rate[epoch]), float(self._std[epoch])
        return Observed(climb_measurement(state, rate, std, self._size, self._kind), state, cov)

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate of its own that never opens the filter."""
        return Gate(GateOptions(probability=options.probability, reset_after=0))


def unaided_times(main_ns: Times, t_ns: Times) -> Times:
    """Those of the times t_ns (k,) within two seconds of which no other measurement main_ns (m,) lies."""
    ends = np.searchsorted(main_ns, t_ns + _OUTAGE_NS, side="right")
    return t_ns[ends == np.searchsorted(main_ns, t_ns - _OUTAGE_NS)]
