"""Aiding by pseudoranges and range rates: tightly coupled, or alone."""

from dataclasses import replace

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.aiding.fixes import start_at_fix
from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.free_motion import FreeMotionModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.error_models.receiver_clock import ReceiverClock
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.measurements.fixes import angular_rate, fix_noise
from navreplay.measurements.least_squares import fixes_of, solve_points
from navreplay.measurements.ranges import Antenna, RangeNoise, carried_antenna, free_antenna, range_measurement
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions
from navreplay.start.alignment import Alignment
from navreplay.timeline import Floats, GnssFixSeries, RangeSeries, Times
from navreplay.update.measurement import Measurement
from navreplay.update.record import Recorder

__all__ = ["RangeAiding"]

_MILLISECOND = SPEED_OF_LIGHT / 1000
_ODD_JUMP_STD = 30.0
_DRIFT_STD = 10.0
"""Of a clock drift [m/s] where the rates of the first epoch do not give it."""
_DOUBT = 100.0
"""Variance of a first position whose errors are estimated, over that of white noise."""


class RangeAiding:
    """Ranges of one receiver, carried by an IMU (with that error model) or moving freely (None).

    fixes: least-squares positions of the epochs that are trusted with it, from which a filter is aligned and started.
    """

    name = "ranges"

    def __init__(
        self,
        ranges: RangeSeries,
        lever_b: Floats,
        inertial: NedErrorModel | None,
        options: FilterOptions,
        recorder: Recorder,
    ) -> None:
        self._points, self._epochs, left_out = solve_points(ranges, options.ranges)
        self.fixes = fixes_of(self._points)
        self._lever_b = lever_b
        self._options = options
        self._recorder = recorder
        sats = tuple(np.unique(self._epochs.sat).tolist()) if options.ranges.multipath_share > 0 else ()
        clock = ReceiverClock(self._points.groups, options.ranges, sats)
        self._inertial = inertial
        self._free = FreeMotionModel(options.motion)
        self.model = ClockedModel(self._free if inertial is None else inertial, clock)
        self._scale = options.noise_scale**2
        self._drift = len(clock.groups)
        self._noise = self._share_noise(sats)
        if left_out:
            counts = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
            recorder.tell(int(ranges.t_ns[0]), "info", f"of {len(ranges)} ranges are left out: {counts}")

    def _share_noise(self, sats: tuple[str, ...]) -> RangeNoise:
        """White noise and multipath of all rows."""
        options = self._options.ranges
        variance = self._epochs.pseudorange_std**2 * self._scale * options.pseudorange_noise_scale**2
        rate = self._epochs.range_rate_std**2 * self._scale * options.range_rate_noise_scale**2
        state = self._drift + 1 + np.searchsorted(sats, self._epochs.sat) if sats else np.full(len(variance), -1)
        white, multipath = variance * (1 - options.multipath_share), variance * options.multipath_share
        return RangeNoise(white, rate, np.sqrt(multipath), state)

    @property
    def told_fixes(self) -> GnssFixSeries:
        """The least-squares positions, for an alignment that weighs them."""
        return self.fixes

    @property
    def t_ns(self) -> Times:
        """(e,) times of the epochs."""
        return self._epochs.t_ns

    def start(self, alignment: Alignment) -> tuple[NavState, Floats]:
        """State and covariance (n, n) of the IMU at the alignment's epoch. Only where an IMU carries the receiver."""
        assert self._inertial is not None
        noise = fix_noise(self.fixes, self._options)
        state, cov = start_at_fix(self._inertial, self.fixes, noise, alignment, self._lever_b)
        return self._with_clock(alignment.fix, state, cov)

    def start_alone(self) -> tuple[int, NavState, Floats]:
        """Time, state and covariance (n, n) of the antenna at the first epoch with a position."""
        noise = fix_noise(self.fixes, self._options)
        known = bool(self.fixes.has_velocity[0])
        velocity = self.fixes.vel_n[0] if known else np.zeros(3)
        cov_vel = noise.velocity[0] if known else np.eye(3) * _DRIFT_STD**2
        state, cov = self._free.start(self.fixes.lla[0], velocity, noise.position[0], cov_vel)
        return int(self.fixes.t_ns[0]), *self._with_clock(0, state, cov)

    def _with_clock(self, fix: int, state: NavState, cov: Floats) -> tuple[NavState, Floats]:
        """The clock of a fix's epoch put behind state and cov, with the covariances it has with the position."""
        points = self._points
        epoch = int(np.flatnonzero(points.trusted)[fix])
        n, offsets = len(cov), points.clock[epoch]
        seen = np.isfinite(offsets)
        full = np.zeros((self.model.size, self.model.size))
        full[:n, :n] = cov
        full[range(n, n + len(offsets)), range(n, n + len(offsets))] = self._options.ranges.system_offset_std**2
        known = np.concatenate([np.ones(3, dtype=np.bool_), seen])
        at = np.concatenate([np.arange(3), np.arange(n, n + len(offsets))])[known]
        full[np.ix_(at, at)] = points.cov_pos[epoch][np.ix_(known, known)] * self._scale
        full[:3, :3] = cov[:3, :3]
        multipath = self.model.size - (n + self._drift + 1)
        if multipath:
            # the multipath behind this position comes again with the next epochs, and must not count twice
            full[np.ix_(at, at)] += _DOUBT * points.cov_pos[epoch][np.ix_(known, known)] * self._scale
            full[range(-multipath, 0), range(-multipath, 0)] = 1.0
        drift, at_drift = float(points.drift[epoch]), n + self._drift
        if np.isfinite(drift):
            full[at_drift, 3:6] = full[3:6, at_drift] = points.cov_vel[epoch, 3, :3] * self._scale
            full[at_drift, at_drift] = points.cov_vel[epoch, 3, 3] * self._scale
        else:
            drift, full[at_drift, at_drift] = self._drift_of_offsets(epoch), _DRIFT_STD**2
        clock = np.concatenate([np.where(seen, offsets, np.nanmean(offsets)), [drift], np.zeros(multipath)])
        return replace(state, clock=clock), full

    def _drift_of_offsets(self, epoch: int) -> float:
        """Slope of the clock offset over the solved epochs about one [m/s]; 0 where it stands alone."""
        solved = np.flatnonzero(np.isfinite(self._points.clock[:, 0]))
        near = solved[np.argsort(np.abs(solved - epoch))[:5]]
        if len(near) < 2:
            return 0.0
        since = (self.t_ns[near] - self.t_ns[epoch]) / 1e9
        return float(np.polyfit(since, self._points.clock[near, 0], 1)[0])

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The ranges of an epoch; where they show that the receiver clock has jumped, against the clock after its jump."""
        rows = slice(int(self._epochs.starts[epoch]), int(self._epochs.starts[epoch + 1]))
        if rows.start == rows.stop:
            return Observed(None, state, cov)
        n = self.model.motion.size
        if self._inertial is not None:
            antenna = carried_antenna(state, self._lever_b, angular_rate(state, dtheta, dt), n)
        else:
            antenna = free_antenna(state, n)
        measurement = self._measure(antenna, state, rows)
        jump, odd = _find_clock_jump(measurement, float(np.sqrt(cov[n, n])), self._options.ranges.clock_jump)
        if jump:
            text = f"the receiver clock jumped by {jump / _MILLISECOND:+.6f} ms ({jump:+.1f} m); its offset follows"
            self._recorder.tell(int(self.t_ns[epoch]), "info", text)
            clock, cov = state.clock.copy(), cov.copy()
            clock[: self._drift] += jump
            state = replace(state, clock=clock)
            cov[n : n + self._drift, n : n + self._drift] += odd**2
            measurement = self._measure(antenna, state, rows)
        return Observed(measurement, state, cov)

    def _measure(self, antenna: Antenna, state: NavState, rows: slice) -> Measurement:
        return range_measurement(antenna, state.clock, self._epochs, rows, self._noise)


def _find_clock_jump(measurement: Measurement, offset_std: float, limit: float) -> tuple[float, float]:
    """What all pseudoranges have jumped by [m] and its standard deviation; (0, 0) where there is no jump.

    A jump is common to at least half of the satellites, and beyond limit [m] and ten standard deviations of the clock offset.
    Whole milliseconds are taken as such; another jump must be seen by three satellites.
    """
    residual = measurement.residual[: measurement.kinds.count("range")]
    jump = float(np.sort(residual)[len(residual) // 2])  # a median, without the cost of numpy's
    if abs(jump) < max(limit, 10 * offset_std):
        return 0.0, 0.0
    alike = np.abs(residual - jump) < limit
    if 2 * alike.sum() < len(residual):
        return 0.0, 0.0
    whole = round(jump / _MILLISECOND) * _MILLISECOND
    if abs(jump - whole) < limit:
        return whole, 0.0
    return (float(np.median(residual[alike])), _ODD_JUMP_STD) if alike.sum() >= 3 else (0.0, 0.0)
