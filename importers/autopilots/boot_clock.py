"""A clock that counts from power-on, tied to GPS time by the fixes that tell both.

A fix is stamped by the autopilot when it has arrived, so what its GPS time is ahead of its stamp is short by the delay. A
straight line through all of them follows the clock's rate; raised to the largest, it goes through those of the smallest delay.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.timeline import LogError, Times

__all__ = ["BootClock", "tie_clock"]

_MOST = 0.98
_LARGEST_RATE = 1e-3


@dataclass(frozen=True, slots=True)
class BootClock:
    """GPS time is boot time + ahead_ns + rate (boot time - zero_ns)."""

    zero_ns: int
    ahead_ns: int
    rate: float

    def gps_ns(self, boot_ns: Times) -> Times:
        """GPS time (n,) of times since power-on (n,) [ns]."""
        boot_ns = np.asarray(boot_ns, dtype=np.int64)
        return boot_ns + self.ahead_ns + np.rint(self.rate * (boot_ns - self.zero_ns)).astype(np.int64)


def tie_clock(path: str, boot_ns: Times, gps_ns: Times) -> BootClock:
    """The clock by which stamps boot_ns (n,) of fixes show their GPS times gps_ns (n,). Raises LogError without any."""
    if len(boot_ns) == 0:
        raise LogError(
            f"{path}: no fix of the log tells the date, so its clock, which counts from power-on, cannot be set; was there one?"
        )
    ahead = gps_ns - boot_ns
    zero, base = int(boot_ns[0]), int(np.median(ahead))
    late, since = (ahead - base).astype(np.float64), (boot_ns - zero).astype(np.float64)
    usable = np.abs(late) < 1e9
    spread = np.ptp(since[usable]) if usable.any() else 0.0
    rate = float(np.polyfit(since[usable], late[usable], 1)[0]) if spread > 10e9 else 0.0
    rate = float(np.clip(rate, -_LARGEST_RATE, _LARGEST_RATE))
    top = float(np.quantile((late - rate * since)[usable], _MOST)) if usable.any() else 0.0
    return BootClock(zero, base + round(top), rate)
