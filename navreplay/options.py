"""What a filter run can be told: IMU noise, alignment, gating, gaps, output. SI units and radians throughout."""

from dataclasses import dataclass, field, replace
from math import inf, pi
from typing import Literal

__all__ = [
    "GRADES",
    "AlignmentOptions",
    "AttitudeOptions",
    "ConsiderOptions",
    "CorrelatedNoise",
    "FilterOptions",
    "GapOptions",
    "GateOptions",
    "ImuNoise",
    "LaunchOptions",
    "MotionOptions",
    "RangeOptions",
    "SetUpOptions",
    "VehicleOptions",
]

_DEG = pi / 180
_DPH = _DEG / 3600
_MG = 9.80665e-3


@dataclass(frozen=True, slots=True)
class ImuNoise:
    """Noise model of an IMU, per axis.

    gyro_noise [rad/s/sqrt(Hz)] and accel_noise [m/s^2/sqrt(Hz)] are white-noise densities. gyro_bias_std [rad/s] and
    accel_bias_std [m/s^2] are turn-on uncertainties. gyro_bias_walk [rad/s/sqrt(s)] and accel_bias_walk [m/s^2/sqrt(s)]
    drive the biases; with a finite gyro_bias_tau or accel_bias_tau [s] they are first-order Gauss-Markov, else random walks.
    gyro_scale_std and accel_scale_std are scale-factor uncertainties; where either is positive the filter estimates the
    scale factors (six states more). gyro_markov_std [rad/s], where positive, adds a stationary first-order Gauss-Markov error
    with time constant gyro_markov_tau [s] to the gyro bias (three states more).
    """

    gyro_noise: float
    accel_noise: float
    gyro_bias_std: float
    accel_bias_std: float
    gyro_bias_walk: float
    accel_bias_walk: float
    gyro_bias_tau: float = inf
    accel_bias_tau: float = inf
    gyro_scale_std: float = 0.0
    accel_scale_std: float = 0.0
    gyro_markov_std: float = 0.0
    gyro_markov_tau: float = 300.0


GRADES: dict[str, ImuNoise] = {
    "consumer": ImuNoise(0.2 * _DEG, 0.07, 0.5 * _DEG, 30 * _MG, 5e-4 * _DEG, 1e-3),
    "industrial": ImuNoise(0.03 * _DEG, 0.03, 0.15 * _DEG, 15 * _MG, 2e-4 * _DEG, 1e-3),
    "tactical": ImuNoise(0.3 * _DEG / 60, 5e-3, 5 * _DPH, 2 * _MG, 0.3 * _DPH, 5e-5),
    "navigation": ImuNoise(0.005 * _DEG / 60, 5e-4, 0.02 * _DPH, 0.1 * _MG, 1e-3 * _DPH, 2e-6),
}
"""Noise by grade as a filter must expect it in a vehicle: vibration, time jitter and what the error model leaves out (scale
factors, misalignment) make it several times a data sheet's, the more so the cheaper the sensor."""


@dataclass(frozen=True, slots=True)
class AlignmentOptions:
    """Initial attitude. Angles roll, pitch, yaw [rad] of the body in NED.

    method: ``auto`` takes the first of given angles, attitude series, gyrocompass, course that the log allows; ``reference``
    (never taken by itself) takes roll, pitch and yaw of the reference. given: angles where method is ``given``; given_std
    their standard deviations, about the body's x, y and z. static_window [s]: longest static stretch used for levelling.
    min_speed [m/s]: GNSS speed from which course counts as heading. course_std [rad]: floor on the standard deviation of a
    heading from course (side slip, mounting). forward [rad]: where the direction of travel lies in the body's x-y plane, from x
    to the right. max_gyrocompass_std [rad]: a worse gyrocompass is not used.
    Where nothing in the log tells the place: position is latitude, longitude [rad] and height [m] at the first IMU sample,
    velocity NED [m/s], with their standard deviations NED [m], [m/s].
    """

    method: Literal["auto", "given", "attitude", "reference", "gyrocompass", "course"] = "auto"
    given: tuple[float, float, float] | None = None
    given_std: tuple[float, float, float] = (1 * _DEG, 1 * _DEG, 3 * _DEG)
    static_window: float = 60.0
    min_speed: float = 2.0
    course_std: float = 3 * _DEG
    forward: float = 0.0
    max_gyrocompass_std: float = 2 * _DEG
    position: tuple[float, float, float] | None = None
    position_std: tuple[float, float, float] = (10.0, 10.0, 10.0)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity_std: tuple[float, float, float] = (0.1, 0.1, 0.1)


@dataclass(frozen=True, slots=True)
class GateOptions:
    """Innovation gate: probability of a good measurement to pass (1.0 switches the gate off); after reset_after rejected
    epochs of a kind in a row, and 10 s where the filter had agreed with the kind before, the covariance of what the kind
    measures is widened until it passes (0: never)."""

    probability: float = 0.9999
    reset_after: int = 10


