"""What is done when a gate has shut a kind of measurement out for too long: the filter, not the measurement, is doubted.

The covariance grows by what the measurements are off, in the states that the kind measures and in no others, so that neither
attitude nor biases are bent to explain a position. A filter that needs this again and again has lost its way.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.record import Recorder

__all__ = ["LossWatch", "Widening", "tell_widening", "widen"]

_POSITION = ("position_n", "position_e", "position_d")
_VELOCITY = ("velocity_n", "velocity_e", "velocity_d")
_MEASURES: dict[str, tuple[str, ...]] = {
    "position": _POSITION,
    "velocity": _VELOCITY,
    "range": (*_POSITION, "clock_offset"),
    "range_rate": (*_VELOCITY, "clock_drift"),
    "attitude": ("attitude_n", "attitude_e", "attitude_d"),
    "heading": ("attitude_d",),
    "standstill": _VELOCITY,
    "zero_rate": ("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
}
"""By kind, how the names of the states begin that it measures."""

_UNITS = {"position": "m", "range": "m", "velocity": "m/s", "range_rate": "m/s", "standstill": "m/s", "zero_rate": "rad/s"}
_WATCHED_NS = 90_000_000_000
_MOST = 3


class Widening(NamedTuple):
    """kind: that was shut out for run epochs in a row, over seconds [s]. variance: what to add to each state it measures, in
    the square of the kind's unit."""

    kind: str
    variance: float
    run: int
    seconds: float


def widen(cov: Floats, names: Sequence[str], widenings: Sequence[Widening]) -> Floats:
    """cov (..., n, n) of states with these names, grown by the widenings."""
    added = np.zeros(len(names))
    for widening in widenings:
        measured = [name.startswith(_MEASURES[widening.kind]) for name in names]
        added[measured] = np.maximum(added[measured], widening.variance)
    return np.asarray(cov + np.diag(added))


def tell_widening(recorder: Recorder, t_ns: int, widening: Widening) -> None:
    """Records that a gate was reopened."""
    kind, unit = widening.kind.replace("_", " "), _UNITS.get(widening.kind, "rad")
    recorder.tell(
        t_ns,
        "warning",
        f"{kind}: {widening.run} epochs in a row ({widening.seconds:.0f} s) contradicted the filter; its uncertainty of what "
        f"they measure was raised by {sqrt(widening.variance):.2g} {unit}, and they are used again",
        kind="lock-out",
    )


class LossWatch:
    """Counts how often a gate had to be reopened of late."""

    def __init__(self) -> None:
        self._times: list[int] = []

    def lost(self, t_ns: int, widenings: Sequence[Widening]) -> bool:
        """Whether a filter with these widenings at t_ns has lost its way: the third of a kind within 90 s."""
        if not widenings:
            return False
        self._times = [then for then in self._times if t_ns - then < _WATCHED_NS] + [t_ns]
        return len(self._times) >= _MOST
