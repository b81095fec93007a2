"""What a filter returns: states with covariances at every output epoch, innovations, noise used and events."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats, Times

__all__ = ["Event", "InnovationSeries", "Outage", "OutageCause", "RowStatus", "Solution", "WeightSeries"]

OutageCause = Literal["simulated", "no fixes", "fixes rejected"]
"""The configuration withheld the fixes, the log has none, or the filter refused them."""


class RowStatus(IntEnum):
    """What made a row of a solution."""

    PREDICTED = 0
    UPDATED = 1
    REJECTED = 2
    SMOOTHED = 3


@dataclass(frozen=True, eq=False, slots=True)
class InnovationSeries:
    """All innovations of one measurement kind (measured minus predicted), in the order of time.

    kind: ``position``, ``velocity``, ``heading``, ... labels: one per component, e.g. ``north``. unit: of the residuals.
    t_ns: (k,). residual: (k, m). std: (k, m) square root of the diagonal of S. noise_std: (k, m) square root of the
    diagonal of the R that was used, nominal_std: (k, m) of the R that was told. nis: (k,) residual' S^-1 residual with the R
    that was used. used: (k,) bool. reason: k phrases, empty where used. step: (k, m) the residual less what the epoch before
    was left off by: what the measurement changed by beside the inertial motion; NaN where there is none before.
    """

    kind: str
    labels: tuple[str, ...]
    unit: str
    t_ns: Times
    residual: Floats
    std: Floats
    noise_std: Floats
    nominal_std: Floats
    nis: Floats
    used: NDArray[np.bool_]
    reason: tuple[str, ...]
    sources: tuple[str, ...] = ()
    step: Floats | None = None


@dataclass(frozen=True, eq=False, slots=True)
class WeightSeries:
    """Weights of a bank's hypotheses after its measurement epochs. t_ns: (k,). labels: one per hypothesis. values: (k, M), of
    which each row sums to one."""

    t_ns: Times
    labels: tuple[str, ...]
    values: Floats


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth telling at a time: alignment, gap, run of rejections, reset. level: ``info`` or ``warning``. kind:
    ``restart`` or ``lock-out`` where those are to be counted, else empty."""

    t_ns: int
    level: str
    text: str
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Outage:
    """A stretch without a used position."""

    start_ns: int
    end_ns: int
    cause: OutageCause


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """States of the IMU at output epochs, with the covariance of the error state.

    t_ns: (k,). lla: (k, 3) [rad, rad, m]. vel_n: (k, 3) NED [m/s]. q_nb: (k, 4). gyro_bias: (k, 3) [rad/s].
    accel_bias: (k, 3) [m/s^2]. cov: (k, n, n) of the error state in the order of state_names; the first nine are position
    NED [m], velocity NED [m/s] and rotation vector in n [rad] (true attitude = exp(phi x) computed attitude).
    status: (k,) int8 of RowStatus. method: name of the preset. estimated: figures of the noise that a method found in the whole
    log and filtered with, by their names in `FilterOptions` and what it holds; empty for other methods. weights: of a bank.
    beside: (k, c) states behind those of the motion, by which a receiver or the set-up differs; the last of state_names before
    any that are only considered.
    backward: of a smoothed solution, the median normalised square of the horizontal difference between forward and smoothed
    positions over its expected value; else None.
    """

    t_ns: Times
    lla: Floats
    vel_n: Floats
    q_nb: Floats
    gyro_bias: Floats
    accel_bias: Floats
    cov: Floats
    status: NDArray[np.int8]
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    method: str
    innovations: tuple[InnovationSeries, ...] = ()
    events: tuple[Event, ...] = ()
    outages: tuple[Outage, ...] = ()
    estimated: Mapping[str, float | tuple[float, float]] = field(default_factory=dict)
    weights: WeightSeries | None = None
    backward: float | None = None
    beside: Floats = field(default_factory=lambda: np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def std(self) -> Floats:
        """(k, n) standard deviation of each error state."""
        return np.sqrt(np.diagonal(self.cov, axis1=1, axis2=2))
