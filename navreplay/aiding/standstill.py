"""Aiding by standstill: a vehicle at rest has velocity zero (zero-velocity update, ZUPT; Groves (2013), 15.3)."""

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.error_model import ErrorModel
from navreplay.measurements.fixes import angular_rate, velocity_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GateOptions
from navreplay.timeline import Floats, Times
from navreplay.update.gate import Gate
from navreplay.update.verdict import EpochGate

__all__ = ["StandstillAiding", "standstill_candidates"]

_PROBABILITY = 0.9999
"""Of a true standstill to pass the gate, at most."""
_ALONE_NS = 1_000_000_000
"""Time between standstill epochs where nothing else is measured."""


class StandstillAiding:
    """Velocity zero of the IMU, with standard deviation std [m/s] per axis, at t_ns (e,)."""

    name = "standstills"
    kinds = frozenset({"standstill"})

    def __init__(self, t_ns: Times, std: float, model: ErrorModel) -> None:
        self.t_ns = t_ns
        self._noise = np.eye(3) * std**2
        self._size = model.size

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """Velocity zero, NED."""
        zero = np.zeros(3)
        measured = velocity_measurement(state, zero, angular_rate(state, dtheta, dt), zero, self._noise, self._size)
        return Observed(measured._replace(kinds=("standstill",) * 3), state, cov)

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate of its own that is never switched off and never opens the filter: a refused standstill is a wrong one, not a
        filter that has lost its way."""
        return Gate(GateOptions(probability=min(options.probability, _PROBABILITY), reset_after=0))


def standstill_candidates(main_ns: Times, start_ns: int, end_ns: int) -> Times:
    """(e,) times at which standstill may be measured: those of other measurements main_ns (k,), and once a second from
    start_ns to end_ns where there is none."""
    beside = np.arange(start_ns + _ALONE_NS, end_ns, _ALONE_NS, dtype=np.int64)
    edges = np.concatenate([[start_ns - _ALONE_NS], main_ns, [end_ns + _ALONE_NS]])
    later = edges[np.searchsorted(edges, beside)]
    earlier = edges[np.searchsorted(edges, beside, side="right") - 1]
    alone = beside[np.minimum(later - beside, beside - earlier) >= _ALONE_NS]
    return np.union1d(main_ns[(main_ns >= start_ns) & (main_ns <= end_ns)], alone)
