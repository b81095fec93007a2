"""A fault: what it does to a log, and when."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Times
from synthetic_logs.simulation import SyntheticLog

__all__ = ["Fault", "Spoilt", "seconds"]


@dataclass(frozen=True, eq=False, slots=True)
class Spoilt:
    """A log with a fault. windows: (start, end) in seconds from its first fix in which the fixes are none: a filter is on
    its own there, as in an outage."""

    log: SyntheticLog
    windows: tuple[tuple[float, float], ...] = ()

    def alone(self, t_ns: Times, settle: float = 3.0) -> NDArray[np.bool_]:
        """(n,) whether times lie in a window, or within settle [s] behind one."""
        assert self.log.fixes is not None
        at = seconds(t_ns, int(self.log.fixes.t_ns[0]))
        inside = np.zeros(len(at), dtype=np.bool_)
        for start, end in self.windows:
            inside |= (at >= start) & (at < end + settle)
        return inside


@dataclass(frozen=True, slots=True)
class Fault:
    """name, kind (told noise, latency, frozen, jump, velocity, clock), a line on where it comes from, and what it does to a log
    that has fixes."""

    name: str
    kind: str
    description: str
    spoil: Callable[[SyntheticLog], Spoilt]


def seconds(t_ns: Times, start_ns: int) -> NDArray[np.float64]:
    """Times (n,) in seconds from start_ns."""
    return np.asarray((t_ns - start_ns) / 1e9)
