"""The measurement epoch: measure, innovate, adapt, judge, condition, retract."""

from typing import Any

import numpy as np

from navreplay.error_models.ned import NedErrorModel
from navreplay.filters.core import Gaussian, condition
from navreplay.filters.gate import Gate
from navreplay.filters.presets import Method
from navreplay.filters.record import Recorder
from navreplay.measurements import FixNoise, Measurement, angular_rate, join, position_measurement, velocity_measurement
from navreplay.options import FilterOptions
from navreplay.solution import RowStatus
from navreplay.strapdown import NavState
from navreplay.timeline import Floats, GnssFixSeries

__all__ = ["FixUpdater"]


class FixUpdater:
    """Updates by GNSS fixes. Keeps the state of the adapter, the gate, and the record."""

    def __init__(
        self,
        fixes: GnssFixSeries,
        noise: FixNoise,
        lever_b: Floats,
        model: NedErrorModel,
        method: Method,
        options: FilterOptions,
        recorder: Recorder,
    ) -> None:
        self._fixes = fixes
        self._noise = noise
        self._lever_b = lever_b
        self._model = model
        self._method = method
        self._recorder = recorder
        self._has_position = fixes.has_position
        self._has_velocity = fixes.has_velocity & options.use_velocity
        self._gate = Gate(options.gate)
        self._adapter_state: Any = method.adapter.init()
        self._zero = np.zeros(model.size)

    def update(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> tuple[NavState, Floats, RowStatus]:
        """State and covariance after the fix with index epoch; dtheta (3,) [rad] and dt [s] are those of the step before it."""
        measurement = self._measure(epoch, state, dtheta, dt)
        if measurement is None:
            return state, cov, RowStatus.PREDICTED
        t_ns = int(self._fixes.t_ns[epoch])
        rule, adapter = self._method.rule, self._method.adapter
        prior = Gaussian(self._zero, cov)
        innovation = rule.innovate(prior, measurement)
        adapted, noise, self._adapter_state = adapter.adapt(self._adapter_state, prior, innovation)
        if adapted is not prior:
            innovation = rule.innovate(adapted, measurement)
        verdict = self._gate.judge(measurement.kinds, innovation, noise)
        if verdict.inflation > 1:
            adapted = Gaussian(self._zero, adapted.cov * verdict.inflation)
            innovation = rule.innovate(adapted, measurement)
            text = f"fixes were rejected {verdict.run} epochs in a row; covariance times {verdict.inflation:.1f}"
            self._recorder.tell(t_ns, "warning", text)
        for kind, judged in verdict.parts(measurement.kinds, innovation, noise):
            self._recorder.add(t_ns, kind, judged)
        if not len(verdict.passed):
            return state, cov, RowStatus.REJECTED
        if len(verdict.passed) < len(noise):
            innovation = innovation.select(verdict.passed)
            noise = noise[verdict.passed[:, None], verdict.passed]
        posterior = condition(adapted, innovation, noise)
        return self._model.retract(state, posterior.mean), posterior.cov, RowStatus.UPDATED

    def _measure(self, epoch: int, state: NavState, dtheta: Floats, dt: float) -> Measurement | None:
        parts = []
        size = self._model.size
        if self._has_position[epoch]:
            lla, noise = self._fixes.lla[epoch], self._noise.position[epoch]
            parts.append(position_measurement(state, self._lever_b, lla, noise, size))
        if self._has_velocity[epoch]:
            rate = angular_rate(state, dtheta, dt)
            vel_n, noise = self._fixes.vel_n[epoch], self._noise.velocity[epoch]
            parts.append(velocity_measurement(state, self._lever_b, rate, vel_n, noise, size))
        return join(parts) if parts else None
