"""The 15-state error model and the mechanisation of the launch-inertial frame: Si, Wang and Niu (SINS/CNS), (19)-(24).

Motion and errors move in the launch-inertial frame (`navreplay.mechanisation._launch_kernel`); at each node they are told as
the rest of the program knows them, in NED on the Earth. With D the turn of NED with position and w_ie the Earth's rotation,
    dX = C_ln dp, dV = C_ln (dv - [v x] D dp + [w_ie x] dp), phi_l = C_ln (phi_n + D dp),
so that the filter is that of the paper to first order, whatever it measures.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.error_models.ned import ATTITUDE, POSITION, VELOCITY, NedErrorModel, Propagated
from navreplay.geodesy import earth
from navreplay.geodesy.launch_frame import LaunchFrame, LaunchState
from navreplay.geodesy.rotation import skew
from navreplay.mechanisation import _launch_kernel
from navreplay.mechanisation._kernel_arrays import Driving
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.options import FilterOptions
from navreplay.timeline import Floats, LogError

__all__ = ["LaunchInertialModel", "exchange_errors", "inertial_model"]


@dataclass(frozen=True, slots=True)
class LaunchInertialModel(NedErrorModel):
    """frame: of the launch. launch_ns: its time [GPS ns]."""

    frame: LaunchFrame
    launch_ns: int

    def propagate(self, state: NavState, cov: Floats, leg: Leg, cross: Floats | None = None) -> Propagated:
        """See `NedErrorModel.propagate`."""
        steps = leg.steps
        times = np.append(steps.start_ns if leg.first == 0 else steps.t_ns[leg.first - 1], steps.t_ns[leg.ends - 1])
        elapsed = (times - self.launch_ns) / 1e9
        k = len(leg.ends)
        states, transitions, noises = np.empty((k, 16)), np.empty((k, 15, 15)), np.empty((k, 15, 15))
        _launch_kernel.propagate_launch(
            self._pack(elapsed[0], state),
            leg.rows,
            leg.counts,
            Driving(self.density(), self.correlation_time()),
            leg.interval,
            np.ascontiguousarray(self.frame.c_il),
            self.frame.origin_i @ self.frame.c_il,
            states,
            transitions,
            noises,
        )
        moved = self._unpack(elapsed[1:], states, state)
        packed = np.vstack([state.pack()[None], moved])
        to_launch, to_ned = exchange_errors(self.frame, elapsed, packed[:, :3], packed[:, 3:6])
        transitions = to_ned[1:] @ transitions @ to_launch[:-1]
        noises = to_ned[1:] @ noises @ np.swapaxes(to_ned[1:], 1, 2)
        cross = np.empty((15, 0)) if cross is None else cross
        covariances, crosses = np.empty((k, 15, 15)), np.empty((k, *cross.shape))
        for node, (phi, noise) in enumerate(zip(transitions, noises, strict=True)):
            cov, cross = phi @ cov @ phi.T + noise, phi @ cross
            cov = (cov + cov.T) / 2
            covariances[node], crosses[node] = cov, cross
        kept = slice(None) if leg.keep else slice(0)
        return Propagated(moved, covariances, crosses, transitions[kept], noises[kept])

    def _pack(self, elapsed: float, state: NavState) -> Floats:
        position, velocity, q_lb = self.frame.from_earth(np.array(elapsed), state.lla, state.vel_n, state.q_nb)
        return np.concatenate([position, velocity, q_lb, state.gyro_bias, state.accel_bias])

    def _unpack(self, elapsed: Floats, states: Floats, start: NavState) -> Floats:
        """Packed NED states (k, w) of those of the kernel (k, 16); what the kernel does not move is that of start."""
        packed = np.tile(start.pack(), (len(states), 1))
        lla, vel_n, q_nb = self.frame.to_earth(elapsed, LaunchState(states[:, :3], states[:, 3:6], states[:, 6:10]))
        packed[:, :10], packed[:, 10:16] = np.hstack([lla, vel_n, q_nb]), states[:, 10:]
        return packed


def exchange_errors(frame: LaunchFrame, elapsed: Floats, lla: Floats, vel_n: Floats) -> tuple[Floats, Floats]:
    """From errors in NED to errors in the launch frame and back, (k, 15, 15) each, at elapsed (k,) [s], lla, vel_n (k, 3)."""
    c_ln = frame.c_ln(elapsed, lla)
    c_nl = np.swapaxes(c_ln, 1, 2)
    turn = np.array([earth.frame_turn_n(place) for place in lla])
    swing = skew(earth.earth_rate_n(lla[:, 0])) - skew(vel_n) @ turn
    there = np.zeros((len(lla), 15, 15))
    there[:, range(9, 15), range(9, 15)] = 1.0
    back = there.copy()
    for block in (POSITION, VELOCITY, ATTITUDE):
        there[:, block, block], back[:, block, block] = c_ln, c_nl
    there[:, VELOCITY, POSITION], back[:, VELOCITY, POSITION] = c_ln @ swing, -swing @ c_nl
    there[:, ATTITUDE, POSITION], back[:, ATTITUDE, POSITION] = c_ln @ turn, -turn @ c_nl
    return there, back


def inertial_model(options: FilterOptions, start_ns: int) -> NedErrorModel:
    """The error model that the options choose for an IMU whose first sample is at start_ns [GPS ns].

    Raises LogError where the launch-inertial model cannot hold what the options want.
    """
    model = NedErrorModel(options.imu_noise)
    launch = options.launch
    if launch is None:
        return model
    if model.size != 15:
        raise LogError(
            "filter: the launch-inertial frame has neither scale factors nor a Gauss-Markov gyro error; leave out "
            "imu.gyro_scale_std_ppm, imu.accel_scale_std_ppm and imu.gyro_markov_std_dps, or set filter.frame = 'ned'"
        )
    frame = LaunchFrame(launch.position, launch.azimuth)
    return LaunchInertialModel(options.imu_noise, frame, start_ns + round(launch.after * 1e9))
