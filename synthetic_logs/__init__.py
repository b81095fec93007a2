"""Synthetic logs with a known truth: motion, IMU, fixes or raw ranges, scenarios by name, writers.

log = simulate(SCENARIOS["car-city"], seed=1)
write(log, "city.mcap")
"""

from synthetic_logs.motion.manoeuvres import Motion
from synthetic_logs.ranges.receiver import Receiver
from synthetic_logs.ranges.receiver_clock import ReceiverClock
from synthetic_logs.ranges.surroundings import Surroundings
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.sensors.gnss import GnssErrors
from synthetic_logs.sensors.imu_errors import ImuErrors
from synthetic_logs.simulation import Journey, Scenario, SyntheticLog, ideal_imu, simulate, truth_at, with_duration
from synthetic_logs.writers import FORMATS, write

__all__ = [
    "FORMATS",
    "SCENARIOS",
    "GnssErrors",
    "ImuErrors",
    "Journey",
    "Motion",
    "Receiver",
    "ReceiverClock",
    "Scenario",
    "Surroundings",
    "SyntheticLog",
    "ideal_imu",
    "simulate",
    "truth_at",
    "with_duration",
    "write",
]
