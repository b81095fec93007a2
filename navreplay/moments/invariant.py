"""Left-invariant extended Kalman filter: the error of attitude, velocity and position as an element of SE2(3).

Source: Barrau and Bonnabel, The invariant extended Kalman filter as a stable observer, IEEE Trans. Automatic Control 62 (2017)
1797; The geometry of navigation problems, ibid. 68 (2023) 689.
With body axes attached to the error, X = X^ exp(xi), a position or velocity of GNSS is seen alike at every attitude, however
large the error of that is. To first order xi, in NED axes, is this program's error state, so that prediction and gain are those
of the linearised filter. What differs is the step behind the gain: the correction is applied by the exponential of SE2(3), so
velocity and position are moved by the left Jacobian J of SO(3) at the correction phi of the attitude,
    q <- exp(phi) q,   v <- v + J(phi) dv,   p <- p + J(phi) dp,
and the covariance, which is attached to the body, turns with it by exp(phi). That is left out where the attitude is known to
ten degrees and corrected by less than two.
The right-invariant error, whose exponential turns velocity and position about the origin of the axes, was tried: fixes seen
from far off that origin spoil it (docs/methods/iekf.md).
Assumes: the first nine states are position, velocity and rotation vector in NED.
Fails: where the linearised filter does for other reasons than a large error of attitude.
When well specified: `fixed`, but for terms of second order where the attitude is not known to ten degrees, or corrected by two.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION, VELOCITY
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_rotvec, skew
from navreplay.moments.linearised import Linearised
from navreplay.timeline import Floats
from navreplay.update.gaussian import Gaussian, symmetric

__all__ = ["Invariant", "left_jacobian"]

_KNOWN, _SMALL = np.radians(10.0), np.radians(2.0)
"""Standard deviation of the attitude, all axes together, and its correction, below which terms of second order are nothing."""


@dataclass(frozen=True, slots=True)
class Invariant(Linearised):
    """First order in the left-invariant error."""

    def settle(self, posterior: Gaussian) -> Gaussian:
        """The posterior (n,), (n, n) as `ErrorModel.retract` takes it, about the state that it moves to."""
        phi = posterior.mean[ATTITUDE]
        left = posterior.cov[ATTITUDE, ATTITUDE].trace()
        if (phi @ phi < _SMALL**2 and left < _KNOWN**2) or not phi.any():
            return posterior
        mean, turn = posterior.mean.copy(), np.eye(len(posterior.mean))
        jacobian, rotation = left_jacobian(phi), matrix_from_quat(quat_from_rotvec(phi))
        for block in (POSITION, VELOCITY):
            mean[block] = jacobian @ mean[block]
        for block in (POSITION, VELOCITY, ATTITUDE):
            turn[block, block] = rotation
        return Gaussian(mean, symmetric(turn @ posterior.cov @ turn.T))


def left_jacobian(phi: Floats) -> Floats:
    """(3, 3) left Jacobian of SO(3) at the rotation vector phi (3,) [rad], which is not zero."""
    angle = float(np.linalg.norm(phi))
    cross = skew(phi)
    return np.asarray(np.eye(3) + (1 - np.cos(angle)) / angle**2 * cross + (angle - np.sin(angle)) / angle**3 * cross @ cross)
