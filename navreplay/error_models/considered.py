"""An error model with unknown constant biases behind its states: the consider parameters of a Schmidt-Kalman filter.

Source: Schmidt, Application of state-space methods to navigation problems, Advances in Control Systems 3 (1966) 293; Lou et
al., Robust partially strong tracking extended consider Kalman filtering for INS/GNSS integrated navigation, IEEE Access 7
(2019), eqs. (12)-(19): d' = Phi d + Psi p + w, dz = H d + N p + v, with p = (p1 in the dynamics, p2 in the measurements).
The biases neither move nor fade: their transition is I, their covariance P_pp stays, and C = cov(d, p) is carried.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import POSITION, VELOCITY, Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.options import ConsiderOptions
from navreplay.timeline import Floats
from navreplay.update.measurement import Measurement

__all__ = ["ConsideredModel"]

_NAMES = (
    *(f"{group}_{axis}" for group in ("position_rate", "velocity_rate", "position_bias", "velocity_bias") for axis in "ned"),
    "zenith_delay",
)
_UNITS = (*(unit for unit in ("m/s", "m/s^2", "m", "m/s") for _ in range(3)), "m")
_LEAST_SINE = 0.05
"""Of an elevation: below 3 degrees the mapping 1 / sin is not to be followed."""


@dataclass(frozen=True, eq=False, slots=True)
class ConsideredModel:
    """The n states of inner and, behind them, p biases: kept (p,) are their places among all that there are, std (p,) their
    standard deviations in the units of the options."""

    inner: ErrorModel
    kept: np.ndarray
    std: Floats

    @classmethod
    def of(cls, inner: ErrorModel, options: ConsiderOptions) -> "ConsideredModel":
        """inner with the biases that the options name; those whose standard deviation is 0 have no state."""
        groups = options.position_rate, options.velocity_rate, options.position_bias, options.velocity_bias
        std = np.array([*(std for group in groups for std in group), options.zenith_delay])
        kept = np.flatnonzero(std)
        return cls(inner, kept, std[kept])

    @property
    def bias_cov(self) -> Floats:
        """P_pp (p, p)."""
        return np.diag(self.std**2)

    @property
    def size(self) -> int:
        """Number of states n + p."""
        return self.inner.size + len(self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """(n + p,) names of the states."""
        return self.inner.names + tuple(_NAMES[i] for i in self.kept)

    @property
    def units(self) -> tuple[str, ...]:
        """(n + p,) units of the states."""
        return self.inner.units + tuple(_UNITS[i] for i in self.kept)

    def start_covariance(self, cov: Floats) -> Floats:
        """(n + p, n + p) of a start whose position and velocity are measured ones: cov (n, n) is that of their noise, to which
        their biases come, by which they are off to the other side."""
        n = self.inner.size
        full = np.zeros((n, len(_NAMES)))
        full[POSITION, 6:9] = full[VELOCITY, 9:12] = -np.eye(3)
        cross = full[:, self.kept] @ self.bias_cov
        return np.block([[cov + cross @ full[:, self.kept].T, cross], [cross.T, self.bias_cov]])

    def retract(self, state: NavState, correction: Floats) -> NavState:
        """The state moved by an estimated error (n + p,), true minus computed, of which biases get nothing."""
        return self.inner.retract(state, correction[..., : self.inner.size])

    def difference(self, true: NavState, computed: NavState) -> Floats:
        """(n + p,) the error by which `retract` takes computed to true; of the biases, which are not estimated, zero."""
        return np.append(self.inner.difference(true, computed), np.zeros(len(self.kept)))

    def influence(self, measurement: Measurement) -> Floats:
        """N (m, p) of a measurement whose Jacobian (m, n) is that of the inner model (Lou et al., eq. 17)."""
        kinds = measurement.kinds
        at_position = np.array([kind in ("position", "range") for kind in kinds])
        at_velocity = np.array([kind in ("velocity", "range_rate") for kind in kinds])
        full = np.zeros((len(kinds), len(_NAMES)))
        full[at_position, 6:9] = measurement.jacobian[at_position, POSITION]
        full[at_velocity, 9:12] = measurement.jacobian[at_velocity, VELOCITY]
        ranges = np.array([kind == "range" for kind in kinds])
        # a pseudorange falls with height by the sine of the elevation, and down is positive
        full[ranges, 12] = 1 / np.maximum(measurement.jacobian[ranges, 2], _LEAST_SINE)
        return np.asarray(full[:, self.kept])

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n + p, n + p) to the nodes of a leg.

        Lou et al., eqs. (26), (27), from the start to each node: what moves by itself moves as in the inner model, whose
        covariance then gains Phi C Psi' + Psi C' Phi' + Psi P_pp Psi'. Psi is integrated between nodes by the trapezoidal rule.
        """
        n, k = self.inner.size, len(leg.ends)
        moved = self.inner.propagate(state, cov[:n, :n], leg.keeping())
        elapsed = np.diff(leg.elapsed, prepend=0.0)
        transitions = np.tile(np.eye(self.size), (k, 1, 1))
        transitions[:, :n, :n] = moved.transitions
        transitions[:, :n, n:] = elapsed[:, None, None] / 2 * (moved.transitions + np.eye(n)) @ self._rates()
        biases = cov[n:, n:]
        covariances = np.tile(cov, (k, 1, 1))
        carried, driven = cov[:n, n:], np.zeros((n, len(biases)))
        for node, transition in enumerate(transitions):
            phi, psi = transition[:n, :n], transition[:n, n:]
            carried, driven = phi @ carried, phi @ driven + psi
            shared = carried @ driven.T
            covariances[node, :n, :n] = moved.covariances[node] + shared + shared.T + driven @ biases @ driven.T
            covariances[node, :n, n:] = carried + driven @ biases
            covariances[node, n:, :n] = covariances[node, :n, n:].T
        kept = k if leg.keep else 0
        noises = np.zeros((kept, self.size, self.size))
        noises[:, :n, :n] = moved.noises[:kept]
        return Propagated(moved.states, covariances, covariances[:, :, :0], transitions[:kept], noises)

    def _rates(self) -> Floats:
        """(n, p) what the biases add to the derivative of the states."""
        full = np.zeros((self.inner.size, len(_NAMES)))
        full[POSITION, 0:3] = full[VELOCITY, 3:6] = np.eye(3)
        return np.asarray(full[:, self.kept])
