"""An error model and a receiver clock side by side: tightly coupled, as in Ge et al., Sensors 20 (2020) 6041, (1)-(6).

Their 20 states are those of `NedErrorModel` with a Gauss-Markov gyro error, and a clock of one offset and its drift. Motion and
clock are driven by independent noise, so that each part moves by its own transition and only their covariance is shared.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from navreplay.error_models.error_model import ErrorModel, MotionModel
from navreplay.error_models.ned import Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.timeline import Floats

__all__ = ["ClockedModel", "ReceiverModel", "motion_size"]


class ReceiverModel(Protocol):
    """c states of a receiver, which its own noise drives: its clock, or a correlated error of its fixes."""

    @property
    def size(self) -> int:
        """Number of states c."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """(c,) names of the states."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """(c,) units of the states."""
        ...

    def transitions(self, dt: Floats) -> Floats:
        """(k, c, c) over dt (k,) [s]."""
        ...

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        ...


@dataclass(frozen=True, slots=True)
class ClockedModel:
    """The states of motion (n of them) and, behind them, those of the clock (c) or what else the receiver has."""

    motion: MotionModel
    clock: ReceiverModel

    @property
    def size(self) -> int:
        """Number of error states n + c."""
        return self.motion.size + self.clock.size

    @property
    def names(self) -> tuple[str, ...]:
        """(n + c,) names of the error states."""
        return self.motion.names + self.clock.names

    @property
    def units(self) -> tuple[str, ...]:
        """(n + c,) units of the error states."""
        return self.motion.units + self.clock.units

    def retract(self, state: NavState, correction: Floats) -> NavState:
        """The state moved by an estimated error (n + c,), true minus computed."""
        n = self.motion.size
        return replace(self.motion.retract(state, correction[..., :n]), clock=state.clock + correction[..., n:])

    def difference(self, true: NavState, computed: NavState) -> Floats:
        """(n + c,) the error by which `retract` takes computed to true."""
        return np.concatenate([self.motion.difference(true, computed), true.clock - computed.clock])

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n + c, n + c) to the nodes of a leg."""
        n, k = self.motion.size, len(leg.ends)
        moved = self.motion.propagate(state, cov[:n, :n], leg, cov[:n, n:])
        # the clock's transitions act on the other side of the cross-covariance, and so may come last and all at once
        elapsed = leg.elapsed
        phi = self.clock.transitions(elapsed)
        moved.states[:, -self.clock.size :] = phi @ state.clock
        covariances = np.empty((k, self.size, self.size))
        covariances[:, :n, :n] = moved.covariances
        covariances[:, :n, n:] = moved.crosses @ np.swapaxes(phi, 1, 2)
        covariances[:, n:, :n] = np.swapaxes(covariances[:, :n, n:], 1, 2)
        covariances[:, n:, n:] = phi @ cov[n:, n:] @ np.swapaxes(phi, 1, 2) + self.clock.noises(elapsed)
        transitions, noises = moved.transitions, moved.noises
        if leg.keep:
            between = np.diff(elapsed, prepend=0.0)
            transitions = _side_by_side(transitions, self.clock.transitions(between))
            noises = _side_by_side(noises, self.clock.noises(between))
        return Propagated(moved.states, covariances, covariances[:, :, :0], transitions, noises)


def _side_by_side(motion: Floats, clock: Floats) -> Floats:
    """Block-diagonal (k, n + c, n + c) of (k, n, n) and (k, c, c)."""
    n, c = motion.shape[1], clock.shape[1]
    both = np.zeros((len(motion), n + c, n + c))
    both[:, :n, :n], both[:, n:, n:] = motion, clock
    return both


def motion_size(model: ErrorModel) -> int:
    """Number of the states of motion and of the inertial sensors, which come first in model."""
    return model.motion.size if isinstance(model, ClockedModel) else model.size
