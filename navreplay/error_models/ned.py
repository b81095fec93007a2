"""Error state in NED: 15 elements, with scale factors 6 more, with a Gauss-Markov gyro error 3 more.

Layout, noise, initial covariance, retraction and propagation. The equations themselves are in
`navreplay.mechanisation._ned_kernel`, which also states the sign of each element.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from navreplay.geodesy import earth, rotation
from navreplay.mechanisation import _ned_kernel
from navreplay.mechanisation._kernel_arrays import Driving
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.options import ImuNoise
from navreplay.timeline import Floats

__all__ = ["ACCEL_BIAS", "ATTITUDE", "GYRO_BIAS", "POSITION", "VELOCITY", "NedErrorModel", "Propagated", "gyro_columns"]

POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
ATTITUDE = slice(6, 9)
GYRO_BIAS = slice(9, 12)
ACCEL_BIAS = slice(12, 15)

_GRAVITY = 9.81
_NAMES = (
    *("position_n", "position_e", "position_d", "velocity_n", "velocity_e", "velocity_d"),
    *("attitude_n", "attitude_e", "attitude_d", "gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
    *("accel_bias_x", "accel_bias_y", "accel_bias_z"),
)
_SCALE_NAMES = ("gyro_scale_x", "gyro_scale_y", "gyro_scale_z", "accel_scale_x", "accel_scale_y", "accel_scale_z")
_MARKOV_NAMES = ("gyro_markov_x", "gyro_markov_y", "gyro_markov_z")
_UNITS = tuple(unit for unit in ("m", "m/s", "rad", "rad/s", "m/s^2") for _ in range(3))


class Propagated(NamedTuple):
    """States (k, w), covariances (k, n, n) and crosses (k, n, c) at k nodes; transitions and noises (k, n, n) from the node
    before to each, or without rows where they were not asked for."""

    states: Floats
    covariances: Floats
    crosses: Floats
    transitions: Floats
    noises: Floats

    @classmethod
    def allocate(cls, k: int, width: int, cross: Floats, keep: bool) -> "Propagated":
        """Room for k nodes, states of that width and covariances with others like cross (n, c)."""
        n = len(cross)
        kept = k if keep else 0
        rows = np.empty((k, width)), np.empty((k, n, n)), np.empty((k, *cross.shape))
        return cls(*rows, np.empty((kept, n, n)), np.empty((kept, n, n)))


def gyro_columns(size: int) -> tuple[slice, ...]:
    """The states that add to the angular rate, of a `NedErrorModel` with size error states, not of one around it."""
    return (GYRO_BIAS, slice(size - 3, size)) if size in (18, 24) else (GYRO_BIAS,)


@dataclass(frozen=True, slots=True)
class NedErrorModel:
    """The error model for one IMU noise description."""

    noise: ImuNoise

    @property
    def has_scale(self) -> bool:
        """Whether scale factors are estimated."""
        return self.noise.gyro_scale_std > 0 or self.noise.accel_scale_std > 0

    @property
    def has_markov(self) -> bool:
        """Whether a Gauss-Markov gyro error is estimated beside the bias."""
        return self.noise.gyro_markov_std > 0

    @property
    def size(self) -> int:
        """Number of error states n."""
        return 15 + 6 * self.has_scale + 3 * self.has_markov

    @property
    def names(self) -> tuple[str, ...]:
        """(n,) names of the error states."""
        return _NAMES + _SCALE_NAMES * self.has_scale + _MARKOV_NAMES * self.has_markov

    @property
    def units(self) -> tuple[str, ...]:
        """(n,) units of the error states."""
        return _UNITS + ("1",) * 6 * self.has_scale + ("rad/s",) * 3 * self.has_markov

    def _gather(self, base: list[float], scale: list[float], markov: float) -> Floats:
        """Figures per axis of the states that exist, each repeated for three axes."""
        return np.repeat(base + scale * self.has_scale + [markov] * self.has_markov, 3)

    def density(self) -> Floats:
        """(n,) densities of the driving white noise, in state units squared per second."""
        noise = self.noise
        base = [0.0, noise.accel_noise, noise.gyro_noise, noise.gyro_bias_walk, noise.accel_bias_walk]
        # a stationary Gauss-Markov error is driven by 2 sigma^2 / tau
        return np.square(self._gather(base, [0.0, 0.0], noise.gyro_markov_std * np.sqrt(2 / noise.gyro_markov_tau)))

    def correlation_time(self) -> Floats:
        """(n - 9,) correlation times of the sensor errors [s]."""
        noise = self.noise
        return self._gather([noise.gyro_bias_tau, noise.accel_bias_tau], [np.inf, np.inf], noise.gyro_markov_tau)

    def initial_covariance(self, cov_pos: Floats, cov_vel: Floats, cov_att: Floats, gyro_bias_std: float) -> Floats:
        """(n, n) from covariances (3, 3) of position [m^2], velocity [m^2/s^2] and attitude [rad^2] and the standard deviation
        of the gyro bias [rad/s]; the other sensor errors as the noise description has them."""
        cov = np.zeros((self.size, self.size))
        cov[POSITION, POSITION] = cov_pos
        cov[VELOCITY, VELOCITY] = cov_vel
        cov[ATTITUDE, ATTITUDE] = cov_att
        noise = self.noise
        scale = [noise.gyro_scale_std, noise.accel_scale_std]
        sensor = self._gather([gyro_bias_std, noise.accel_bias_std], scale, noise.gyro_markov_std)
        cov[range(9, self.size), range(9, self.size)] = np.square(sensor)
        return cov

    def tie_tilt_to_accel_bias(self, cov: Floats, q_nb: Floats) -> Floats:
        """cov (n, n) of a state levelled by its accelerometers at attitude q_nb (4,): their biases b tilt it by
        phi = [(C b)_E, -(C b)_N, 0] / g, which is then no error that is independent of b."""
        tilt = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) / _GRAVITY @ rotation.matrix_from_quat(q_nb)
        shared = tilt @ cov[ACCEL_BIAS, ACCEL_BIAS]
        tied = cov.copy()
        tied[ATTITUDE, ATTITUDE] += shared @ tilt.T
        tied[ATTITUDE, ACCEL_BIAS] = shared
        tied[ACCEL_BIAS, ATTITUDE] = shared.T
        return tied

    def retract(self, state: NavState, correction: Floats) -> NavState:
        """The state moved by an estimated error (n,), true minus computed; or k states by errors (k, n)."""
        scales = correction[..., 15:21] if self.has_scale else np.zeros(6)
        markov = correction[..., self.size - 3 : self.size] if self.has_markov else np.zeros(3)
        turn = rotation.quat_from_rotvec(correction[..., ATTITUDE])
        q_nb = rotation.quat_multiply(turn, state.q_nb)
        return NavState(
            earth.move_lla(state.lla, correction[..., POSITION]),
            state.vel_n + correction[..., VELOCITY],
            q_nb / np.linalg.norm(q_nb, axis=-1, keepdims=True),
            state.gyro_bias + correction[..., GYRO_BIAS],
            state.accel_bias + correction[..., ACCEL_BIAS],
            state.gyro_scale + scales[..., :3],
            state.accel_scale + scales[..., 3:],
            state.gyro_markov + markov,
            np.zeros_like(state.vel_n),
            state.clock,
        )

    def difference(self, true: NavState, computed: NavState) -> Floats:
        """(n,) the error by which `retract` takes computed to true."""
        turn = rotation.quat_multiply(true.q_nb, rotation.quat_conjugate(computed.q_nb))
        motion = [earth.offset_between(computed.lla, true.lla), true.vel_n - computed.vel_n, rotation.rotvec_from_quat(turn)]
        sensors = [true.gyro_bias - computed.gyro_bias, true.accel_bias - computed.accel_bias]
        if self.has_scale:
            sensors += [true.gyro_scale - computed.gyro_scale, true.accel_scale - computed.accel_scale]
        if self.has_markov:
            sensors.append(true.gyro_markov - computed.gyro_markov)
        return np.concatenate(motion + sensors)

    def propagate(self, state: NavState, cov: Floats, leg: Leg, cross: Floats | None = None) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg; cross (n, c): covariance with other states, as if these did not
        move.
        """
        cross = np.empty((self.size, 0)) if cross is None else cross
        packed = state.pack()
        out = Propagated.allocate(len(leg.ends), len(packed), cross, leg.keep)
        _ned_kernel.propagate(packed, cov, cross, leg.rows, leg.counts, _driving_noise(self), leg.interval, out)
        return out


@cache
def _driving_noise(model: NedErrorModel) -> Driving:
    """Densities and correlation times, which every epoch asks for."""
    return Driving(model.density(), model.correlation_time())
