"""Fixes of a receiver whose week counter rolled over: 1024 weeks, or a multiple, away from the IMU."""

from dataclasses import replace

import numpy as np

from importers.findings import Finding
from importers.preflight.motion_match import match_yaw
from importers.vetting.vetted import Vetted
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, utc_from_gps
from navreplay.timeline import GnssFixSeries, ImuSeries

__all__ = ["unroll_weeks"]

_ROLLOVER_NS = 1024 * 604_800 * 10**9
_SURE = 0.8
_TOGETHER_S = 1.0
_NEAR_NS = 86_400 * 10**9


def unroll_weeks(fixes: GnssFixSeries, imu: ImuSeries | None) -> Vetted:
    """The fixes moved by whole rollovers, where only so moved they overlap the IMU; and by the leap seconds in between, since
    dates are told in UTC, unless the turns that both saw say that they are not."""
    if imu is None:
        return Vetted(fixes)
    apart = int(imu.t_ns[0]) - int(fixes.t_ns[0])
    turns = round(apart / _ROLLOVER_NS)
    if turns == 0 or abs(apart - turns * _ROLLOVER_NS) > _NEAR_NS:
        return Vetted(fixes)
    moved = fixes.t_ns + turns * _ROLLOVER_NS
    leaps = _leaps(int(moved[0])) - _leaps(int(fixes.t_ns[0]))
    if leaps and not _agrees(replace(fixes, t_ns=moved), imu):
        moved = moved + leaps
    if moved[-1] < imu.t_ns[0] or moved[0] > imu.t_ns[-1]:
        return Vetted(fixes)
    text = (
        f"The fixes are stamped {abs(turns) * 1024} weeks {'before' if turns > 0 else 'behind'} the IMU: the receiver's week "
        "counter rolled over."
    )
    finding = Finding("warning", "week-rollover", text, "They are moved by that; nothing need be set.")
    return Vetted(replace(fixes, t_ns=moved), (finding,))


def _leaps(t_ns: int) -> int:
    """GPS time ahead of UTC then [ns]."""
    return t_ns - (int(utc_from_gps(np.array([t_ns]))[0]) - GPS_EPOCH_UNIX_S * 10**9)


def _agrees(fixes: GnssFixSeries, imu: ImuSeries) -> bool:
    """Whether turns show at one time in both."""
    match = match_yaw(imu, fixes)
    return match is not None and abs(match.correlation) > _SURE and abs(match.offset_s) < _TOGETHER_S
