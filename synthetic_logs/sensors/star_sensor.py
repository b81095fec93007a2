"""Attitudes of a star sensor: body to Earth-fixed axes, with white noise about the body's axes that may change."""

from dataclasses import dataclass
from math import pi

import numpy as np

from navreplay.geodesy.earth import quat_en
from navreplay.geodesy.rotation import quat_from_rotvec, quat_multiply
from navreplay.timeline import AttitudeSeries, Floats, Times
from synthetic_logs.motion.kinematics import Kinematics
from synthetic_logs.sensors.seeding import generator_for
from synthetic_logs.sensors.windows import ScaledWindow, scale_in

__all__ = ["AttitudeErrors", "StarSensor", "measure_attitudes"]

_ARCSEC = pi / 180 / 3600


@dataclass(frozen=True, slots=True)
class StarSensor:
    """rate [Hz] and offset [s] of the first epoch from the start of the log. std [rad]: of the white noise about each body
    axis, told in the log. noise_windows: (start, end, scale) of it in the data, never told."""

    rate: float = 20.0
    offset: float = 0.05
    std: float = 1 * _ARCSEC
    noise_windows: tuple[ScaledWindow, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class AttitudeErrors:
    """What was drawn for the attitudes of a log, row by row of it. rotation (n, 3): rotation vector in body axes [rad].
    cov (n, 3, 3): true second moments in the axes of the series."""

    rotation: Floats
    cov: Floats


def measure_attitudes(
    t_ns: Times, t_s: Floats, motion: Kinematics, sensor: StarSensor, seed: int
) -> tuple[AttitudeSeries, AttitudeErrors]:
    """The attitudes of a log and their errors, at t_ns (n,), t_s (n,) [s] from its start, along the motion at these times."""
    n = len(t_ns)
    q_eb = quat_multiply(quat_en(motion.lla[:, 0], motion.lla[:, 1]), motion.q_nb)
    std = sensor.std * scale_in(sensor.noise_windows, t_s)
    rotation = std[:, None] * generator_for(seed, "attitude").standard_normal((n, 3))
    measured = quat_multiply(q_eb, quat_from_rotvec(rotation))
    told = np.tile(sensor.std**2 * np.eye(3), (n, 1, 1))
    # equal about all axes, so the same in any axes
    return AttitudeSeries(t_ns, measured, told, "earth"), AttitudeErrors(rotation, std[:, None, None] ** 2 * np.eye(3))
