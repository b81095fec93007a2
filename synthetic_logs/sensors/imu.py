"""The exact inverse of the mechanisation: what an ideal IMU senses along a path.

Angular rate of the body against inertial space and specific force, in the body frame, from the analytic derivatives of
attitude and velocity (P. D. Groves, Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 2nd ed.,
section 5.4 solved for the sensors).
"""

import numpy as np

from navreplay.geodesy.earth import earth_rate_n, gravity_n, transport_rate_n
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.timeline import Floats
from synthetic_logs.motion.kinematics import Path

__all__ = ["sense", "sense_means"]

_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(3)[0] + 1) / 2, np.polynomial.legendre.leggauss(3)[1] / 2


def sense(path: Path, t_s: Floats) -> tuple[Floats, Floats]:
    """Angular rate (n, 3) [rad/s] and specific force (n, 3) [m/s^2], body axes, at times t_s (n,) [s]."""
    motion = path.at(t_s)
    earth_n = earth_rate_n(motion.lla[:, 0])
    transport_n = transport_rate_n(motion.lla, motion.vel_n)
    coriolis_n = np.cross(2 * earth_n + transport_n, motion.vel_n)
    force_n = motion.accel_n + coriolis_n - gravity_n(motion.lla[:, 0], motion.lla[:, 2])
    c_nb = matrix_from_quat(motion.q_nb)
    gyro = motion.turn_b + np.einsum("kji,kj->ki", c_nb, earth_n + transport_n)
    return gyro, np.einsum("kji,kj->ki", c_nb, force_n)


def sense_means(path: Path, starts_s: Floats, ends_s: Floats) -> tuple[Floats, Floats]:
    """Means of `sense` over the intervals from starts_s (n,) to ends_s (n,) [s]: what an integrating IMU puts out.

    Gauss-Legendre quadrature with three nodes; its error is far below any quantisation for intervals up to 0.1 s.
    """
    gyro, accel = np.zeros((len(ends_s), 3)), np.zeros((len(ends_s), 3))
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        rate, force = sense(path, starts_s + node * (ends_s - starts_s))
        gyro += weight * rate
        accel += weight * force
    return gyro, accel
