"""A moment rule that is told when the white noise of the IMU changes: the moment oracle of an experiment about Q."""

from dataclasses import dataclass, replace

import numpy as np

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import NedErrorModel, Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.moments.linearised import Linearised
from navreplay.timeline import Floats
from synthetic_logs.sensors.windows import ScaledWindow, scale_in

__all__ = ["ToldProcess"]


@dataclass(frozen=True, slots=True)
class ToldProcess(Linearised):
    """windows: as in `synthetic_logs.sensors.imu_errors.ImuErrors.noise_windows`, counted from start_ns."""

    windows: tuple[ScaledWindow, ...]
    start_ns: int

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg; noise is that at the last one."""
        if not isinstance(model, NedErrorModel):
            raise ValueError("the noise of the IMU can be told for its own error model alone")
        scale = float(scale_in(self.windows, np.array([(leg.steps.t_ns[leg.ends[-1] - 1] - self.start_ns) / 1e9]))[0])
        told = replace(model.noise, gyro_noise=model.noise.gyro_noise * scale, accel_noise=model.noise.accel_noise * scale)
        return NedErrorModel(told).propagate(state, cov, leg)
