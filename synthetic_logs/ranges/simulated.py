"""The raw measurements of a receiver: everything between satellites and antenna put together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import Floats, RangeSeries, Times
from synthetic_logs.ranges.atmosphere import KLOBUCHAR, Delays, draw_delays
from synthetic_logs.ranges.constellation import Orbits
from synthetic_logs.ranges.draws import Draws
from synthetic_logs.ranges.errors import RangeErrors, draw_range_errors, tell_noise
from synthetic_logs.ranges.receiver import Receiver, receive
from synthetic_logs.ranges.receiver_clock import ClockCourse
from synthetic_logs.ranges.sight import Sights, sight_satellites
from synthetic_logs.ranges.signals import signal_of, system_of
from synthetic_logs.sensors.gnss import AntennaPath
from synthetic_logs.sensors.seeding import generator_for

__all__ = ["Epochs", "RangeTruth", "measure_ranges"]

_CN0_SCATTER = 0.5
_S = 1_000_000_000


@dataclass(frozen=True, eq=False, slots=True)
class Epochs:
    """Epochs of a receiver, (n,) each, interval [s] apart. t_ns: its stamps. t_s: the same from the start of the log [s].
    clock: the receiver's, which the stamps follow. antenna and course [rad]: at the true times, clock.offset / c before."""

    interval: float
    t_ns: Times
    t_s: Floats
    clock: ClockCourse
    antenna: AntennaPath
    course: Floats


@dataclass(frozen=True, eq=False, slots=True)
class RangeTruth:
    """What lies behind the ranges of a log, row by row of them, (k,) each.

    pseudorange = distance + clock_offset + delays + errors, range_rate likewise; the raw observations of a receiver still lack
    satellite_clock [m] and satellite_clock_rate [m/s]: clock and relativity, less group delay. distance [m], rate [m/s]: of the
    signal's path in vacuum. clock_offset [m], clock_drift [m/s]: of the receiver against the system of the row's satellite.
    azimuth, elevation [rad].
    """

    distance: Floats
    rate: Floats
    clock_offset: Floats
    clock_drift: Floats
    satellite_clock: Floats
    satellite_clock_rate: Floats
    delays: Delays
    errors: RangeErrors
    azimuth: Floats
    elevation: Floats


def measure_ranges(receiver: Receiver, orbits: Orbits, epochs: Epochs, seed: int) -> tuple[RangeSeries, RangeTruth]:
    """The ranges of a log as the filter sees them and the truth behind them; epochs without any signal are left out.

    Raises LogError where nothing is received at all.
    """
    sights, draws = _sight(receiver, orbits, epochs, seed)
    reception = receive(receiver, sights, epochs.course, epochs.t_s, draws)
    received = reception.received
    sights, draws, reception = sights.rows(received), draws.rows(received), reception.rows(received)
    errors = draw_range_errors(receiver, sights, reception, epochs.t_s, draws)
    truth = _truth(receiver, orbits, epochs, sights, errors, seed)
    cn0 = reception.cn0 + _CN0_SCATTER * draws.normal("C/N0 scatter")
    return _series(receiver, orbits, epochs, sights, cn0, truth), truth


def _sight(receiver: Receiver, orbits: Orbits, epochs: Epochs, seed: int) -> tuple[Sights, Draws]:
    t_s = (epochs.t_ns - orbits.reference_ns) / _S - epochs.clock.offset / SPEED_OF_LIGHT
    sights = sight_satellites(orbits, t_s, epochs.antenna.lla, epochs.antenna.vel_n, receiver.elevation_mask)
    shape = (len(t_s), len(orbits))
    return sights, Draws(seed, sights.epoch, sights.satellite, *shape, epochs.interval, receiver.multipath_time)


def _system_offsets(receiver: Receiver, sat: NDArray[np.str_], seed: int) -> Floats:
    system, offsets = system_of(sat), np.zeros(len(sat))
    for letter in receiver.systems[1:]:
        drawn = generator_for(seed, f"clock offset of {letter}").standard_normal()
        offsets[system == letter] = receiver.system_offset_std * drawn
    return offsets


def _truth(receiver: Receiver, orbits: Orbits, epochs: Epochs, sights: Sights, errors: RangeErrors, seed: int) -> RangeTruth:
    sat = orbits.sat[sights.satellite]
    return RangeTruth(
        distance=sights.distance,
        rate=sights.rate,
        clock_offset=epochs.clock.offset[sights.epoch] + _system_offsets(receiver, sat, seed),
        clock_drift=epochs.clock.drift[sights.epoch],
        satellite_clock=SPEED_OF_LIGHT * (sights.clock - orbits.group_delay[sights.satellite]),
        satellite_clock_rate=SPEED_OF_LIGHT * sights.clock_rate,
        delays=draw_delays(receiver, sat, sights, epochs.t_ns, epochs.antenna.lla, seed),
        errors=errors,
        azimuth=sights.azimuth,
        elevation=sights.elevation,
    )


def _series(receiver: Receiver, orbits: Orbits, epochs: Epochs, sights: Sights, cn0: Floats, truth: RangeTruth) -> RangeSeries:
    sat = orbits.sat[sights.satellite]
    told = tell_noise(receiver, sights.elevation)
    return RangeSeries(
        t_ns=epochs.t_ns[sights.epoch],
        sat=sat,
        signal=signal_of(sat),
        pseudorange=truth.distance + truth.clock_offset + truth.delays.total + truth.errors.pseudorange,
        range_rate=truth.rate + truth.clock_drift + truth.errors.range_rate,
        pseudorange_std=told.pseudorange_std,
        range_rate_std=told.range_rate_std,
        cn0=cn0,
        sat_pos_e=sights.pos_e,
        sat_vel_e=sights.vel_e,
        klobuchar=np.array(KLOBUCHAR),
    )
