"""Faults of clocks: offsets, steps and drifts of the IMU's stamps against the receiver's, batches, and lost samples."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navreplay.timeline import ImuSeries
from synthetic_logs.faults.fault import Fault, Spoilt, seconds
from synthetic_logs.simulation import SyntheticLog

__all__ = ["FAULTS"]


def _keep(imu: ImuSeries, keep: np.ndarray) -> ImuSeries:
    return ImuSeries(imu.t_ns[keep], imu.gyro[keep], imu.accel[keep], imu.increments)


def _offset(by: float) -> Callable[[SyntheticLog], Spoilt]:
    """Stamps of the IMU by so many seconds late."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        return Spoilt(replace(log, imu=replace(log.imu, t_ns=log.imu.t_ns + round(by * 1e9))))

    return spoil


def _jitter(size: float) -> Callable[[SyntheticLog], Spoilt]:
    """Stamps of the IMU at arrival: exponential delays of mean size [s], in order."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        rng = np.random.default_rng(log.seed + 73)
        late = np.rint(rng.exponential(size, len(log.imu.t_ns)) * 1e9).astype(np.int64)
        stamps = np.maximum.accumulate(log.imu.t_ns + late) + np.arange(len(late))
        return Spoilt(replace(log, imu=replace(log.imu, t_ns=stamps)))

    return spoil


def _gap(start: float, length: float) -> Callable[[SyntheticLog], Spoilt]:
    """Samples of the IMU lost for length [s]."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        at = seconds(log.imu.t_ns, int(log.imu.t_ns[0]))
        return Spoilt(replace(log, imu=_keep(log.imu, (at < start) | (at >= start + length))), ((start, start + length),))

    return spoil


def _lost(share: float) -> Callable[[SyntheticLog], Spoilt]:
    """A share of the IMU's samples lost here and there."""

    def spoil(log: SyntheticLog) -> Spoilt:
        """Does it."""
        rng = np.random.default_rng(log.seed + 79)
        return Spoilt(replace(log, imu=_keep(log.imu, rng.random(len(log.imu.t_ns)) >= share)))

    return spoil


FAULTS: tuple[Fault, ...] = (
    *(
        Fault(f"imu-late-{by:g}s", "clock", f"stamps of the IMU {by:g} s late", _offset(by))
        for by in (-0.5, -0.2, -0.05, 0.05, 0.2, 0.5)
    ),
    Fault("imu-jitter-5ms", "clock", "stamps of the IMU at arrival, 5 ms late in the mean", _jitter(0.005)),
    Fault("imu-gap-2s", "clock", "samples of the IMU lost for 2 s", _gap(50.0, 2.0)),
    Fault("imu-lost-10-percent", "clock", "a tenth of the IMU's samples lost here and there", _lost(0.1)),
)
"""Faults of clocks."""
