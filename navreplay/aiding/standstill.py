"""Aiding by standstill: a vehicle at rest has velocity zero (zero-velocity update, ZUPT; Groves (2013), 15.3) and does not
turn."""

from typing import NamedTuple

import numpy as np

from navreplay.aiding.epochs import Observed
from navreplay.error_models.clocked import motion_size
from navreplay.error_models.error_model import ErrorModel
from navreplay.geodesy.earth import earth_rate_n
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.measurements.body_velocity import zero_rate_measurement
from navreplay.measurements.fixes import angular_rate, velocity_measurement
from navreplay.measurements.mean_rates import mean_rates
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import GateOptions
from navreplay.timeline import Floats, ImuSeries, Times
from navreplay.update.gate import Gate, Verdict
from navreplay.update.gaussian import Innovation
from navreplay.update.measurement import join
from navreplay.update.reopening import Widening

__all__ = ["StandstillAiding", "StopGate", "StopRates", "standstill_candidates", "stop_rates"]

_PROBABILITY = 0.9999
"""Of a true standstill to pass the gate, at most."""
_ALONE_NS = 1_000_000_000
"""Time between standstill epochs where nothing else is measured."""
_SAME_STOP_NS = 3_000_000_000
"""Between epochs of one stop, at most."""
_PATIENCE_NS = 10_000_000_000
"""How long a filter without anything else to aid it is believed against a stop."""


class StopRates(NamedTuple):
    """rates (e, 3): mean angular rates, as sensed, of what leads to each epoch; stds (e,) of their white noise [rad/s]."""

    rates: Floats
    stds: Floats


def stop_rates(imu: ImuSeries, t_ns: Times, gyro_noise: float) -> StopRates:
    """Of stretches of a second, or from the epoch before, that end at t_ns (e,); none is used twice. gyro_noise
    [rad/s/sqrt(Hz)]."""
    start_ns = np.maximum(t_ns - _ALONE_NS, np.concatenate([t_ns[:1] - _ALONE_NS, t_ns[:-1]]))
    return StopRates(mean_rates(imu, start_ns, t_ns), gyro_noise / np.sqrt((t_ns - start_ns) / 1e9))


class StandstillAiding:
    """Velocity zero of the IMU, with standard deviation std [m/s] per axis, at t_ns (e,), and angular rate zero where rates are
    given. aided_ns (k,): times of what else aids the filter."""

    name = "standstills"
    kinds = frozenset({"standstill", "zero_rate"})

    def __init__(
        self, t_ns: Times, std: float, model: ErrorModel, rates: StopRates | None = None, aided_ns: Times | None = None
    ) -> None:
        self.t_ns = t_ns
        self._noise = np.eye(3) * std**2
        self._motion, self._size = motion_size(model), model.size
        self._rates = rates
        self._aided_ns = np.empty(0, np.int64) if aided_ns is None else aided_ns

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """Velocity zero, NED, and angular rate zero, body axes."""
        zero = np.zeros(3)
        measured = velocity_measurement(state, zero, angular_rate(state, dtheta, dt), zero, self._noise, self._motion)
        parts = [measured._replace(kinds=("standstill",) * 3)]
        if self._rates is not None:
            c_nb = matrix_from_quat(state.q_nb)
            earth_b = c_nb.T @ earth_rate_n(state.lla[0])
            rate_b = (self._rates.rates[epoch] - state.gyro_error) / (1 + state.gyro_scale) - earth_b
            parts.append(zero_rate_measurement(rate_b, earth_b, c_nb, float(self._rates.stds[epoch]), self._motion))
        return Observed(join(parts).among(self._size), state, cov)

    def gate(self, options: GateOptions) -> "StopGate":
        """A gate of its own that is never switched off."""
        return StopGate(options, self._aided_ns)


class StopGate:
    """Refuses a standstill that contradicts the filter. Where a stop of 10 s is refused throughout and nothing else has aided
    the filter meanwhile, the filter is in doubt, and the stop is let in with a wider velocity: fixes that were used would know
    motion, and a smooth stretch of road is shorter."""

    def __init__(self, options: GateOptions, aided_ns: Times) -> None:
        self._gate = Gate(GateOptions(min(options.probability, _PROBABILITY), reset_after=0))
        self._reset_after = options.reset_after
        self._aided_ns = aided_ns
        self._refused: list[int] = []

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m); a stop is refused as a whole."""
        verdict = self._gate.judge(kinds, innovation, noise)
        if not verdict.reasons["standstill"]:
            self._refused = []
            return verdict
        if self._refused and innovation.t_ns - self._refused[-1] > _SAME_STOP_NS:
            self._refused = []
        self._refused.append(innovation.t_ns)
        if self._must_reopen():
            rows = [i for i, kind in enumerate(kinds) if kind == "standstill"]
            residual = innovation.residual[rows]
            seconds = (self._refused[-1] - self._refused[0]) / 1e9
            widening = Widening("standstill", float(residual @ residual), len(self._refused), seconds)
            self._refused = []
            return Verdict(np.array(rows), verdict.nis, {**verdict.reasons, "standstill": ""}, (widening,))
        beside = {kind: reason or "the standstill beside it is refused" for kind, reason in verdict.reasons.items()}
        return Verdict(np.empty(0, dtype=np.intp), verdict.nis, beside, ())

    def _must_reopen(self) -> bool:
        first, last = self._refused[0], self._refused[-1]
        aided = np.searchsorted(self._aided_ns, last, side="right") > np.searchsorted(self._aided_ns, first)
        return 0 < self._reset_after <= len(self._refused) and last - first >= _PATIENCE_NS and not aided


def standstill_candidates(main_ns: Times, start_ns: int, end_ns: int) -> Times:
    """(e,) times at which standstill may be measured: those of other measurements main_ns (k,), and once a second from
    start_ns to end_ns where there is none."""
    beside = np.arange(start_ns + _ALONE_NS, end_ns, _ALONE_NS, dtype=np.int64)
    edges = np.concatenate([[start_ns - _ALONE_NS], main_ns, [end_ns + _ALONE_NS]])
    later = edges[np.searchsorted(edges, beside)]
    earlier = edges[np.searchsorted(edges, beside, side="right") - 1]
    alone = beside[np.minimum(later - beside, beside - earlier) >= _ALONE_NS]
    return np.union1d(main_ns[(main_ns >= start_ns) & (main_ns <= end_ns)], alone)
