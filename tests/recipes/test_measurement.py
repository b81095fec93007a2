"""docs/recipes.md, a measurement: its residual and Jacobian, and its epochs beside those of other sensors."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from navreplay.aiding import guidance
from navreplay.aiding.epochs import Observed
from navreplay.aiding.joint import JointAiding, JointGate
from navreplay.filters import run
from navreplay.filters.presets import build_method
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions, GateOptions
from navreplay.timeline import Floats, Times
from navreplay.update import record
from navreplay.update.gate import Gate
from navreplay.update.measurement import Measurement
from synthetic_logs import SCENARIOS, simulate, with_duration


@dataclass(frozen=True, eq=False, slots=True)
class BarometerAiding:
    """Heights (e,) [m] at t_ns (e,), with standard deviation std [m]."""

    t_ns: Times
    height: Floats
    std: float
    size: int
    name: str = "heights"

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The height with index epoch, against the third error state, which is down."""
        jacobian = np.zeros((1, self.size))
        jacobian[0, 2] = -1.0
        residual = self.height[epoch : epoch + 1] - state.lla[2]
        return Observed(Measurement(residual, jacobian, np.array([[self.std**2]]), ("height",), ("up",)), state, cov)


def test_it_aids_beside_the_fixes(monkeypatch: pytest.MonkeyPatch) -> None:
    log = simulate(with_duration(SCENARIOS["car-short"], 60.0), 1)
    truth = log.truth
    monkeypatch.setitem(record._UNITS, "height", "m")
    choose = guidance.choose_guidance

    def with_barometer(timeline, options, recorder):
        found = choose(timeline, options, recorder)
        heights = BarometerAiding(truth.t_ns[25::50], truth.lla[25::50, 2], 0.1, found.model.size)
        joint = JointAiding((found.main, heights))
        gate = JointGate(Gate(GateOptions()), [(frozenset({"height"}), Gate(GateOptions()))])
        aided = type("Aided", (type(found),), {"gate": lambda self, options: gate})
        return aided(found.main, found.others, joint, found.inertial)

    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0)
    plain = run.run_filter(log.timeline(), build_method("fixed"), options)
    monkeypatch.setattr(run, "choose_guidance", with_barometer)
    aided = run.run_filter(replace(log.timeline()), build_method("fixed"), options)
    assert [series.kind for series in aided.innovations if series.kind == "height"] == ["height"]
    assert aided.std[-1, 2] < 0.5 * plain.std[-1, 2]
