"""Aiding by GNSS fixes: loosely coupled."""

from dataclasses import replace

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.error_models.set_up import STILL, FixStates, Moving, SetUpStates
from navreplay.geodesy.earth import move_lla
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.felt import felt_at, moving_at
from navreplay.measurements.fixes import FixNoise, angular_rate, fix_noise, position_measurement, velocity_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions
from navreplay.start.alignment import Alignment
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, Times
from navreplay.update.gaussian import symmetric
from navreplay.update.measurement import Measurement, join

__all__ = ["FixAiding", "start_at_fix"]


class FixAiding:
    """Positions and velocities of the antenna, with their told noise."""

    name = "fixes"

    def __init__(
        self,
        fixes: GnssFixSeries,
        lever_b: Floats,
        options: FilterOptions,
        model: NedErrorModel,
        imu: ImuSeries | None = None,
    ) -> None:
        self.fixes = fixes
        self._inertial = model
        self._states = FixStates(CorrelatedErrors(options.correlated_noise), SetUpStates(options.set_up))
        self.model: ErrorModel = self._inertial
        if self._states.size:
            self.model = ClockedModel(self._inertial, self._states)
        self._felt = felt_at(imu, fixes.t_ns) if imu is not None and options.set_up.names else None
        self._noise = fix_noise(fixes, options)
        scales = options.position_noise_scale, options.velocity_noise_scale
        self._scales = tuple(options.noise_scale * scale for scale in scales)
        self._lever_b = lever_b
        self._has_position = fixes.has_position
        self._has_velocity = fixes.has_velocity & options.use_velocity

    @property
    def told_fixes(self) -> GnssFixSeries:
        """The fixes with their covariances scaled as the options say, for an alignment that weighs them."""
        position, velocity = self._scales
        if position == velocity == 1:
            return self.fixes
        return replace(self.fixes, cov_pos=self.fixes.cov_pos * position**2, cov_vel=self.fixes.cov_vel * velocity**2)

    @property
    def t_ns(self) -> Times:
        """(e,) times of the fixes."""
        return self.fixes.t_ns

    def start(self, alignment: Alignment) -> tuple[NavState, Floats]:
        """State and covariance (n, n) at the alignment's fix."""
        state, cov = start_at_fix(self._inertial, self.fixes, self._noise, alignment, self._lever_b)
        moving = self._moving(alignment.fix, state, self._lever_b)
        return replace(state, clock=np.zeros(self._states.size)), self._states.enter(cov, moving)

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The fix with index epoch, of what it holds."""
        parts = []
        size = self._inertial.size
        lever_b = self._lever_of(state)
        if self._has_position[epoch]:
            lla, noise = self.fixes.lla[epoch], self._noise.position[epoch]
            parts.append(self._differing("position", epoch, position_measurement(state, lever_b, lla, noise, size), state))
        if self._has_velocity[epoch]:
            rate = angular_rate(state, dtheta, dt)
            vel_n, noise = self.fixes.vel_n[epoch], self._noise.velocity[epoch]
            measured = velocity_measurement(state, lever_b, rate, vel_n, noise, size)
            parts.append(self._differing("velocity", epoch, measured, state))
        return Observed(join(parts) if parts else None, state, cov)

    def _lever_of(self, state: NavState) -> Floats:
        """(3,) the lever arm, as the state has it."""
        if self._felt is None:
            return self._lever_b
        return self._lever_b + self._states.set_up.lever(state.clock[self._states.correlated.size :])

    def _moving(self, epoch: int, state: NavState, lever_b: Floats) -> Moving:
        if self._felt is None:
            return STILL
        return moving_at(state, lever_b, self._felt.rate[epoch], self._felt.force[epoch])

    def _differing(self, kind: str, epoch: int, z: Measurement, state: NavState) -> Measurement:
        """Against fixes that have the correlated errors, and receivers the delays, that are states."""
        if not self._states.size:
            return z
        correlated, set_up = self._states.correlated, self._states.set_up
        seen = correlated.jacobian([f"{kind} {label}" for label in z.labels])
        residual, jacobian = z.residual - seen @ state.clock[: correlated.size], [z.jacobian, seen]
        if self._felt is not None:
            moving = self._moving(epoch, state, self._lever_of(state))
            residual = residual - set_up.shift(kind, state.clock[correlated.size :], moving)
            jacobian.append(set_up.jacobian(kind, moving))
        return z._replace(residual=residual, jacobian=np.hstack(jacobian))


def start_at_fix(
    model: NedErrorModel, fixes: GnssFixSeries, noise: FixNoise, start: Alignment, lever_b: Floats
) -> tuple[NavState, Floats]:
    """State and covariance (n, n) of an IMU that is lever_b (3,) [m] before the antenna whose fix it is aligned at."""
    at = start.fix
    lever_n = matrix_from_quat(start.q_nb) @ lever_b
    known = bool(fixes.has_velocity[at])
    velocity = fixes.vel_n[at] if known else start.vel_n
    cov_vel = noise.velocity[at] if known else np.eye(3) * start.vel_std**2
    zero = np.zeros(3)
    state = NavState(move_lla(fixes.lla[at], -lever_n), velocity.copy(), start.q_nb, start.gyro_bias, zero, zero, zero)
    cov = model.initial_covariance(noise.position[at], cov_vel, start.cov_att, start.gyro_bias_std)
    if start.levelled:
        cov = model.tie_tilt_to_accel_bias(cov, start.q_nb)
    return state, symmetric(cov)
