"""Errors of fixes that stay for a while: a first-order Gauss-Markov error per axis, estimated beside the motion.

Bryson and Henrikson, Estimation using sampled data containing sequentially correlated noise, J. Spacecraft and Rockets 5 (1968)
662: measurement noise that is correlated in time becomes white once the part that stays is a state.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from navreplay.error_models.ned import POSITION, VELOCITY
from navreplay.options import CorrelatedNoise
from navreplay.timeline import Floats

__all__ = ["CorrelatedErrors"]

_AXES = ("north", "east", "down")
_STATES = {"position": POSITION, "velocity": VELOCITY}
_UNITS = {"position": "m", "velocity": "m/s"}


@dataclass(frozen=True, slots=True)
class CorrelatedErrors:
    """Three states for each of the noises, NED."""

    noises_told: tuple[CorrelatedNoise, ...]

    @property
    def size(self) -> int:
        """Number of states c."""
        return 3 * len(self.noises_told)

    @property
    def names(self) -> tuple[str, ...]:
        """(c,) names of the states."""
        return tuple(f"fix_{noise.kind}_error_{axis}" for noise in self.noises_told for axis in "ned")

    @property
    def units(self) -> tuple[str, ...]:
        """(c,) units of the states."""
        return tuple(_UNITS[noise.kind] for noise in self.noises_told for _ in range(3))

    def transitions(self, dt: Floats) -> Floats:
        """(k, c, c) over dt (k,) [s]."""
        return np.asarray(np.exp(-dt[:, None] / self._times())[:, :, None] * np.eye(self.size))

    def noises(self, dt: Floats) -> Floats:
        """(k, c, c) covariances of what the noise adds over dt (k,) [s]."""
        grown = -np.expm1(-2 * dt[:, None] / self._times()) * self._variances()
        return np.asarray(grown[:, :, None] * np.eye(self.size))

    def _times(self) -> Floats:
        return np.repeat([noise.time for noise in self.noises_told], 3)

    def _variances(self) -> Floats:
        std = [value for noise in self.noises_told for value in (noise.std[0], noise.std[0], noise.std[1])]
        return np.square(np.array(std))

    def jacobian(self, labels: Sequence[str]) -> Floats:
        """(m, c) of the components with these labels (``position north``)."""
        mine = [f"{noise.kind} {axis}" for noise in self.noises_told for axis in _AXES]
        return np.array([[label == name for name in mine] for label in labels], dtype=np.float64).reshape(
            len(labels), self.size
        )

    def enter(self, cov: Floats) -> Floats:
        """(n + c, n + c) of cov (n, n) where position and velocity were taken from a fix with these errors, of which nothing
        else is known."""
        n = len(cov)
        wider = block_diag(cov, np.diag(self._variances()))
        for i, noise in enumerate(self.noises_told):
            state, own = _STATES[noise.kind], slice(n + 3 * i, n + 3 * i + 3)
            wider[state, state] += wider[own, own]
            wider[state, own] = wider[own, state] = -wider[own, own]
        return np.asarray(wider)
