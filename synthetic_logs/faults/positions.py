"""Faults of positions: accuracy told wrong, fixes that come late, freeze, repeat or jump."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navreplay.geodesy.earth import move_lla
from navreplay.timeline import Floats, GnssFixSeries
from synthetic_logs.faults.fault import Fault, Spoilt, seconds
from synthetic_logs.simulation import SyntheticLog

__all__ = ["FAULTS"]


def _fixes(log: SyntheticLog) -> GnssFixSeries:
    assert log.fixes is not None
    return log.fixes


def _moved(fixes: GnssFixSeries, offset_n: Floats) -> GnssFixSeries:
    """Fixes whose positions are off by offset_n (n, 3) [m] NED."""
    return replace(fixes, lla=move_lla(fixes.lla, offset_n))


def _told(position: float, velocity: float) -> Callable[[SyntheticLog], Spoilt]:
    """Standard deviations told are these factors of the true ones."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        fixes = _fixes(log)
        told = replace(fixes, cov_pos=fixes.cov_pos * position**2, cov_vel=fixes.cov_vel * velocity**2)
        return Spoilt(replace(log, fixes=told))

    return spoil


def _slow_errors(size: float, told: float, period: float) -> Callable[[SyntheticLog], Spoilt]:
    """Positions that wander by size [m] within period [s], told as told [m]: a receiver's own smoothing of multipath."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        fixes = _fixes(log)
        phase = 2 * np.pi * seconds(fixes.t_ns, int(fixes.t_ns[0])) / period
        wander = size * np.column_stack([np.sin(phase), np.cos(0.71 * phase + 0.4), np.sin(0.53 * phase + 1.0)])
        cov = np.tile(np.eye(3) * told**2, (len(fixes), 1, 1))
        return Spoilt(replace(log, fixes=replace(_moved(fixes, wander), cov_pos=cov)))

    return spoil


def _late(least: float, most: float) -> Callable[[SyntheticLog], Spoilt]:
    """Fixes stamped least to most [s] late: at their arrival over a serial line, in place of their epoch."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        fixes = _fixes(log)
        rng = np.random.default_rng(log.seed + 71)
        late = np.rint(rng.uniform(least, most, len(fixes)) * 1e9).astype(np.int64)
        stamps = np.maximum.accumulate(fixes.t_ns + late)
        stamps += np.arange(len(stamps))  # equal ones a nanosecond apart
        within = stamps < log.imu.t_ns[-1]
        return Spoilt(replace(log, fixes=_rows(replace(fixes, t_ns=stamps), within)))

    return spoil


def _rows(fixes: GnssFixSeries, keep: np.ndarray) -> GnssFixSeries:
    parts = fixes.t_ns, fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel, fixes.status
    return GnssFixSeries(*(part[keep] for part in parts))


def _frozen(start: float, length: float) -> Callable[[SyntheticLog], Spoilt]:
    """The driver goes on publishing the last position (and no velocity) with new stamps for length [s]."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        fixes = _fixes(log)
        at = seconds(fixes.t_ns, int(fixes.t_ns[0]))
        inside = (at >= start) & (at < start + length)
        lla, vel_n, cov_vel = fixes.lla.copy(), fixes.vel_n.copy(), fixes.cov_vel.copy()
        lla[inside] = lla[np.flatnonzero(inside)[0] - 1]
        vel_n[inside], cov_vel[inside] = np.nan, np.nan
        return Spoilt(replace(log, fixes=replace(fixes, lla=lla, vel_n=vel_n, cov_vel=cov_vel)), ((start, start + length),))

    return spoil


def _jump(start: float, length: float, offset: float) -> Callable[[SyntheticLog], Spoilt]:
    """A wrong fix: positions off by offset [m] to the north-east for length [s], told as before."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        fixes = _fixes(log)
        at = seconds(fixes.t_ns, int(fixes.t_ns[0]))
        inside = (at >= start) & (at < start + length)
        by = np.where(inside[:, None], np.array([0.8, 0.6, -0.5]) * offset, 0.0)
        return Spoilt(replace(log, fixes=_moved(fixes, by)), ((start, start + length),))

    return spoil


def _twice(log: SyntheticLog) -> Spoilt:
    """Every fix is published twice, 1.5 ms apart."""
    fixes = _fixes(log)
    parts = fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel, fixes.status
    stamps = np.repeat(fixes.t_ns, 2)
    stamps[1::2] += 1_500_000
    return Spoilt(replace(log, fixes=GnssFixSeries(stamps, *(np.repeat(part, 2, axis=0) for part in parts))))


def _deviations_as_variances(log: SyntheticLog) -> Spoilt:
    """Standard deviations stand where variances belong."""
    fixes = _fixes(log)
    return Spoilt(replace(log, fixes=replace(fixes, cov_pos=np.sqrt(np.abs(fixes.cov_pos)) * np.eye(3))))


FAULTS: tuple[Fault, ...] = (
    *(
        Fault(f"told-position-{factor:g}", "told noise", f"positions told {factor:g} times their noise", _told(factor, 1.0))
        for factor in (0.02, 0.05, 0.2, 0.5, 2.0, 5.0, 20.0)
    ),
    *(
        Fault(f"told-velocity-{factor:g}", "told noise", f"velocities told {factor:g} times their noise", _told(1.0, factor))
        for factor in (0.02, 0.05, 0.2, 0.5, 2.0, 5.0, 20.0)
    ),
    *(
        Fault(f"told-both-{factor:g}", "told noise", f"all told {factor:g} times their noise", _told(factor, factor))
        for factor in (0.05, 0.2, 5.0, 20.0)
    ),
    *(
        Fault(
            f"slow-errors-{size:g}m-told-{told:g}m",
            "told noise",
            f"wandering by {size:g} m in {period:g} s, told as {told:g} m",
            _slow_errors(size, told, period),
        )
        for size, told, period in ((2.0, 0.01, 60.0), (1.0, 0.1, 40.0), (3.0, 0.02, 90.0), (0.5, 0.01, 20.0))
    ),
    Fault("deviations-as-variances", "told noise", "standard deviations where variances belong", _deviations_as_variances),
    *(
        Fault(f"late-{least:g}-{most:g}s", "latency", f"stamped {least:g} to {most:g} s late", _late(least, most))
        for least, most in ((0.1, 0.1), (0.3, 0.3), (0.05, 0.15), (0.15, 0.35), (0.3, 0.9), (0.8, 0.8))
    ),
    *(
        Fault(f"frozen-{length:g}s-at-{start:g}s", "frozen", f"last position repeated for {length:g} s", _frozen(start, length))
        for start, length in ((40.0, 3.0), (40.0, 5.0), (60.0, 15.0), (60.0, 30.0))
    ),
    *(
        Fault(f"jump-{offset:g}m-{length:g}s", "jump", f"off by {offset:g} m for {length:g} s", _jump(50.0, length, offset))
        for offset, length in ((1.0, 4.0), (3.0, 4.0), (3.0, 20.0), (30.0, 2.0), (200.0, 10.0), (5000.0, 5.0))
    ),
    Fault("twice", "frozen", "every fix twice, 1.5 ms apart", _twice),
)
"""Faults of positions."""
