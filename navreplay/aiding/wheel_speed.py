"""Aiding by the wheels of a land vehicle: speed along its way, and turns by the difference of left and right (odometry).

Source: Groves (2013), 16.1-16.2. The scale of a wheel speed is fitted to the fixes' speed before
(`navreplay.calibration.wheels`); what is left of it is no white noise, so that it counts once a second, with a deviation that
grows with speed."""

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.aiding.no_slip import rear_axle
from navreplay.error_models.clocked import motion_size
from navreplay.error_models.error_model import ErrorModel
from navreplay.geodesy.earth import earth_rate_n
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.body_velocity import body_velocity, wheel_speed_measurement, wheel_turn_measurement
from navreplay.measurements.mean_rates import mean_rates
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GateOptions, VehicleOptions
from navreplay.timeline import Floats, ImuSeries, SpeedSeries, Times
from navreplay.update.gate import Gate
from navreplay.update.measurement import join
from navreplay.update.verdict import EpochGate

__all__ = ["WheelSpeedAiding", "covered_times"]

_AVERAGED_NS = 250_000_000
"""On either side of an epoch, for angular rates."""
_LONGEST_NS = 1_000_000_000
"""Between samples that an epoch may lie between."""


class WheelSpeedAiding:
    """Speeds, and turns where there are any, at t_ns (e,), each between two samples (see `covered_times`)."""

    name = "wheel speeds"
    kinds = frozenset({"wheel_speed", "wheel_turn"})

    def __init__(
        self,
        imu: ImuSeries,
        wheels: SpeedSeries,
        t_ns: Times,
        forward: float,
        options: VehicleOptions,
        model: ErrorModel,
    ) -> None:
        self.t_ns = t_ns
        self._rates = mean_rates(imu, t_ns - _AVERAGED_NS, t_ns + _AVERAGED_NS)
        self._point, _ = rear_axle(options, forward)
        self._motion, self._size = motion_size(model), model.size
        seconds, own = (t_ns - wheels.t_ns[0]) / 1e9, (wheels.t_ns - wheels.t_ns[0]) / 1e9
        self._speed = np.interp(seconds, own, wheels.speed)
        self._turn = np.interp(seconds, own, wheels.turn)
        change = np.interp(seconds, own, np.gradient(wheels.speed, own))
        self._std = np.sqrt(wheels.std**2 + (wheels.scale_std * self._speed) ** 2 + (wheels.delay_std * change) ** 2)
        self._turn_std = wheels.turn_std

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """Speed and turn of the vehicle."""
        earth_b = matrix_from_quat(state.q_nb).T @ earth_rate_n(state.lla[0])
        rate_b = (self._rates[epoch] - state.gyro_error) / (1 + state.gyro_scale) - earth_b
        moved = body_velocity(state, self._point, rate_b, self._motion)
        parts = [wheel_speed_measurement(moved, float(self._speed[epoch]), float(self._std[epoch]))]
        turn = float(self._turn[epoch])
        if np.isfinite(turn):
            parts.append(wheel_turn_measurement(turn, rate_b, self._point.c_vb, self._turn_std, self._motion))
        return Observed(join(parts).among(self._size), state, cov)

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate of its own that never opens the filter: wheels slip and lock."""
        return Gate(GateOptions(probability=options.probability, reset_after=0))


def covered_times(wheels: SpeedSeries, t_ns: Times) -> Times:
    """Those of the times (k,) that lie between two samples close to each other."""
    behind = np.searchsorted(wheels.t_ns, t_ns)
    inside = (behind > 0) & (behind < len(wheels))
    t_ns, behind = t_ns[inside], behind[inside]
    return t_ns[wheels.t_ns[behind] - wheels.t_ns[behind - 1] <= _LONGEST_NS]