@dataclass(frozen=True, slots=True)
class GapOptions:
    """Gaps in the IMU: up to bridge_s they are bridged with the neighbouring samples' mean; longer ones ``reset`` (align
    anew behind the gap) or are ``refuse``d."""

    bridge_s: float = 0.5
    longer: Literal["reset", "refuse"] = "reset"


@dataclass(frozen=True, slots=True)
class RangeOptions:
    """Pseudoranges, range rates, and the receiver clock.

    Where the receiver reports no standard deviation that is positive, a measurement's is pseudorange_std [m] or range_rate_std
    [m/s], those of a strong signal from the zenith, times sqrt(1 + 10^((cn0_reference - C/N0) / 10)), by which its variance
    doubles at cn0_reference [dB-Hz] (SIGMA-epsilon model, Hartinger and Brunner, GPS Solutions 2(4) (1999) 35), over the sine
    of the elevation for pseudoranges, whose errors of the atmosphere grow so, and over its root for range rates.
    pseudorange_std_floor, range_rate_std_floor: least ones believed.
    Not used: satellites below elevation_mask [rad] and signals below cn0_mask [dB-Hz]. ionosphere, troposphere: correct for
    them what is not yet corrected. clock_noise [m/sqrt(s)] and clock_drift_walk [m/s/sqrt(s)]: white noise of the receiver
    clock's frequency, and its random walk. system_offset_std [m]: of another constellation's clock offset against the first's,
    before it is seen; system_offset_walk [m/sqrt(s)]: its random walk. clock_jump [m]: a common jump of all pseudoranges beyond
    it is the clock's. pseudorange_noise_scale, range_rate_noise_scale: on the standard deviations, beside
    FilterOptions.noise_scale. multipath_share: share of a pseudorange's variance that is not white but multipath, correlated
    over multipath_time [s]; where it is positive, multipath is estimated, with a state for every satellite.
    """

    pseudorange_std: float = 1.0
    range_rate_std: float = 0.05
    pseudorange_std_floor: float = 0.3
    range_rate_std_floor: float = 0.01
    cn0_reference: float = 32.0
    elevation_mask: float = 10 * _DEG
    cn0_mask: float = 30.0
    ionosphere: bool = True
    troposphere: bool = True
    clock_noise: float = 0.1
    clock_drift_walk: float = 0.5
    system_offset_std: float = 300.0
    system_offset_walk: float = 0.01
    clock_jump: float = 150.0
    multipath_share: float = 0.0
    multipath_time: float = 20.0
    pseudorange_noise_scale: float = 1.0
    range_rate_noise_scale: float = 1.0


@dataclass(frozen=True, slots=True)
class AttitudeOptions:
    """Measured attitude. use: let it aid the filter; else it serves alignment alone. default_std [rad]: about each axis where
    the log does not tell its accuracy. std_floor [rad]: least one believed. noise_scale: on the standard deviations."""

    use: bool = True
    default_std: float = 1 * _DEG
    std_floor: float = 0.1 * _DEG / 3600
    noise_scale: float = 1.0


@dataclass(frozen=True, slots=True)
class LaunchOptions:
    """A launch: position is latitude, longitude [rad] and height [m] of its point, azimuth [rad] that of the downrange axis,
    clockwise from north, after [s] its time behind the first IMU sample."""

    position: tuple[float, float, float]
    azimuth: float = 0.0
    after: float = 0.0


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """Motion of a receiver without IMU. model: ``velocity`` is constant but for white acceleration of density horizontal,
    vertical [m/s^2/sqrt(Hz)]; or ``acceleration`` is, but for white jerk of these densities [m/s^3/sqrt(Hz)]."""

    model: Literal["velocity", "acceleration"] = "velocity"
    horizontal: float = 1.0
    vertical: float = 0.3


@dataclass(frozen=True, slots=True)
class VehicleOptions:
    """What is known of a vehicle's motion.

    zero_velocity: where the IMU shows that it stands still, its velocity is measured to be zero, with standard deviation
    zero_velocity_std [m/s] per axis. zero_rate: there its angular rate too. no_slip: at rear_axle (forward, right, down from
    the IMU in body axes [m], its place along the vehicle known to arm_std [m]; None: nobody knows) it moves neither sideways
    nor up, with standard deviations slip_std of the lateral and vertical velocity [m/s] and a slip angle of
    slip_per_acceleration [rad s^2/m] times the lateral acceleration. mounting: pitch and yaw [rad] of its axes in the body's
    (None: to be found in the log), known to mounting_std [rad]. wheel_speed: where the log has it. barometer: its changes,
    where the log has one. height_hold: in outages it climbs nothing, to height_hold_std [m/s]. doubted: (start, end) of
    stops [GPS ns] that are not believed."""

    zero_velocity: bool = False
    zero_velocity_std: float = 0.01
    zero_rate: bool = False
    no_slip: bool = False
    rear_axle: tuple[float, float, float] | None = None
    arm_std: float = 0.0
    slip_std: tuple[float, float] = (0.1, 0.1)
    mounting: tuple[float, float] | None = None
    mounting_std: float = 1 * _DEG
    slip_per_acceleration: float = 0.005
    wheel_speed: bool = True
    barometer: bool = True
    height_hold: bool = False
    height_hold_std: float = 0.3
    doubted: tuple[tuple[int, int], ...] = ()

    @property
    def holds(self) -> bool:
        """Whether the vehicle is held by what it cannot do."""
        return self.zero_velocity or self.zero_rate or self.no_slip or self.height_hold

    @property
    def free(self) -> "VehicleOptions":
        """The same with nothing that holds the vehicle."""
        return replace(
            self, zero_velocity=False, zero_rate=False, no_slip=False, wheel_speed=False, barometer=False, height_hold=False
        )


