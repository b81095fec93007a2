"""Aiding by GNSS fixes: loosely coupled."""

from dataclasses import replace

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.geodesy.earth import move_lla
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.fixes import FixNoise, angular_rate, fix_noise, position_measurement, velocity_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions
from navreplay.start.alignment import Alignment
from navreplay.timeline import Floats, GnssFixSeries, Times
from navreplay.update.gaussian import symmetric
from navreplay.update.measurement import Measurement, join

__all__ = ["FixAiding", "start_at_fix"]


class FixAiding:
    """Positions and velocities of the antenna, with their told noise."""

    name = "fixes"

    def __init__(self, fixes: GnssFixSeries, lever_b: Floats, options: FilterOptions, model: NedErrorModel) -> None:
        self.fixes = fixes
        self._inertial = model
        self._correlated = CorrelatedErrors(options.correlated_noise)
        self.model: ErrorModel = self._inertial
        if self._correlated.size:
            self.model = ClockedModel(self._inertial, self._correlated)
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
        return replace(state, clock=np.zeros(self._correlated.size)), self._correlated.enter(cov)

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The fix with index epoch, of what it holds."""
        parts = []
        size = self._inertial.size
        if self._has_position[epoch]:
            lla, noise = self.fixes.lla[epoch], self._noise.position[epoch]
            parts.append(position_measurement(state, self._lever_b, lla, noise, size))
        if self._has_velocity[epoch]:
            rate = angular_rate(state, dtheta, dt)
            vel_n, noise = self.fixes.vel_n[epoch], self._noise.velocity[epoch]
            parts.append(velocity_measurement(state, self._lever_b, rate, vel_n, noise, size))
        return Observed(self._with_correlated(join(parts), state) if parts else None, state, cov)

    def _with_correlated(self, z: Measurement, state: NavState) -> Measurement:
        """Against fixes that have the correlated errors as well, where those are states."""
        if not self._correlated.size:
            return z
        seen = self._correlated.jacobian([f"{kind} {label}" for kind, label in zip(z.kinds, z.labels, strict=True)])
        return z._replace(residual=z.residual - seen @ state.clock, jacobian=np.hstack([z.jacobian, seen]))


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
