"""Aiding by measured attitudes: of a star tracker, an AHRS, or the heading of two antennas."""

from typing import NamedTuple

import numpy as np

from navreplay.attitude_measurements import attitude_measurement, attitude_noise, heading_measurement
from navreplay.error_models.error_model import ErrorModel
from navreplay.filters.core import Innovation
from navreplay.filters.gate import Gate
from navreplay.filters.record import Recorder
from navreplay.filters.update import Aiding, EpochGate, Observed, Verdict
from navreplay.measurements import join
from navreplay.options import AttitudeOptions
from navreplay.strapdown import NavState
from navreplay.timeline import AttitudeSeries, Floats, Times

__all__ = ["AttitudeAiding", "JointAiding", "JointGate", "JointVerdict"]

_KINDS = ("attitude", "heading")


class AttitudeAiding:
    """Attitudes with their told noise, for any error model."""

    name = "attitudes"

    def __init__(self, attitude: AttitudeSeries, model: ErrorModel, options: AttitudeOptions) -> None:
        self.model = model
        self._attitude = attitude
        self._noise = attitude_noise(attitude, options)
        self._measure = heading_measurement if attitude.heading_only else attitude_measurement

    @property
    def t_ns(self) -> Times:
        """(e,) times of the attitudes."""
        return self._attitude.t_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The attitude with index epoch."""
        return Observed(self._measure(state, self._attitude, epoch, self._noise[epoch], self.model.size), state, cov)


class JointAiding:
    """Attitudes beside positions or ranges: epochs of one or the other, and of both where they share a time."""

    def __init__(self, main: Aiding, attitudes: AttitudeAiding) -> None:
        self.name = f"{main.name} and {attitudes.name}"
        self._main = main
        self._attitudes = attitudes
        self._t_ns = np.union1d(main.t_ns, attitudes.t_ns)
        self._main_epoch = _epochs_at(self._t_ns, main.t_ns)
        self._attitude_epoch = _epochs_at(self._t_ns, attitudes.t_ns)

    @property
    def t_ns(self) -> Times:
        """(e,) times of all epochs."""
        return self._t_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """What there is at the epoch with that index, attitudes last."""
        main, attitude = int(self._main_epoch[epoch]), int(self._attitude_epoch[epoch])
        observed = Observed(None, state, cov)
        if main >= 0:
            observed = self._main.observe(main, state, cov, dtheta, dt)
        if attitude < 0:
            return observed
        measured = self._attitudes.observe(attitude, observed.state, observed.cov, dtheta, dt).measurement
        parts = [part for part in (observed.measurement, measured) if part is not None]
        return Observed(join(parts), observed.state, observed.cov)


def _epochs_at(t_ns: Times, own_ns: Times) -> np.ndarray:
    """(e,) index into own_ns (k,) of each of the times t_ns (e,), -1 where it is none of them."""
    epochs = np.full(len(t_ns), -1)
    epochs[np.searchsorted(t_ns, own_ns)] = np.arange(len(own_ns))
    return epochs


class JointVerdict(NamedTuple):
    """The verdicts of two gates on their parts of an epoch, with the index of each part's components."""

    verdicts: tuple[Verdict, ...]
    rows: tuple[np.ndarray, ...]

    @property
    def passed(self) -> np.ndarray:
        """(k,) indices of the components to use."""
        return np.concatenate([rows[verdict.passed] for verdict, rows in zip(self.verdicts, self.rows, strict=True)])

    @property
    def inflation(self) -> float:
        """The larger factor on the prior covariance."""
        return max(verdict.inflation for verdict in self.verdicts)

    @property
    def run(self) -> int:
        """Rejected epochs in a row, of the part that has more of them."""
        return max(verdict.run for verdict in self.verdicts)

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdicts on them."""
        for verdict, rows in zip(self.verdicts, self.rows, strict=True):
            own = tuple(kinds[i] for i in rows)
            verdict.record(recorder, t_ns, own, innovation.select(rows), noise[rows[:, None], rows])


class JointGate:
    """Judges attitudes by a gate of their own, so that one sensor's failure does not count for the other."""

    def __init__(self, main: EpochGate, attitudes: Gate) -> None:
        self._main = main
        self._attitudes = attitudes

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> JointVerdict:
        """The verdicts on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        turned = np.array([kind in _KINDS for kind in kinds])
        verdicts, parts = [], []
        for gate, rows in ((self._main, np.flatnonzero(~turned)), (self._attitudes, np.flatnonzero(turned))):
            if len(rows):
                own = tuple(kinds[i] for i in rows)
                verdicts.append(gate.judge(own, innovation.select(rows), noise[rows[:, None], rows]))
                parts.append(rows)
        return JointVerdict(tuple(verdicts), tuple(parts))
