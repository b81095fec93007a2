"""What aids a filter: fixes or ranges, attitudes and what is known of the vehicle beside them, or attitudes alone."""

from dataclasses import dataclass

import numpy as np

from navreplay.aiding.attitudes import AttitudeAiding
from navreplay.aiding.climb import ClimbAiding, unaided_times
from navreplay.aiding.epochs import Aiding
from navreplay.aiding.fixes import FixAiding
from navreplay.aiding.joint import JointAiding, JointGate
from navreplay.aiding.no_slip import NoSlipAiding, no_slip_times
from navreplay.aiding.ranges import RangeAiding
from navreplay.aiding.standstill import StandstillAiding, standstill_candidates, stop_rates
from navreplay.aiding.wheel_speed import WheelSpeedAiding, covered_times
from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.launch_inertial import inertial_model
from navreplay.error_models.ned import NedErrorModel
from navreplay.measurements.climb import find_climbs
from navreplay.measurements.standstill import find_standstills
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions, GateOptions, VehicleOptions
from navreplay.start.alignment import align
from navreplay.start.heading import Sources
from navreplay.start.told import start_as_told
from navreplay.timeline import BaroSeries, Floats, ImuSeries, LogError, SpeedSeries, Timeline, Times
from navreplay.update.gate import Gate
from navreplay.update.range_gate import RangeGate
from navreplay.update.record import Recorder
from navreplay.update.verdict import EpochGate

__all__ = ["Guidance", "Start", "choose_guidance"]

_AROUND_NS = 1_000_000_000
_TURNING = 0.1
"""Wheel speed [m/s] of a vehicle that does not stand still."""

VehicleAiding = StandstillAiding | NoSlipAiding | WheelSpeedAiding | ClimbAiding
Beside = AttitudeAiding | VehicleAiding


@dataclass(frozen=True, eq=False, slots=True)
class Start:
    """Time, state and covariance (n, n) at which a stretch starts. sure: by something better than a course or a guess."""

    t_ns: int
    state: NavState
    cov: Floats
    sure: bool


@dataclass(frozen=True, eq=False, slots=True)
class Guidance:
    """main: what a filter starts from and what decides its error model. others: what aids beside it. aiding: all of them.
    inertial: error model of the IMU."""

    main: FixAiding | RangeAiding | AttitudeAiding
    others: tuple[Beside, ...]
    aiding: Aiding
    inertial: NedErrorModel

    @property
    def model(self) -> ErrorModel:
        """The error model of the filter."""
        return self.main.model

    def gate(self, options: GateOptions) -> EpochGate:
        """A gate for all epochs, with nothing counted yet."""
        main: EpochGate = RangeGate(options) if isinstance(self.main, RangeAiding) else Gate(options)
        return JointGate(main, [(other.kinds, other.gate(options)) for other in self.others]) if self.others else main

    def start(self, timeline: Timeline, imu: ImuSeries, options: FilterOptions, recorder: Recorder) -> Start:
        """Where a stretch of the IMU starts; the record tells how. Raises LogError."""
        if isinstance(self.main, AttitudeAiding):
            told = start_as_told(timeline, imu, self.inertial, options)
            recorder.tell(told.t_ns, "info", told.text)
            return Start(told.t_ns, told.state, told.cov, True)
        sources = Sources(
            imu, self.main.told_fixes, timeline.attitude, timeline.reference, options.imu_noise, options.alignment
        )
        alignment = align(sources)
        recorder.tell(alignment.t_ns, "info", alignment.text)
        for warning in alignment.warnings:
            recorder.tell(alignment.t_ns, "warning", warning)
        return Start(alignment.t_ns, *self.main.start(alignment), alignment.sure)


def choose_guidance(timeline: Timeline, options: FilterOptions, recorder: Recorder) -> Guidance:
    """What the options take of a timeline with IMU. Raises LogError where the log does not hold it."""
    if timeline.imu is None:
        raise LogError("filter: attitudes and fixes aid an IMU, but the log holds none")
    model = inertial_model(options, int(timeline.imu.t_ns[0]))
    main: FixAiding | RangeAiding | None = None
    if timeline.ranges is not None and options.use in ("auto", "ranges"):
        main = RangeAiding(timeline.ranges, timeline.fix_lever_b, model, options, recorder)
    elif timeline.fixes is not None and options.use in ("auto", "fixes"):
        main = FixAiding(timeline.fixes, timeline.fix_lever_b, options, model, timeline.imu)
    attitude = timeline.attitude if options.attitude.use else None
    if main is None:
        if attitude is None or options.use not in ("auto", "attitudes"):
            raise _nothing_to_use(options)
        alone = AttitudeAiding(attitude, model, options.attitude)
        if options.vehicle.holds:
            text = (
                "vehicle.zero_velocity and what else is known of the vehicle are not used: without fixes nothing tells which "
                "IMU noise is that of standstill"
            )
            recorder.tell(int(timeline.imu.t_ns[0]), "warning", text)
        return Guidance(alone, (), alone, model)
    others: list[Beside] = []
    if attitude is not None:
        others.append(AttitudeAiding(attitude, main.model, options.attitude))
    others += _aid_by_vehicle(timeline.imu, timeline.speed, main, options, recorder)
    others += _aid_by_climb(timeline.imu, timeline.baro, main, options.vehicle, recorder)
    aiding: Aiding = JointAiding((main, *others)) if others else main
    return Guidance(main, tuple(others), aiding, model)


