"""Forward against smoothed positions: their differences are as large as the difference of their covariances says."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import GRADES, FilterOptions
from navreplay.timeline import Timeline
from synthetic_logs import SCENARIOS, simulate, with_duration


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    log = simulate(with_duration(SCENARIOS["car-short"], 120.0), 2)
    return Timeline(imu=log.imu, fixes=log.fixes, fix_lever_b=np.array(log.scenario.journey.lever_b))


OPTIONS = FilterOptions(imu_noise=GRADES["tactical"], output_rate=0.0, smooth=True)


def test_a_filter_that_tells_the_truth_agrees_with_its_smoother(timeline: Timeline) -> None:
    solution = run_filter(timeline, build_method("fixed"), OPTIONS)
    assert solution.backward is not None
    assert 0.2 < solution.backward < 2.5


def test_noise_told_too_small_does_not(timeline: Timeline) -> None:
    told = run_filter(timeline, build_method("fixed"), OPTIONS).backward
    wrong = run_filter(timeline, build_method("fixed"), replace(OPTIONS, noise_scale=0.3)).backward
    assert told is not None
    assert wrong is not None
    assert wrong > 3 * told


def test_a_forward_run_has_nothing_to_compare(timeline: Timeline) -> None:
    assert run_filter(timeline, build_method("fixed"), replace(OPTIONS, smooth=False)).backward is None
