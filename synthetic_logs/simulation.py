"""From a scenario and a seed to a log with its truth."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from navreplay.geodesy.rotation import euler_from_quat
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import (
    AttitudeSeries,
    Floats,
    GnssFixSeries,
    ImuSeries,
    LogError,
    RangeSeries,
    Timeline,
    Times,
    Trajectory,
)
from synthetic_logs.motion.kinematics import Path, Traceable
from synthetic_logs.ranges.constellation import Orbits, arrange_constellation
from synthetic_logs.ranges.receiver import Receiver
from synthetic_logs.ranges.receiver_clock import draw_clock
from synthetic_logs.ranges.simulated import Epochs, RangeTruth, measure_ranges
from synthetic_logs.sensors.gnss import AntennaPath, FixErrors, GnssErrors, antenna_path, measure_fixes
from synthetic_logs.sensors.imu import sense, sense_means
from synthetic_logs.sensors.imu_errors import ImuErrors, SensorErrors, disturb_imu
from synthetic_logs.sensors.star_sensor import AttitudeErrors, StarSensor, measure_attitudes

__all__ = ["Journey", "Scenario", "SyntheticLog", "ideal_imu", "orbits_of", "simulate", "truth_at", "with_duration"]

_HOUR_NS = 3_600_000_000_000


@dataclass(frozen=True, slots=True)
class Journey:
    """The part of a scenario that no seed changes: a motion and how it is sampled.

    duration [s]. imu_rate [Hz]: stamps from start_ns (GPS) on. increments: samples are means over the intervals that end at
    their stamps, else values at the stamps. gnss_rate [Hz], gnss_offset [s]: epochs from start_ns + gnss_offset on. lever_b:
    from the IMU to the antenna [m]. truth_rate [Hz]: of the truth, brought to a whole number of IMU intervals.
    """

    motion: Traceable
    duration: float
    imu_rate: float = 100.0
    increments: bool = False
    gnss_rate: float = 1.0
    gnss_offset: float = 0.0
    lever_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    truth_rate: float = 50.0
    start_ns: int = 1_393_670_000_000_000_000


@dataclass(frozen=True, slots=True)
class Scenario:
    """A journey with the errors of its sensors; description is one line. gnss: fixes, None where the log has none. receiver: of
    ranges, stars: of attitudes, None where the log has none."""

    name: str
    description: str
    journey: Journey
    imu: ImuErrors
    gnss: GnssErrors | None
    receiver: Receiver | None = None
    stars: StarSensor | None = None


@dataclass(frozen=True, eq=False, slots=True)
class SyntheticLog:
    """A log and everything that went into it. truth: of the IMU, at every so many IMU stamps (Journey.truth_rate), its
    covariance unknown. gyro_errors, accel_errors: at the IMU stamps. fix_errors, range_truth, attitude_errors: row by row of
    fixes, ranges, attitudes."""

    scenario: Scenario
    seed: int
    imu: ImuSeries
    fixes: GnssFixSeries | None
    ranges: RangeSeries | None
    truth: Trajectory
    gyro_errors: SensorErrors
    accel_errors: SensorErrors
    fix_errors: FixErrors | None
    range_truth: RangeTruth | None
    attitude: AttitudeSeries | None = None
    attitude_errors: AttitudeErrors | None = None

    def timeline(self) -> Timeline:
        """The log as a filter sees it, with the truth as reference."""
        lever_b = np.array(self.scenario.journey.lever_b)
        return Timeline(
            imu=self.imu,
            fixes=self.fixes,
            ranges=self.ranges,
            attitude=self.attitude,
            reference=self.truth,
            fix_lever_b=lever_b,
        )


def with_duration(scenario: Scenario, duration: float) -> Scenario:
    """The same scenario over another duration [s]; its motion is cut or goes on."""
    return replace(scenario, journey=replace(scenario.journey, duration=duration))


def simulate(scenario: Scenario, seed: int) -> SyntheticLog:
    """Draws one log; the same scenario and seed give the same log bit for bit.

    Every kind of error has a random generator of its own, derived from the seed, so that logs of one seed with and without
    an error share all their other errors. Raises LogError for a negative seed and for a journey too short to hold a sample of
    each sensor.
    """
    if seed < 0:
        raise LogError(f"synthetic log: a seed is a whole number from 0 on, got {seed}")
    journey = scenario.journey
    imu, gyro_errors, accel_errors = disturb_imu(ideal_imu(journey), 1 / journey.imu_rate, scenario.imu, seed)
    fixes, fix_errors = None, None
    if scenario.gnss is not None:
        t_ns, antenna = _ideal_fixes(journey)
        t_s = (t_ns - journey.start_ns) / 1e9
        fixes, fix_errors = measure_fixes(t_ns, t_s, 1 / journey.gnss_rate, antenna, scenario.gnss, seed)
    ranges, range_truth = None, None
    if scenario.receiver is not None:
        epochs = _receiver_epochs(journey, scenario.receiver, seed)
        ranges, range_truth = measure_ranges(scenario.receiver, orbits_of(journey, scenario.receiver), epochs, seed)
    attitude, attitude_errors = None, None
    if scenario.stars is not None:
        t_ns = _stamps(journey, scenario.stars.rate, scenario.stars.offset)
        motion = _journey_path(journey).at(_path_time(journey, t_ns))
        attitude, attitude_errors = measure_attitudes(t_ns, (t_ns - journey.start_ns) / 1e9, motion, scenario.stars, seed)
    return SyntheticLog(
        scenario,
        seed,
        imu,
        fixes,
        ranges,
        _truth(journey),
        gyro_errors,
        accel_errors,
        fix_errors,
        range_truth,
        attitude,
        attitude_errors,
    )


def orbits_of(journey: Journey, receiver: Receiver) -> Orbits:
    """The satellites over a journey; they keep their places whatever the hour at which it starts."""
    return arrange_constellation(receiver.systems, journey.start_ns // _HOUR_NS * _HOUR_NS)


def _receiver_epochs(journey: Journey, receiver: Receiver, seed: int) -> Epochs:
    t_ns = _stamps(journey, journey.gnss_rate, journey.gnss_offset)
    clock = draw_clock(receiver.clock, len(t_ns), 1 / journey.gnss_rate, seed)
    motion = _journey_path(journey).at(_path_time(journey, t_ns) - clock.offset / SPEED_OF_LIGHT)
    antenna = antenna_path(motion, np.array(journey.lever_b))
    course = euler_from_quat(motion.q_nb)[:, 2]
    t_s = (t_ns - journey.start_ns) / 1e9
    return Epochs(1 / journey.gnss_rate, t_ns, t_s, clock, antenna, course)


def _stamps(journey: Journey, rate: float, offset: float) -> Times:
    count = int(np.floor((journey.duration - offset) * rate + 1e-9)) + 1
    return journey.start_ns + np.rint((offset + np.arange(count) / rate) * 1e9).astype(np.int64)


def _path_time(journey: Journey, t_ns: Times) -> Floats:
    """Seconds on the path: it begins one IMU interval before the log, so that the first sample has an interval to cover."""
    return np.asarray((t_ns - journey.start_ns) / 1e9 + 1 / journey.imu_rate)


def _read_only(*arrays: np.ndarray) -> None:
    for array in arrays:
        array.flags.writeable = False


@lru_cache(maxsize=4)
def _path(motion: Traceable, duration: float) -> Path:
    return motion.trace(duration)


def _journey_path(journey: Journey) -> Path:
    return _path(journey.motion, journey.duration + 1 / journey.imu_rate)


@lru_cache(maxsize=4)
def ideal_imu(journey: Journey) -> ImuSeries:
    """The IMU without errors; its arrays are read-only because calls share them."""
    path = _journey_path(journey)
    t_ns = _stamps(journey, journey.imu_rate, 0.0)
    ends_s = _path_time(journey, t_ns)
    if journey.increments:
        starts_s = np.concatenate([[0.0], ends_s[:-1]])
        gyro, accel = sense_means(path, starts_s, ends_s)
    else:
        gyro, accel = sense(path, ends_s)
    _read_only(t_ns, gyro, accel)
    return ImuSeries(t_ns, gyro, accel, journey.increments)


@lru_cache(maxsize=4)
def _ideal_fixes(journey: Journey) -> tuple[Times, AntennaPath]:
    t_ns = _stamps(journey, journey.gnss_rate, journey.gnss_offset)
    antenna = antenna_path(_journey_path(journey).at(_path_time(journey, t_ns)), np.array(journey.lever_b))
    _read_only(t_ns, antenna.lla, antenna.vel_n)
    return t_ns, antenna


@lru_cache(maxsize=4)
def _truth(journey: Journey) -> Trajectory:
    every = max(1, round(journey.imu_rate / journey.truth_rate))
    truth = truth_at(journey, _stamps(journey, journey.imu_rate, 0.0)[::every])
    _read_only(truth.t_ns, truth.lla, truth.vel_n, truth.q_nb, truth.cov_pos)
    return truth


def truth_at(journey: Journey, t_ns: Times) -> Trajectory:
    """The exact motion of the IMU at times t_ns (n,) [GPS ns] within the journey."""
    motion = _journey_path(journey).at(_path_time(journey, t_ns))
    unknown = np.full((len(t_ns), 3, 3), np.nan)
    return Trajectory(t_ns, motion.lla, motion.vel_n, motion.q_nb, unknown)
