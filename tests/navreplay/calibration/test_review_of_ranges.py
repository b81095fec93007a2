"""`checked` on ranges: as told where that is right, and no worse than the least squares of single epochs where it is not."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.measurements.least_squares import fixes_of, solve_points
from navreplay.options import FilterOptions, RangeOptions
from navreplay.solution import Solution
from navreplay.timeline import RangeSeries
from synthetic_logs import SCENARIOS, SyntheticLog, simulate, truth_at

MOST = 1.2


@lru_cache
def drive(name: str, seed: int) -> SyntheticLog:
    return simulate(SCENARIOS[name], seed)


def told(log: SyntheticLog, pseudorange: float, rate: float) -> RangeSeries:
    assert log.ranges is not None
    ranges = log.ranges
    return replace(ranges, pseudorange_std=ranges.pseudorange_std * pseudorange, range_rate_std=ranges.range_rate_std * rate)


def run(log: SyntheticLog, ranges: RangeSeries, method: str = "checked") -> Solution:
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0)
    return run_filter(replace(log.timeline(), ranges=ranges), build_method(method), options)


def least_squares_error(log: SyntheticLog, ranges: RangeSeries) -> float:
    """Horizontal RMS error [m] of the positions of single epochs."""
    fixes = fixes_of(solve_points(ranges, RangeOptions())[0])
    true = truth_at(log.scenario.journey, fixes.t_ns)
    antenna = earth.move_lla(true.lla, rotation.matrix_from_quat(true.q_nb) @ np.array(log.scenario.journey.lever_b))
    error = earth.ned_between(antenna, fixes.lla)[:, :2]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@pytest.mark.parametrize("seed", [1, 2])
def test_ranges_that_tell_the_truth_are_filtered_as_told(seed: int) -> None:
    log = drive("ranges-open", seed)
    fixed, checked = (run(log, told(log, 1.0, 1.0), method) for method in ("iekf", "checked"))
    assert not checked.estimated
    assert np.array_equal(fixed.lla, checked.lla)
    assert np.array_equal(fixed.cov, checked.cov)


@pytest.mark.parametrize("factors", [(0.1, 1.0), (10.0, 1.0), (1.0, 0.1), (1.0, 10.0), (0.2, 0.2)])
@pytest.mark.parametrize("name", ["ranges-open", "ranges-step", "ranges-resets"])
def test_noise_told_wrong_costs_nothing_beside_least_squares(name: str, factors: tuple[float, float]) -> None:
    log = drive(name, 3)
    ranges = told(log, *factors)
    error = evaluate(run(log, ranges), log.truth).statistics["outside"]["position"]["horizontal"].rms
    assert error < MOST * least_squares_error(log, ranges)


@pytest.mark.parametrize("kind", ["range", "range_rate"])
@pytest.mark.parametrize("factor", [0.5, 0.2, 0.1])
def test_the_factor_is_found(kind: str, factor: float) -> None:
    log = drive("ranges-open", 4)
    # well above the floors, which would hide the factor
    assert log.ranges is not None
    loud = replace(log.ranges, pseudorange_std=log.ranges.pseudorange_std * 8, range_rate_std=log.ranges.range_rate_std * 8)
    rng = np.random.default_rng(5)
    grown = np.sqrt(8.0**2 - 1) * rng.standard_normal((2, len(loud)))
    loud = replace(
        loud,
        pseudorange=loud.pseudorange + grown[0] * log.ranges.pseudorange_std,
        range_rate=loud.range_rate + grown[1] * log.ranges.range_rate_std,
    )
    spoilt = replace(
        loud,
        pseudorange_std=loud.pseudorange_std * (factor if kind == "range" else 1.0),
        range_rate_std=loud.range_rate_std * (factor if kind == "range_rate" else 1.0),
    )
    solution = run(log, spoilt)
    name = "pseudorange_noise_scale" if kind == "range" else "range_rate_noise_scale"
    assert solution.estimated[name] == pytest.approx(1 / factor, rel=0.25)
