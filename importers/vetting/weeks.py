"""Fixes of a receiver whose week counter rolled over: 1024 weeks, or a multiple, away from the IMU."""

from dataclasses import replace

from importers.findings import Finding
from importers.vetting.vetted import Vetted
from navreplay.timeline import GnssFixSeries, ImuSeries

__all__ = ["unroll_weeks"]

_ROLLOVER_NS = 1024 * 604_800 * 10**9
_NEAR_NS = 86_400 * 10**9


def unroll_weeks(fixes: GnssFixSeries, imu: ImuSeries | None) -> Vetted:
    """The fixes moved by whole rollovers, where only so moved they overlap the IMU."""
    if imu is None:
        return Vetted(fixes)
    apart = int(imu.t_ns[0]) - int(fixes.t_ns[0])
    turns = round(apart / _ROLLOVER_NS)
    if turns == 0 or abs(apart - turns * _ROLLOVER_NS) > _NEAR_NS:
        return Vetted(fixes)
    moved = fixes.t_ns + turns * _ROLLOVER_NS
    if moved[-1] < imu.t_ns[0] or moved[0] > imu.t_ns[-1]:
        return Vetted(fixes)
    text = (
        f"The fixes are stamped {abs(turns) * 1024} weeks {'before' if turns > 0 else 'behind'} the IMU, to the second of "
        f"the week the "
        "same: the receiver's week counter rolled over."
    )
    finding = Finding("warning", "week-rollover", text, "They are moved by that; nothing need be set.")
    return Vetted(replace(fixes, t_ns=moved), (finding,))
