"""The set-up of the sensors as states: lever arm of the antenna, delays of positions and velocities.

Constants that nobody told, estimated beside the motion (Groves (2013), 14.3.3; Skog and Händel, Time synchronization errors
in loosely coupled GPS-aided inertial navigation systems, IEEE Trans. Intelligent Transportation Systems 12 (2011) 1014). A
state is what the parameter differs by from what the timeline holds, with l the lever arm in body axes, d_p and d_v the delays:
    fix = p + C l - d_p v,    velocity = v + C (w x l) - d_v a.
A delay is positive where the receiver's stamp is later than the motion it tells.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.error_models.ned import POSITION, VELOCITY
from navreplay.options import SetUpOptions
from navreplay.timeline import Floats

__all__ = ["LEVER", "PARAMETERS", "STILL", "FixStates", "Moving", "SetUpStates"]

LEVER = ("lever_x", "lever_y", "lever_z")
PARAMETERS = {**dict.fromkeys(LEVER, "m"), "fix_delay": "s", "velocity_delay": "s"}
"""Names and units of the parameters there are."""


class Moving(NamedTuple):
    """How an antenna moves: c_nb (3, 3) of the body, its rate rate_b (3,) [rad/s], velocity (3,) [m/s] and acceleration (3,)
    [m/s^2] NED."""

    c_nb: Floats
    rate_b: Floats
    vel_n: Floats
    acceleration_n: Floats


STILL = Moving(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))
"""At rest, pointing north."""


@dataclass(frozen=True, slots=True)
class SetUpStates:
    """A constant for each parameter named."""

    told: SetUpOptions

    @property
    def size(self) -> int:
        """Number of states p."""
        return len(self.told.names)

    @property
    def cov(self) -> Floats:
        """(p, p) of the states before anything is measured."""
        return np.array(self.told.cov).reshape(self.size, self.size)

    def lever(self, values: Floats) -> Floats:
        """(3,) what the values (p,) say of the lever arm [m]."""
        return np.array([self._value(name, values) for name in LEVER])

    def _value(self, name: str, values: Floats) -> float:
        return float(values[self.told.names.index(name)]) if name in self.told.names else 0.0

    def shift(self, kind: str, values: Floats, moving: Moving) -> Floats:
        """(3,) by which the delay of a kind, position or velocity, moves what is measured, to second order."""
        if kind == "position":
            delay = self._value("fix_delay", values)
            return np.asarray(-delay * moving.vel_n + delay**2 / 2 * moving.acceleration_n)
        return np.asarray(-self._value("velocity_delay", values) * moving.acceleration_n)

    def jacobian(self, kind: str, moving: Moving) -> Floats:
        """(3, p) of what is measured of a kind, position or velocity."""
        x, y, z = moving.rate_b
        turning = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        still = np.zeros(3)
        arm = moving.c_nb if kind == "position" else moving.c_nb @ turning
        delayed = {
            "fix_delay": -moving.vel_n if kind == "position" else still,
            "velocity_delay": still if kind == "position" else -moving.acceleration_n,
        }
        columns = {**dict(zip(LEVER, arm.T, strict=True)), **delayed}
        return np.array([columns[name] for name in self.told.names]).reshape(self.size, 3).T


@dataclass(frozen=True, slots=True)
class FixStates:
    """Errors of fixes that stay and, behind them, the set-up: what the receiver has beside the motion."""

    correlated: CorrelatedErrors
    set_up: SetUpStates

    @property
    def size(self) -> int:
        """Number of states c."""
        return self.correlated.size + self.set_up.size

    @property
    def names(self) -> tuple[str, ...]:
        """(c,) names of the states."""
        return self.correlated.names + self.set_up.told.names

    @property
    def units(self) -> tuple[str, ...]:
        """(c,) units of the states."""
        return self.correlated.units + tuple(PARAMETERS[name] for name in self.set_up.told.names)

    def transitions(self, dt: Floats) -> Floats:
        """(k, c, c) over dt (k,) [s]."""
        phi = np.tile(np.eye(self.size), (len(dt), 1, 1))
        c = self.correlated.size
        if c:
            phi[:, :c, :c] = self.correlated.transitions(dt)
        return phi

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        noise = np.zeros((len(dt), self.size, self.size))
        c = self.correlated.size
        if c:
            noise[:, :c, :c] = self.correlated.noises(dt)
        return noise

    def enter(self, cov: Floats, moving: Moving) -> Floats:
        """(n + c, n + c) of cov (n, n) where position and velocity were taken from a fix: off by what these are off by."""
        cov = self.correlated.enter(cov) if self.correlated.size else cov
        if not self.set_up.size:
            return cov
        mixed = np.zeros((len(cov), self.set_up.size))
        mixed[POSITION] = -self.set_up.jacobian("position", moving)
        mixed[VELOCITY] = -self.set_up.jacobian("velocity", moving)
        own = self.set_up.cov
        wider = np.asarray(block_diag(cov + mixed @ own @ mixed.T, own))
        wider[: len(cov), len(cov) :] = mixed @ own
        wider[len(cov) :, : len(cov)] = wider[: len(cov), len(cov) :].T
        return wider
