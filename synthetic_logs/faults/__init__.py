"""What goes wrong with logs in the field, done to a synthetic one: told noise, latencies, frozen fixes, lying
velocities, clocks.

Uses simulation; a new fault is a function in the file of its kind and a line in its table `FAULTS`.
"""

from synthetic_logs.faults.clocks import FAULTS as _CLOCKS
from synthetic_logs.faults.fault import Fault, Spoilt
from synthetic_logs.faults.positions import FAULTS as _POSITIONS
from synthetic_logs.faults.velocities import FAULTS as _VELOCITIES

__all__ = ["FAULTS", "Fault", "Spoilt"]

FAULTS: dict[str, Fault] = {fault.name: fault for fault in (*_POSITIONS, *_VELOCITIES, *_CLOCKS)}
"""All faults by name."""
