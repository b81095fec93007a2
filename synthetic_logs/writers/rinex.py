"""Writes ranges as a receiver would: RINEX 3.04 (IGS/RTCM, 2018) observations without any correction, broadcast ephemerides."""

from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from navreplay.geodesy.earth import ecef_from_lla
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, WEEK_S, utc_from_gps
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import Floats, LogError, RangeSeries
from synthetic_logs.ranges.constellation import Orbits, ascending_node
from synthetic_logs.ranges.signals import SIGNALS, carrier_of
from synthetic_logs.ranges.simulated import RangeTruth
from synthetic_logs.simulation import Journey, SyntheticLog, orbits_of
from synthetic_logs.writers.broadcast import AHEAD_S, WEEKS_BEFORE, issues
from synthetic_logs.writers.text import write_imu

__all__ = ["write_rinex"]

_S = 1_000_000_000
_GALILEO_INAV_E1B = 517


def write_rinex(log: SyntheticLog, path: Path) -> None:
    """NAME.obs, NAME.nav and, because RINEX has no place for it, NAME.imu.csv. Raises LogError for a log without ranges."""
    ranges, truth, receiver = log.ranges, log.range_truth, log.scenario.receiver
    if ranges is None or truth is None or receiver is None:
        raise LogError(f"{path}: RINEX holds ranges, but the scenario {log.scenario.name} has none; write another format")
    journey = log.scenario.journey
    header = _observation_header(log, sorted(receiver.systems), int(ranges.t_ns[0]))
    _write_lines(path.with_suffix(".obs"), chain(header, _observation_lines(ranges, truth)))
    _write_lines(path.with_suffix(".nav"), _navigation_lines(orbits_of(journey, receiver), journey, ranges.klobuchar))
    write_imu(log.imu, path.with_suffix(".imu.csv"))


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")


