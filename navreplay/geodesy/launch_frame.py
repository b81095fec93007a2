"""The launch-inertial frame: fixed in space, at the launch point as it was at launch, x downrange, y up, z to the right.

Frame of Si, Wang and Niu (High precision attitude estimation algorithm for SINS/CNS integrated navigation with unknown noise
characteristics), section 3. "Up" is the plumb line of the ellipsoid, so that the Earth's centre lies off the y axis. Positions
are relative to the launch point, velocities to inertial space: at launch the velocity is w_ie x r.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from navreplay.geodesy.earth import EARTH_RATE, ecef_from_lla, lla_from_ecef, matrix_en, quat_en
from navreplay.geodesy.rotation import matrix_from_quat, quat_conjugate, quat_from_matrix, quat_multiply
from navreplay.timeline import Floats

__all__ = ["LaunchFrame", "LaunchState", "cross_earth_rate", "earth_turn"]


class LaunchState(NamedTuple):
    """position (..., 3) [m] and velocity (..., 3) [m/s] in launch axes, q_lb (..., 4) body to launch axes."""

    position: Floats
    velocity: Floats
    q_lb: Floats


@dataclass(frozen=True)
class LaunchFrame:
    """lla: latitude, longitude [rad], height [m] of the launch point. azimuth: of x, clockwise from north [rad]. Times are in
    seconds from launch."""

    lla: tuple[float, float, float]
    azimuth: float

    @cached_property
    def c_il(self) -> Floats:
        """C_il (3, 3): from launch axes to those of the Earth at launch, which stay where they are."""
        sine, cosine = np.sin(self.azimuth), np.cos(self.azimuth)
        c_nl = np.array([[cosine, 0.0, -sine], [sine, 0.0, cosine], [0.0, -1.0, 0.0]])
        return np.asarray(matrix_en(self.lla[0], self.lla[1]) @ c_nl)

    @cached_property
    def origin_i(self) -> Floats:
        """(3,) the launch point from the Earth's centre [m], axes of the Earth at launch."""
        return ecef_from_lla(np.array(self.lla))

    @cached_property
    def _q_li(self) -> Floats:
        return quat_conjugate(quat_from_matrix(self.c_il))

    def c_ln(self, elapsed: Floats, lla: Floats) -> Floats:
        """C_ln (..., 3, 3): from NED at lla (..., 3) at elapsed (...) [s] to launch axes."""
        return matrix_from_quat(self._q_ln(elapsed, lla))

    def from_earth(self, elapsed: Floats, lla: Floats, vel_n: Floats, q_nb: Floats) -> LaunchState:
        """States in this frame of those on the Earth, lla, vel_n (..., 3) and q_nb (..., 4), at elapsed (...) [s]."""
        r_i = earth_turn(elapsed, ecef_from_lla(lla))
        q_ln = self._q_ln(elapsed, lla)
        velocity = _turn(matrix_from_quat(q_ln), vel_n) + cross_earth_rate(r_i) @ self.c_il
        return LaunchState((r_i - self.origin_i) @ self.c_il, velocity, quat_multiply(q_ln, q_nb))

    def to_earth(self, elapsed: Floats, state: LaunchState) -> tuple[Floats, Floats, Floats]:
        """lla, vel_n (..., 3) and q_nb (..., 4) of states in this frame at elapsed (...) [s]: the inverse of `from_earth`."""
        r_i = state.position @ self.c_il.T + self.origin_i
        lla = lla_from_ecef(earth_turn(-np.asarray(elapsed), r_i))
        q_nl = quat_conjugate(self._q_ln(elapsed, lla))
        vel_n = _turn(matrix_from_quat(q_nl), state.velocity - cross_earth_rate(r_i) @ self.c_il)
        return lla, vel_n, quat_multiply(q_nl, state.q_lb)

    def _q_ln(self, elapsed: Floats, lla: Floats) -> Floats:
        """The Earth's turn only adds to the longitude."""
        longitude = lla[..., 1] + EARTH_RATE * np.asarray(elapsed)
        return quat_multiply(self._q_li, quat_en(lla[..., 0], longitude))


def earth_turn(elapsed: Floats, vector_e: Floats) -> Floats:
    """Earth-fixed vectors (..., 3) of a time elapsed (...) [s], in the axes that the Earth had at its beginning."""
    angle = EARTH_RATE * np.asarray(elapsed)
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y, z = vector_e[..., 0], vector_e[..., 1], vector_e[..., 2]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z + 0 * angle], axis=-1)


def cross_earth_rate(vector_e: Floats) -> Floats:
    """w_ie x vector_e (..., 3), Earth-fixed axes."""
    return EARTH_RATE * np.stack([-vector_e[..., 1], vector_e[..., 0], np.zeros_like(vector_e[..., 2])], axis=-1)


def _turn(matrix: Floats, vector: Floats) -> Floats:
    return np.einsum("...ij,...j->...i", matrix, vector)