def _aid_by_vehicle(
    imu: ImuSeries, wheels: SpeedSeries | None, main: FixAiding | RangeAiding, options: FilterOptions, recorder: Recorder
) -> list[VehicleAiding]:
    """What is known of the vehicle's motion."""
    vehicle = options.vehicle
    candidates = standstill_candidates(main.t_ns, int(imu.t_ns[0]), int(imu.t_ns[-1]))
    found: list[VehicleAiding] = []
    stops = np.empty(0, np.int64)
    if vehicle.zero_velocity:
        standstill = find_standstills(imu, main.fixes, candidates)
        recorder.tell(int(imu.t_ns[0]), "info" if len(standstill.t_ns) else "warning", standstill.text)
        stops = _believed(standstill.t_ns, vehicle, wheels)
        rates = stop_rates(imu, stops, options.imu_noise.gyro_noise) if vehicle.zero_rate else None
        found.append(StandstillAiding(stops, vehicle.zero_velocity_std, main.model, rates, main.t_ns))
    if vehicle.no_slip:
        times = no_slip_times(np.setdiff1d(candidates, stops))
        found.append(NoSlipAiding(imu, times, options.alignment.forward, vehicle, main.model))
    if wheels is not None and vehicle.wheel_speed:
        times = covered_times(wheels, no_slip_times(candidates))
        found.append(WheelSpeedAiding(imu, wheels, times, options.alignment.forward, vehicle, main.model))
    return found


def _aid_by_climb(
    imu: ImuSeries, baro: BaroSeries | None, main: FixAiding | RangeAiding, vehicle: VehicleOptions, recorder: Recorder
) -> list[VehicleAiding]:
    """What is known of height: changes by a barometer; none, in outages, where that is asked for."""
    found: list[VehicleAiding] = []
    if baro is not None and vehicle.barometer:
        climbs = find_climbs(baro, main.fixes)
        recorder.tell(int(imu.t_ns[0]), "info" if len(climbs.t_ns) else "warning", climbs.text)
        found.append(ClimbAiding(climbs.t_ns, climbs.rate, climbs.std, "climb", main.model))
    if vehicle.height_hold:
        candidates = standstill_candidates(main.t_ns, int(imu.t_ns[0]), int(imu.t_ns[-1]))
        times = unaided_times(main.t_ns, no_slip_times(candidates))
        still, std = np.zeros(len(times)), np.full(len(times), vehicle.height_hold_std)
        found.append(ClimbAiding(times, still, std, "height_hold", main.model))
    return found


def _believed(t_ns: Times, vehicle: VehicleOptions, wheels: SpeedSeries | None) -> Times:
    """The times (e,) of standstill outside the stops that are doubted, and at which no wheel turns within a second."""
    if wheels is not None:
        turning_ns = wheels.t_ns[np.abs(wheels.speed) > max(_TURNING, 3 * wheels.std)]
        ends = np.searchsorted(turning_ns, t_ns + _AROUND_NS, side="right")
        t_ns = t_ns[ends == np.searchsorted(turning_ns, t_ns - _AROUND_NS)]
    for start_ns, end_ns in vehicle.doubted:
        t_ns = t_ns[(t_ns < start_ns) | (t_ns > end_ns)]
    return t_ns


def _nothing_to_use(options: FilterOptions) -> LogError:
    if options.use == "ranges":
        return LogError("filter: filter.use is 'ranges', but the log holds none; set it to 'auto', or add the file that does")
    if options.use == "attitudes":
        return LogError(
            "filter: filter.use is 'attitudes', but the log holds none to use; name them with input.attitude.channel, with "
            "attitude.use = true"
        )
    return LogError("filter: the log holds no GNSS fixes; name them with input.fix.channel, or add the file that holds them")
