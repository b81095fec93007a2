"""Aiding by what a land vehicle cannot do: at the point of its rear axle it moves neither sideways nor up (non-holonomic
constraint)."""

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.clocked import motion_size
from navreplay.error_models.error_model import ErrorModel
from navreplay.geodesy.earth import earth_rate_n
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_euler
from navreplay.measurements.body_velocity import Slip, VehiclePoint, body_velocity, no_slip_measurement
from navreplay.measurements.mean_rates import mean_rates
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GateOptions, VehicleOptions
from navreplay.timeline import Floats, ImuSeries, Times
from navreplay.update.gate import Gate
from navreplay.update.verdict import EpochGate

__all__ = ["NoSlipAiding", "no_slip_times", "rear_axle"]

_PERIOD_NS = 1_000_000_000
"""Between constraints: what a vehicle slips stays for about as long, and is no white noise."""
_AVERAGED_NS = 250_000_000
"""On either side of an epoch, for the yaw rate."""
_UNKNOWN_ARM = 1.5
"""Deviation of the rear axle from the IMU along the vehicle [m], where nobody tells it."""


class NoSlipAiding:
    """Lateral and vertical velocity zero of the rear axle at t_ns (e,)."""

    name = "constraints"
    kinds = frozenset({"no_slip"})

    def __init__(self, imu: ImuSeries, t_ns: Times, forward: float, options: VehicleOptions, model: ErrorModel) -> None:
        self.t_ns = t_ns
        self._rates = mean_rates(imu, t_ns - _AVERAGED_NS, t_ns + _AVERAGED_NS)
        self._point, self._slip = rear_axle(options, forward)
        self._motion, self._size = motion_size(model), model.size

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The constraint, in vehicle axes."""
        earth_b = matrix_from_quat(state.q_nb).T @ earth_rate_n(state.lla[0])
        rate_b = (self._rates[epoch] - state.gyro_error) / (1 + state.gyro_scale) - earth_b
        moved = body_velocity(state, self._point, rate_b, self._motion)
        yaw_rate = float((self._point.c_vb @ rate_b)[2])
        return Observed(no_slip_measurement(moved, yaw_rate, self._slip).among(self._size), state, cov)

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate of its own that never opens the filter: a refused constraint is a vehicle that slips."""
        return Gate(GateOptions(probability=options.probability, reset_after=0))


def rear_axle(options: VehicleOptions, forward: float) -> tuple[VehiclePoint, Slip]:
    """The point, and what its velocity may deviate by. Its axes are turned from the body's as the mounting says or else by
    forward [rad] about down; where the lever arm is not told, it is the IMU's own place with that much more."""
    pitch, yaw = (0.0, forward) if options.mounting is None else options.mounting
    c_vb = matrix_from_quat(quat_from_euler(0.0, pitch, yaw)).T
    lateral, vertical = options.slip_std
    lever_b, arm = np.zeros(3), _UNKNOWN_ARM
    if options.rear_axle is not None:
        lever_b, arm = np.array(options.rear_axle), options.arm_std
    return VehiclePoint(c_vb, lever_b), Slip(lateral, vertical, options.mounting_std, options.slip_per_acceleration, arm)


def no_slip_times(candidates: Times) -> Times:
    """(e,) of the candidates (k,), in the order of time, at least a period apart."""
    chosen, last = [], None
    for t_ns in candidates.tolist():
        if last is None or t_ns - last >= _PERIOD_NS:
            chosen.append(t_ns)
            last = t_ns
    return np.array(chosen, dtype=np.int64)
