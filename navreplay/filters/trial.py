"""Where a filter starts in motion, or nobody knows its heading: attitudes tried over the first measurements.

A course is a heading only where the vehicle points the way it goes, and levelling in motion rests on noisy accelerations. What
the inertial sensors feel against what the measurements do decides: the filter is run over the first 40 s from headings all
around and from the tilt that is usual in the log, and the start is changed only where another one predicts clearly better.
"""

from dataclasses import replace

import numpy as np

from navreplay.adapt.fixed import Fixed
from navreplay.aiding.guidance import Guidance
from navreplay.error_models.ned import ATTITUDE
from navreplay.filters.consider import Setup
from navreplay.filters.epochs import run_epochs
from navreplay.geodesy import rotation
from navreplay.mechanisation.strapdown import NavState, make_steps
from navreplay.options import FilterOptions
from navreplay.start.alignment import level
from navreplay.timeline import Floats, ImuSeries, LogError
from navreplay.update.record import Recorder

__all__ = ["settle_attitude"]

_TRIED_NS = 40_000_000_000
_HEADINGS = 8
_HEADING_STD = np.radians(25)
_TILT_STD = np.radians(4)
_CONTRADICTED = 1.5
_BETTER = 0.6
_CAP = 100.0


def settle_attitude(
    guidance: Guidance,
    imu: ImuSeries,
    setup: Setup,
    options: FilterOptions,
    recorder: Recorder,
    start_ns: int,
    state: NavState,
    cov: Floats,
) -> tuple[NavState, Floats]:
    """State and cov (n, n) at start_ns as given or, where those are contradicted, with the attitude that the measurements of
    the first 40 s bear out best."""
    trial = _Trial(guidance, imu, setup, options, start_ns)
    if trial.epochs < 5:
        return state, cov
    told = trial.misfit(state, cov)
    if told < _CONTRADICTED:
        return state, cov
    wide = cov.copy()
    wide[ATTITUDE, :] = wide[:, ATTITUDE] = 0.0
    wide[ATTITUDE, ATTITUDE] = np.diag(np.square([_TILT_STD, _TILT_STD, _HEADING_STD]))
    candidates = [replace(state, q_nb=q_nb) for q_nb in _attitudes(imu, state.q_nb)]
    misfits = [trial.misfit(candidate, wide) for candidate in candidates]
    best = int(np.argmin(misfits))
    if not misfits[best] < _BETTER * told:
        return state, cov
    yaw = np.degrees(rotation.euler_from_quat(candidates[best].q_nb)[2]) % 360
    text = (
        f"the attitude found at the start contradicts the first {_TRIED_NS / 1e9:.0f} s; of {len(candidates)} tried, one with "
        f"heading {yaw:.0f} deg predicts them best (mean square {misfits[best]:.2g} instead of {told:.2g})"
    )
    recorder.tell(start_ns, "warning", text)
    return candidates[best], wide


def _attitudes(imu: ImuSeries, q_nb: Floats) -> list[Floats]:
    """Headings all around, with the tilt of q_nb (4,) and with that which the IMU usually has."""
    roll, pitch, yaw = rotation.euler_from_quat(q_nb).tolist()
    tilts = [(roll, pitch), level(np.median(imu.accel, axis=0))]
    turns = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    return [rotation.quat_from_euler(*tilt, yaw + turn) for tilt in tilts for turn in turns.tolist()]


class _Trial:
    """The filter, without adaptation, over the first epochs behind a start."""

    def __init__(self, guidance: Guidance, imu: ImuSeries, setup: Setup, options: FilterOptions, start_ns: int) -> None:
        end_ns = min(start_ns + _TRIED_NS, int(imu.t_ns[-1]))
        t_ns = guidance.aiding.t_ns
        self._epochs = np.flatnonzero((t_ns > start_ns) & (t_ns <= end_ns))
        self.epochs = len(self._epochs)
        plain = replace(setup.method, adapter=Fixed(), weighting=None, tracking=None)
        self._setup = setup._replace(method=plain)
        self._guidance, self._options = guidance, replace(options, smooth=False)
        last = min(int(np.searchsorted(imu.t_ns, end_ns)) + 2, len(imu.t_ns))
        part = ImuSeries(imu.t_ns[:last], imu.gyro[:last], imu.accel[:last], imu.increments)
        self._steps = make_steps(part, np.append(t_ns[self._epochs], start_ns)).after(start_ns) if self.epochs else None

    def misfit(self, state: NavState, cov: Floats) -> float:
        """Mean normalised square per component of the innovations, faults capped; infinite where the filter breaks."""
        assert self._steps is not None
        recorder = Recorder()
        t_ns = self._guidance.aiding.t_ns
        estimator = self._setup.estimator(self._guidance.gate(self._options.gate), recorder)
        nodes = t_ns[self._epochs]
        try:
            run_epochs(
                *(self._steps, nodes, t_ns, self._epochs, state, cov, estimator, self._setup.model, self._options),
                lambda _: None,
            )
        except LogError:
            return float("inf")
        squares = [np.minimum(series.nis / series.residual.shape[1], _CAP) for series in recorder.series()]
        return float(np.concatenate(squares).mean()) if squares else float("inf")