def _calendar(t_ns: int) -> datetime:
    """The calendar time that a clock without leap seconds shows."""
    return datetime(1980, 1, 6) + timedelta(microseconds=t_ns // 1000)


def _labelled(text: str, label: str) -> str:
    return f"{text:<60}{label:<20}"


def _leap_seconds(t_ns: int) -> int:
    return (t_ns - int(utc_from_gps(np.array([t_ns]))[0])) // _S + GPS_EPOCH_UNIX_S


def _program_line(t_ns: int) -> str:
    """Dated by the log, so that the same log gives the same file."""
    return _labelled(f"{'navreplay':<20}{'synthetic_logs':<20}{_calendar(t_ns):%Y%m%d %H%M%S} UTC", "PGM / RUN BY / DATE")


def _observation_header(log: SyntheticLog, systems: list[str], t_ns: int) -> Iterator[str]:
    position = ecef_from_lla(log.truth.lla[0])
    first = _calendar(t_ns)
    yield _labelled(f"{3.04:9.2f}{'':11}{'OBSERVATION DATA':<20}{'M':<20}", "RINEX VERSION / TYPE")
    yield _program_line(t_ns)
    yield _labelled(log.scenario.name, "MARKER NAME")
    yield _labelled("NON_GEODETIC" if log.truth.vel_n.any() else "GEODETIC", "MARKER TYPE")
    yield _labelled(f"{'navreplay':<20}", "OBSERVER / AGENCY")
    yield _labelled(f"{log.seed:<20}{'SYNTHETIC':<20}", "REC # / TYPE / VERS")
    yield _labelled("", "ANT # / TYPE")
    yield _labelled("".join(f"{axis:14.4f}" for axis in position), "APPROX POSITION XYZ")
    yield _labelled(f"{0:14.4f}" * 3, "ANTENNA: DELTA H/E/N")
    for system in systems:
        kinds = "".join(f" {kind}{SIGNALS[system]}" for kind in "CDS")
        yield _labelled(f"{system}{3:5d}{kinds}", "SYS / # / OBS TYPES")
        yield _labelled(f"{system} L{SIGNALS[system]}", "SYS / PHASE SHIFT")
    date = "".join(f"{part:6d}" for part in first.timetuple()[:5])
    yield _labelled(f"{date}{first.second + t_ns % _S / _S:13.7f}     GPS", "TIME OF FIRST OBS")
    yield _labelled(f"{_leap_seconds(t_ns):6d}", "LEAP SECONDS")
    yield _labelled("", "END OF HEADER")


def _observation_lines(ranges: RangeSeries, truth: RangeTruth) -> Iterator[str]:
    pseudorange = (ranges.pseudorange - truth.satellite_clock).tolist()
    doppler = (-(ranges.range_rate - truth.satellite_clock_rate) * carrier_of(ranges.sat) / SPEED_OF_LIGHT).tolist()
    names, cn0, starts = ranges.sat.tolist(), ranges.cn0.tolist(), ranges.epoch_starts.tolist()
    for start, end in pairwise(starts):
        t_ns = int(ranges.t_ns[start])
        time = _calendar(t_ns)
        yield f"> {time:%Y %m %d %H %M}{time.second + t_ns % _S / _S:11.7f}  0{end - start:3d}"
        for row in range(start, end):
            yield f"{names[row]}{pseudorange[row]:14.3f}  {doppler[row]:14.3f}  {cn0[row]:14.3f}  "


def _navigation_lines(orbits: Orbits, journey: Journey, klobuchar: Floats | None) -> Iterator[str]:
    yield _labelled(f"{3.04:9.2f}{'':11}{'N: GNSS NAV DATA':<20}{'M: MIXED':<20}", "RINEX VERSION / TYPE")
    yield _program_line(journey.start_ns)
    if klobuchar is not None:
        for name, values in (("GPSA", klobuchar[:4]), ("GPSB", klobuchar[4:])):
            yield _labelled(f"{name} " + "".join(f"{value:12.4E}" for value in values), "IONOSPHERIC CORR")
    yield _labelled(f"{_leap_seconds(journey.start_ns):6d}", "LEAP SECONDS")
    yield _labelled("", "END OF HEADER")
    for system, issue in issues(orbits, journey):
        for row in range(len(issue)):
            yield from _ephemeris_lines(issue, row, system)


def _ephemeris_lines(issue: Orbits, row: int, system: str) -> Iterator[str]:
    """The record of one satellite (RINEX 3.04, tables A6, A8, A14)."""

    def numbers(*values: float) -> str:
        """Fields D19.12."""
        return "".join(f"{value:19.12E}" for value in values)

    time_ns = issue.reference_ns - AHEAD_S[system] * _S
    week, time_of_week = divmod(time_ns // _S, WEEK_S)
    issue_number = time_of_week // 3600
    node = ascending_node(issue, AHEAD_S[system])
    delay = issue.group_delay[row]
    week -= WEEKS_BEFORE[system]
    source = {"G": 1, "E": _GALILEO_INAV_E1B, "C": 0}[system]
    accuracy = {"G": 2.0, "E": 3.12, "C": 2.0}[system]
    last = {"G": (delay, issue_number), "E": (delay, delay), "C": (delay, 0.0)}[system]
    end = {"G": 4.0, "E": 0.0, "C": issue_number}[system]
    lines = (
        (issue_number, issue.crs[row], issue.delta_n[row], issue.mean_anomaly[row]),
        (issue.cuc[row], issue.eccentricity[row], issue.cus[row], issue.sqrt_a[row]),
        (time_of_week, issue.cic[row], node[row], issue.cis[row]),
        (issue.inclination[row], issue.crc[row], issue.perigee[row], issue.node_rate[row]),
        (issue.inclination_rate[row], source, week, 0.0),
        (accuracy, 0.0, *last),
        (time_of_week - 3600, end, 0.0, 0.0),
    )
    yield f"{issue.sat[row]} {_calendar(time_ns):%Y %m %d %H %M %S}{numbers(issue.af0[row], issue.af1[row], 0.0)}"
    for line in lines:
        yield f"    {numbers(*line)}"
