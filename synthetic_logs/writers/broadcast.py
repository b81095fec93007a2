"""The ephemerides that satellites broadcast during a log."""

from collections.abc import Iterator

from synthetic_logs.ranges.constellation import Orbits, refer_to
from synthetic_logs.ranges.signals import system_of
from synthetic_logs.simulation import Journey

__all__ = ["AHEAD_S", "WEEKS_BEFORE", "issues"]

AHEAD_S = {"G": 0, "E": 0, "C": 14}
"""GPS time less the system's own time [s] (Galileo's weeks count from those of GPS in every format written here)."""
WEEKS_BEFORE = {"G": 0, "E": 0, "C": 1356}
"""Week of GPS at which the system's weeks begin."""
_S = 1_000_000_000
_HOUR_NS = 3600 * _S


def issues(orbits: Orbits, journey: Journey) -> Iterator[tuple[str, Orbits]]:
    """System and its ephemerides for every full hour, in the system's time, from the one before a journey to the one behind."""
    last = -(-(journey.start_ns + int(journey.duration * _S)) // _HOUR_NS)
    for hour in range(journey.start_ns // _HOUR_NS, last + 1):
        for system, ahead_s in AHEAD_S.items():
            of_system = system_of(orbits.sat) == system
            if of_system.any():
                yield system, refer_to(orbits.rows(of_system), hour * _HOUR_NS + ahead_s * _S)
