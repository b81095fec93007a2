"""The clock of a receiver: white frequency noise and random-walk frequency, in metres of range."""

from dataclasses import dataclass

import numpy as np

from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import Floats
from synthetic_logs.sensors.seeding import generator_for

__all__ = ["ClockCourse", "ReceiverClock", "draw_clock"]

_MILLISECOND = SPEED_OF_LIGHT / 1000


@dataclass(frozen=True, slots=True)
class ReceiverClock:
    """Two-state clock (R. G. Brown, P. Y. C. Hwang, Introduction to Random Signals and Applied Kalman Filtering, on GPS).

    offset [m], drift [m/s]: at the first epoch. frequency_noise [m/sqrt(s)] drives the offset, frequency_walk [m/s/sqrt(s)] the
    drift; the defaults are those of a fair TCXO. resets: the receiver keeps its offset within half a millisecond by jumps of a
    whole one.
    """

    offset: float = 3000.0
    drift: float = 30.0
    frequency_noise: float = 0.1
    frequency_walk: float = 0.2
    resets: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class ClockCourse:
    """offset [m], drift [m/s]: (n,) at the epochs; the receiver's stamps are ahead of GPS time by offset / c."""

    offset: Floats
    drift: Floats


def draw_clock(clock: ReceiverClock, n: int, interval: float, seed: int) -> ClockCourse:
    """The clock at n epochs, interval [s] apart, exactly discretised."""
    walk, noise = clock.frequency_walk, clock.frequency_noise
    u1, u2, u3 = generator_for(seed, "receiver clock").standard_normal((3, n - 1))
    steps = walk * np.sqrt(interval) * u1
    drift = clock.drift + np.concatenate([[0.0], np.cumsum(steps)])
    # given the step of the drift, the walk within an interval moves the offset by half of it and an independent rest
    moves = interval * (drift[:-1] + steps / 2) + walk * np.sqrt(interval**3 / 12) * u2 + noise * np.sqrt(interval) * u3
    offset = clock.offset + np.concatenate([[0.0], np.cumsum(moves)])
    if clock.resets:
        offset -= _MILLISECOND * np.rint(offset / _MILLISECOND)
    return ClockCourse(offset, drift)
