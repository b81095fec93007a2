"""Vertical velocity by a barometer, and height hold in outages."""

from dataclasses import fields, replace

import numpy as np
import pytest

from importers.rows.vehicle_columns import pressure_height
from navreplay.aiding.climb import unaided_times
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.measurements.climb import climb_measurement, find_climbs
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions, VehicleOptions
from navreplay.timeline import GnssFixSeries
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration
from synthetic_logs.sensors.wheels import BaroErrors, barometer_of

SECOND = 1_000_000_000
SCENARIO = with_duration(SCENARIOS["car-city"], 240.0)
OUTAGE = (100, 160)


def barometer(log, seed=1):
    """At 10 Hz."""
    truth = truth_at(log.scenario.journey, log.imu.t_ns[10:-10:10])
    return barometer_of(truth, BaroErrors(), np.random.default_rng(seed))


def select(fixes, rows):
    return GnssFixSeries(*(getattr(fixes, field.name)[rows] for field in fields(fixes)))


def drive(seed, **changes):
    """With 60 s without fixes, and the error of height at its end."""
    log = simulate(SCENARIO, seed)
    fixes = log.timeline().fixes
    seconds = (fixes.t_ns - log.imu.t_ns[0]) / 1e9
    cut = select(fixes, (seconds < OUTAGE[0]) | (seconds > OUTAGE[1]))
    timeline = replace(log.timeline(), fixes=cut, baro=barometer(log, seed=seed) if changes.pop("baro", False) else None)
    options = FilterOptions(imu_noise=SCENARIO.imu.noise, output_rate=2.0, vehicle=VehicleOptions(**changes))
    solution = run_filter(timeline, build_method("fixed"), options)
    at = truth_at(log.scenario.journey, int(log.imu.t_ns[0]) + np.array([OUTAGE[1] - 1, OUTAGE[1]]) * SECOND)
    rows = evaluate(solution, at)
    std = np.sqrt(solution.cov[np.searchsorted(solution.t_ns, at.t_ns[-1]), 2, 2])
    return abs(rows.errors["position"].error[-1, 2]), std, solution


def test_a_climb_is_the_slope_of_height():
    log = simulate(SCENARIO, 3)
    climbs = find_climbs(barometer(log), log.timeline().fixes)
    truth = -truth_at(log.scenario.journey, climbs.t_ns).vel_n[:, 2]
    error = climbs.rate - truth
    assert len(climbs.t_ns) > 100
    assert np.std(error) < 0.1
    assert 0.3 < np.std(error) / np.median(climbs.std) < 1.5


def test_a_barometer_of_another_drive_is_refused():
    log = simulate(SCENARIO, 3)
    wild = replace(barometer(log), height=np.random.default_rng(1).normal(0, 30, len(barometer(log))))
    climbs = find_climbs(wild, log.timeline().fixes)
    assert len(climbs.t_ns) == 0
    assert "otherwise than the fixes" in climbs.text


def test_the_measurement_is_upward_and_its_jacobian_the_derivative():
    state = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([1.0, 0.0, -0.4]), np.array([1.0, 0, 0, 0]))
    measured = climb_measurement(state, 0.5, 0.1, 15, "climb")
    assert measured.residual[0] == pytest.approx(-0.1)
    assert np.flatnonzero(measured.jacobian[0]).tolist() == [5]


def test_height_in_an_outage_is_kept_by_a_barometer_and_by_height_hold():
    errors, squares = {"none": [], "baro": [], "hold": []}, []
    for seed in (1, 2, 3):
        for name, changes in (("none", {}), ("baro", {"baro": True}), ("hold", {"height_hold": True})):
            error, std, solution = drive(seed, **changes)
            errors[name].append(error)
            squares += [(error / std) ** 2] if name == "baro" else []
        assert any(series.kind == "height_hold" for series in solution.innovations)
    assert np.mean(errors["baro"]) < 0.5 * np.mean(errors["none"])
    assert np.mean(squares) < 4


def test_height_is_held_only_where_nothing_else_is_measured():
    main, times = np.array([0, 1, 2, 10]) * SECOND, np.arange(12) * SECOND
    assert (unaided_times(main, times) / SECOND).tolist() == [5, 6, 7]


def test_pressure_is_height_in_the_standard_atmosphere():
    """ISO 2533: 1000 m at 89874.6 Pa; hectopascals are no air's pascals."""
    np.testing.assert_allclose(pressure_height(np.array([101_325.0, 89_874.6])), [0.0, 1000.0], atol=0.5)
    assert np.isnan(pressure_height(np.array([1013.25]))).all()
