"""docs/recipes.md, a moment rule: one class, one preset."""

from dataclasses import dataclass

import numpy as np

from navreplay.adapt.fixed import Fixed
from navreplay.filters.presets import Preset
from navreplay.filters.run import run_filter
from navreplay.moments.linearised import Linearised
from navreplay.options import FilterOptions
from navreplay.timeline import Floats
from navreplay.update.gaussian import Gaussian, Innovation, condition, kalman_gain
from synthetic_logs import SCENARIOS, simulate, with_duration


@dataclass(frozen=True, slots=True)
class Timid(Linearised):
    """Goes share of the way that the optimal gain would go; the Joseph form keeps the covariance honest."""

    share: float = 0.5

    def condition(self, prior: Gaussian, innovation: Innovation, noise: Floats) -> Gaussian:
        """Posterior with R = noise (m, m), by a share of the optimal gain."""
        return condition(prior, innovation, noise, self.share * kalman_gain(innovation, noise))


TIMID = Preset("timid", "goes half of the way", Fixed, Timid)


def test_it_runs_and_is_less_sure() -> None:
    log = simulate(with_duration(SCENARIOS["car-short"], 60.0), 1)
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0)
    timid, whole = (run_filter(log.timeline(), TIMID.build({"share": share}), options) for share in (0.5, 1.0))
    assert np.trace(timid.cov[-1][:3, :3]) > np.trace(whole.cov[-1][:3, :3])
