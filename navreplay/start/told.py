"""Start of a filter whose log tells no position: place and velocity from the configuration or the reference."""

from typing import NamedTuple

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION, NedErrorModel
from navreplay.geodesy import earth, rotation
from navreplay.measurements.attitudes import attitude_nb, attitude_noise
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions
from navreplay.timeline import AttitudeSeries, Floats, ImuSeries, LogError, Timeline, Trajectory

__all__ = ["ToldStart", "start_as_told"]


class ToldStart(NamedTuple):
    """State and covariance (n, n) at t_ns; text says where they came from."""

    t_ns: int
    state: NavState
    cov: Floats
    text: str


def start_as_told(timeline: Timeline, imu: ImuSeries, model: NedErrorModel, options: FilterOptions) -> ToldStart:
    """Start within the span of imu: at its first sample, or at the first attitude where that is measured.

    Position and velocity are those of the configuration, or of the reference with method ``reference``; the attitude is the
    given, the reference's, or the measured one. Raises LogError where one of them is nowhere told.
    """
    alignment = options.alignment
    position_std, velocity_std = np.array(alignment.position_std), np.array(alignment.velocity_std)
    cov_att, attitude = None, timeline.attitude
    if alignment.method == "reference":
        t_ns, lla, vel_n, q_nb = _first_of_reference(timeline.reference, imu)
        text = "started as the reference tells"
    elif alignment.position is None:
        raise LogError(
            "alignment: the log tells no position to start from; set alignment.position_deg_m = [latitude, longitude, height] "
            "and alignment.velocity_mps at the first IMU sample"
        )
    else:
        lla, vel_n = np.array(alignment.position), np.array(alignment.velocity)
        if alignment.given is not None and alignment.method in ("auto", "given"):
            t_ns, q_nb, text = (
                int(imu.t_ns[0]),
                rotation.quat_from_euler(*alignment.given),
                "started as the configuration tells",
            )
        else:
            t_ns, q_nb, cov_att = _first_attitude(attitude, imu, lla, options)
            text = "started at the first measured attitude, at the place that the configuration tells"
    measured = cov_att is not None
    if cov_att is None:
        c_nb = rotation.matrix_from_quat(q_nb)
        cov_att = c_nb @ np.diag(np.square(alignment.given_std)) @ c_nb.T
    cov = model.initial_covariance(np.diag(position_std**2), np.diag(velocity_std**2), cov_att, options.imu_noise.gyro_bias_std)
    if measured and attitude is not None and attitude.frame == "earth":
        cov = _tie_to_position(cov, lla)
    return ToldStart(t_ns, NavState.at(lla, vel_n, q_nb), cov, text)


def _tie_to_position(cov: Floats, lla: Floats) -> Floats:
    """cov (n, n) of an attitude in NED that was measured against the stars, so that it errs with the position of NED."""
    turn = earth.frame_turn_n(lla)
    shared = -turn @ cov[POSITION, POSITION]
    tied = cov.copy()
    tied[ATTITUDE, ATTITUDE] -= shared @ turn.T
    tied[ATTITUDE, POSITION], tied[POSITION, ATTITUDE] = shared, shared.T
    return tied


def _first_of_reference(reference: Trajectory | None, imu: ImuSeries) -> tuple[int, Floats, Floats, Floats]:
    if reference is not None:
        known = np.isfinite(np.hstack([reference.vel_n, reference.q_nb])).all(axis=1)
        rows = np.flatnonzero(known & (reference.t_ns >= imu.t_ns[0]) & (reference.t_ns < imu.t_ns[-1]))
        if len(rows):
            at = int(rows[0])
            return int(reference.t_ns[at]), reference.lla[at], reference.vel_n[at], reference.q_nb[at]
    raise LogError(
        "alignment: method is 'reference', but no reference with velocity and attitude lies within the IMU's time span"
    )


def _first_attitude(
    attitude: AttitudeSeries | None, imu: ImuSeries, lla: Floats, options: FilterOptions
) -> tuple[int, Floats, Floats]:
    """Time, q_nb (4,) and its covariance (3, 3) in NED of the first full attitude within the span of imu."""
    if attitude is not None and not attitude.heading_only:
        rows = np.flatnonzero((attitude.t_ns >= imu.t_ns[0]) & (attitude.t_ns < imu.t_ns[-1]))
        if len(rows):
            row = int(rows[0])
            q_nb, c_nf = attitude_nb(attitude, row, lla)
            cov = c_nf @ attitude_noise(attitude, options.attitude)[row] @ c_nf.T
            return int(attitude.t_ns[row]), q_nb, cov
    raise LogError(
        "alignment: no attitude is told and none with roll, pitch and yaw is measured within the IMU's time span; set "
        "alignment.given_deg = [roll, pitch, yaw]"
    )
