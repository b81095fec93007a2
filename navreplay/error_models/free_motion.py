"""Motion of a receiver without IMU: velocity, or acceleration, constant but for white noise.

Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), 6.2. The local axes are taken as
fixed over a step. Attitude is not estimated: yaw is the course while there is one, roll and pitch are zero, and their
covariance says how little that means.
"""

from dataclasses import dataclass, replace

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION, VELOCITY, Propagated
from navreplay.geodesy import earth, rotation
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.options import MotionOptions
from navreplay.timeline import Floats

__all__ = ["FreeMotionModel"]

ACCELERATION = slice(9, 12)
_LEAST_SPEED = 0.5
_TILT_STD = np.radians(10.0)
_LEAST_YAW_STD = np.radians(5.0)
_UNKNOWN_YAW_STD = np.pi / np.sqrt(3)
_NAMES = tuple(f"{name}_{axis}" for name in ("position", "velocity", "attitude", "acceleration") for axis in "ned")
_UNITS = tuple(unit for unit in ("m", "m/s", "rad", "m/s^2") for _ in range(3))


@dataclass(frozen=True, slots=True)
class FreeMotionModel:
    """The model with 9 states or, where acceleration is one, 12."""

    options: MotionOptions

    @property
    def size(self) -> int:
        """Number of error states n."""
        return 12 if self.options.model == "acceleration" else 9

    @property
    def names(self) -> tuple[str, ...]:
        """(n,) names of the error states."""
        return _NAMES[: self.size]

    @property
    def units(self) -> tuple[str, ...]:
        """(n,) units of the error states."""
        return _UNITS[: self.size]

    def start(self, lla: Floats, vel_n: Floats, cov_pos: Floats, cov_vel: Floats) -> tuple[NavState, Floats]:
        """State and covariance (n, n) from position and velocity (3,) with covariances (3, 3); acceleration zero within its
        densities over a second."""
        state = self._face_course(NavState.at(lla, vel_n, np.array([1.0, 0.0, 0.0, 0.0])))
        cov = np.zeros((self.size, self.size))
        cov[POSITION, POSITION], cov[VELOCITY, VELOCITY] = cov_pos, cov_vel
        if self.size > 9:
            cov[ACCELERATION, ACCELERATION] = np.diag(self._density())
        self._doubt_attitude(state, cov)
        return state, cov

    def retract(self, state: NavState, correction: Floats) -> NavState:
        """The state moved by an estimated error (n,), true minus computed."""
        acceleration = state.acceleration + correction[..., ACCELERATION] if self.size > 9 else state.acceleration
        moved = replace(
            state,
            lla=earth.move_lla(state.lla, correction[..., POSITION]),
            vel_n=state.vel_n + correction[..., VELOCITY],
            acceleration=acceleration,
        )
        return self._face_course(moved)

    def difference(self, true: NavState, computed: NavState) -> Floats:
        """(n,) the error by which `retract` takes computed to true; attitude, which follows the course, does not count."""
        parts = [earth.offset_between(computed.lla, true.lla), true.vel_n - computed.vel_n, np.zeros(3)]
        if self.size > 9:
            parts.append(true.acceleration - computed.acceleration)
        return np.concatenate(parts)

    def propagate(self, state: NavState, cov: Floats, leg: Leg, cross: Floats | None = None) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg.

        Only the times of the steps are used, and the transition is exact over any interval. cross (n, c): covariance with
        other states, as if they did not move.
        """
        cross = np.empty((self.size, 0)) if cross is None else cross
        out = Propagated.allocate(len(leg.ends), len(state.pack()), cross, leg.keep)
        for i, dt in enumerate(np.diff(leg.elapsed, prepend=0.0).tolist()):
            phi, q = self._transition(dt), self._noise(dt)
            way = state.vel_n * dt + state.acceleration * dt**2 / 2
            moved = replace(state, lla=earth.move_lla(state.lla, way), vel_n=state.vel_n + state.acceleration * dt)
            state = self._face_course(moved)
            cov, cross = phi @ cov @ phi.T + q, phi @ cross
            self._doubt_attitude(state, cov)
            out.states[i], out.covariances[i], out.crosses[i] = state.pack(), cov, cross
            if leg.keep:
                out.transitions[i], out.noises[i] = phi, q
        return out

    def _density(self) -> Floats:
        return np.square([self.options.horizontal, self.options.horizontal, self.options.vertical])

    def _transition(self, dt: float) -> Floats:
        phi = np.eye(self.size)
        phi[POSITION, VELOCITY] = np.eye(3) * dt
        if self.size > 9:
            phi[POSITION, ACCELERATION] = np.eye(3) * dt**2 / 2
            phi[VELOCITY, ACCELERATION] = np.eye(3) * dt
        return phi

    def _noise(self, dt: float) -> Floats:
        """White noise integrated: element (i, j) of the chain is dt^(a + b + 1) / (a! b! (a + b + 1)), with a and b
        integrations behind the noise."""
        chain = (POSITION, VELOCITY, ACCELERATION) if self.size > 9 else (POSITION, VELOCITY)
        factorial = (1.0, 1.0, 2.0)
        q = np.zeros((self.size, self.size))
        density = np.diag(self._density())
        for i, rows in enumerate(chain):
            for j, columns in enumerate(chain):
                a, b = len(chain) - 1 - i, len(chain) - 1 - j
                q[rows, columns] = density * dt ** (a + b + 1) / (factorial[a] * factorial[b] * (a + b + 1))
        return q

    def _face_course(self, state: NavState) -> NavState:
        """Yaw from the course; kept where the vehicle hardly moves."""
        north, east = state.vel_n[..., 0], state.vel_n[..., 1]
        level = np.zeros_like(north)
        faced = rotation.quat_from_euler(level, level, np.arctan2(east, north))
        return replace(state, q_nb=np.where((np.hypot(north, east) < _LEAST_SPEED)[..., None], state.q_nb, faced))

    def _doubt_attitude(self, state: NavState, cov: Floats) -> None:
        """Sets the covariance of the attitude in cov (n, n)."""
        speed = max(float(np.hypot(state.vel_n[0], state.vel_n[1])), 1e-9)
        across = float(np.sqrt((cov[3, 3] + cov[4, 4]) / 2)) / speed
        yaw_std = min(max(across, _LEAST_YAW_STD), _UNKNOWN_YAW_STD) if speed >= _LEAST_SPEED else _UNKNOWN_YAW_STD
        cov[ATTITUDE, ATTITUDE] = np.diag([_TILT_STD**2, _TILT_STD**2, yaw_std**2])
