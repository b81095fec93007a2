"""What all motions share: a path that can be evaluated at any time."""

from dataclasses import dataclass
from typing import Protocol

from navreplay.timeline import Floats

__all__ = ["Kinematics", "Path", "Traceable"]


@dataclass(frozen=True, eq=False, slots=True)
class Kinematics:
    """Motion at (n,) times: lla (n, 3) [rad, rad, m], vel_n (n, 3) and its derivative by time accel_n (n, 3) NED [m/s, m/s^2],
    q_nb (n, 4), and the angular rate of the body against NED in body axes turn_b (n, 3) [rad/s]."""

    lla: Floats
    vel_n: Floats
    accel_n: Floats
    q_nb: Floats
    turn_b: Floats


class Path(Protocol):
    """A motion made ready for evaluation."""

    def at(self, t_s: Floats) -> Kinematics:
        """The motion at times t_s (n,) [s] from its start."""
        ...


class Traceable(Protocol):
    """A motion that a scenario can name: a frozen value, by which its path is remembered."""

    def __hash__(self) -> int: ...

    def trace(self, duration: float) -> Path:
        """The motion over duration [s]."""
        ...
