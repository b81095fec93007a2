"""docs/recipes.md, an error model: one class with the protocol of error_model.py, one line in `inertial_model`."""

from dataclasses import dataclass

import numpy as np
import pytest

from navreplay.aiding import guidance
from navreplay.error_models.ned import NedErrorModel
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.timeline import Floats
from synthetic_logs import SCENARIOS, simulate, with_duration


@dataclass(frozen=True, slots=True)
class ShakenModel(NedErrorModel):
    """The model in NED with white noise of the accelerometers `shaken` times as strong, for an IMU on an engine."""

    shaken: float = 5.0

    def density(self) -> Floats:
        """(n,) of the driving white noise."""
        factors = np.ones(self.size)
        factors[3:6] = self.shaken**2
        return NedErrorModel.density(self) * factors


def test_it_carries_a_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    log = simulate(with_duration(SCENARIOS["car-short"], 60.0), 1)
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0)
    plain = run_filter(log.timeline(), build_method("fixed"), options)
    monkeypatch.setattr(guidance, "inertial_model", lambda options, start_ns: ShakenModel(options.imu_noise))
    shaken = run_filter(log.timeline(), build_method("fixed"), options)
    assert np.trace(shaken.cov[-1][3:6, 3:6]) > np.trace(plain.cov[-1][3:6, 3:6])