@dataclass(frozen=True, slots=True)
class ConsiderOptions:
    """Unknown constant biases that a filter reckons with but does not estimate: standard deviations, NED where there are three,
    0 where there is none.

    In the measurements: position_bias [m] and velocity_bias [m/s], as if the antenna were displaced by one and drifted with the
    other, of fixes as of ranges (along each line of sight); zenith_delay [m] of pseudoranges, divided by the sine of the
    elevation. In the dynamics: position_rate [m/s] and velocity_rate [m/s^2] add to the derivatives of position and velocity.
    every_method: reckon with them in every method, not in those alone that are made for it; "ranges": where ranges aid the
    filter, in every method that can.
    """

    position_bias: tuple[float, float, float] = (1.0, 1.0, 2.0)
    velocity_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zenith_delay: float = 0.0
    position_rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity_rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    every_method: bool | Literal["ranges"] = False


@dataclass(frozen=True, slots=True)
class CorrelatedNoise:
    """A first-order Gauss-Markov error of the positions or velocities of fixes. std: horizontal, vertical [m] or [m/s]. time:
    of correlation [s]."""

    kind: Literal["position", "velocity"]
    std: tuple[float, float]
    time: float


@dataclass(frozen=True, slots=True)
class SetUpOptions:
    """What is estimated of the set-up of the sensors, beside the motion: names of parameters (see
    `navreplay.error_models.set_up`), and the covariance (p, p) of what they are off by from what the timeline holds."""

    names: tuple[str, ...] = ()
    cov: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """Everything a filter run is told beside the timeline and the method.

    output_rate [Hz] of rows between GNSS epochs (0: only at GNSS epochs). covariance_interval [s]: longest step of the
    covariance propagation. use_velocity: take GNSS velocity where the log has it. noise_scale multiplies the standard
    deviations of all GNSS measurements, position_noise_scale and velocity_noise_scale those of fixes besides. correlated_noise:
    errors of fixes beside the told ones that stay; they are estimated (three states more each). position_std_floor [m],
    velocity_std_floor [m/s]: least standard deviations believed. default_position_std, default_velocity_std: (horizontal,
    vertical) by name of FixStatus where the covariance is unknown. use: what aids the filter beside attitudes; ``auto`` takes
    ranges where the log has them, ``attitudes`` neither ranges nor fixes. launch: mechanisation and errors move in the
    launch-inertial frame (None: in NED). set_up: of the
    sensors, estimated beside the motion by fixes. smooth: carry all measurements backward as well.
    """

    imu_noise: ImuNoise = GRADES["consumer"]
    alignment: AlignmentOptions = AlignmentOptions()
    gate: GateOptions = GateOptions()
    gaps: GapOptions = GapOptions()
    output_rate: float = 10.0
    covariance_interval: float = 0.05
    use_velocity: bool = True
    noise_scale: float = 1.0
    correlated_noise: tuple[CorrelatedNoise, ...] = ()
    position_noise_scale: float = 1.0
    velocity_noise_scale: float = 1.0
    position_std_floor: float = 0.01
    velocity_std_floor: float = 0.02
    default_position_std: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {
            "UNKNOWN": (3.0, 5.0),
            "SINGLE": (3.0, 5.0),
            "DIFFERENTIAL": (1.0, 2.0),
            "FLOAT": (0.3, 0.6),
            "FIXED": (0.02, 0.04),
            "DEAD_RECKONING": (10.0, 20.0),
        }
    )
    default_velocity_std: tuple[float, float] = (0.1, 0.2)
    use: Literal["auto", "fixes", "ranges", "attitudes"] = "auto"
    smooth: bool = False
    ranges: RangeOptions = RangeOptions()
    motion: MotionOptions = MotionOptions()
    attitude: AttitudeOptions = AttitudeOptions()
    vehicle: VehicleOptions = VehicleOptions()
    launch: LaunchOptions | None = None
    consider: ConsiderOptions = ConsiderOptions()
    set_up: SetUpOptions = SetUpOptions()
