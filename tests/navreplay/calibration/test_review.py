"""`checked`: bit-identical to `iekf` where the noise is told right, and by which factor it was told wrong where it is not."""

import numpy as np
import pytest

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.solution import Solution
from synthetic_logs import SCENARIOS, simulate, with_duration
from tests.field.promise import DRIVES, spoil


def run(drive: str, fault: str | None, method: str, seed: int = 1) -> Solution:
    options = FilterOptions(imu_noise=DRIVES[drive].imu.noise, output_rate=0.0)
    return run_filter(spoil(drive, fault, seed).log.timeline(), build_method(method), options)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_log_that_tells_the_truth_is_filtered_as_told(drive: str, seed: int) -> None:
    plain, checked = run(drive, None, "iekf", seed), run(drive, None, "checked", seed)
    assert not checked.estimated
    for column in ("lla", "vel_n", "q_nb", "cov"):
        assert np.array_equal(getattr(plain, column), getattr(checked, column))


@pytest.mark.parametrize("factor", [0.05, 0.2, 5.0, 20.0])
@pytest.mark.parametrize("kind", ["position", "velocity"])
@pytest.mark.parametrize("drive", ["town", "town-rtk", "flight"])
def test_the_factor_is_found(drive: str, kind: str, factor: float) -> None:
    solution = run(drive, f"told-{kind}-{factor:g}", "checked")
    (found,) = (series for series in solution.innovations if series.kind == kind)
    gnss = DRIVES[drive].gnss
    true = gnss.position_std if kind == "position" else gnss.velocity_std
    taken = float(np.median(found.noise_std[:, 0])) / true[0]
    if factor < 1:
        assert taken == pytest.approx(1.0, rel=0.45)
    else:
        assert 0.9 < taken < max(0.15 * factor, 5.0) * 1.1


def test_a_run_says_what_it_found() -> None:
    solution = run("town", "told-position-0.05", "checked")
    texts = [event.text for event in solution.events]
    assert any("position:" in text and "from epoch to epoch they scatter" in text for text in texts)


def test_steps_between_epochs_are_twice_the_noise() -> None:
    log = simulate(with_duration(SCENARIOS["car-city"], 400.0), 5)
    solution = run_filter(log.timeline(), build_method("fixed"), FilterOptions(imu_noise=log.scenario.imu.noise))
    (position,) = (series for series in solution.innovations if series.kind == "position")
    assert np.isnan(position.step[0]).all()
    ratio = np.nanmean(np.square(position.step)) / np.mean(2 * np.square(position.noise_std))
    assert ratio == pytest.approx(1.0, abs=0.15)
