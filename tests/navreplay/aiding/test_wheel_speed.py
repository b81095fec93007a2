"""Speed by the wheels: fitted to fixes, as a measurement, and in an outage."""

from dataclasses import fields, replace

import numpy as np
import pytest

from navreplay.aiding.wheel_speed import covered_times
from navreplay.calibration.wheels import apply_fit, fit_speed, fit_turn
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.measurements.body_velocity import (
    VehiclePoint,
    body_velocity,
    wheel_speed_measurement,
    wheel_turn_measurement,
)
from navreplay.mechanisation.strapdown import NavState
from navreplay.options import FilterOptions, VehicleOptions
from navreplay.timeline import GnssFixSeries, LogError, SpeedSeries
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration
from synthetic_logs.sensors.wheels import WheelErrors
from synthetic_logs.sensors.wheels import wheels_of as simulate_wheels

SECOND = 1_000_000_000
SCENARIO = with_duration(SCENARIOS["car-city"], 240.0)


@pytest.fixture(scope="module")
def log():
    return simulate(SCENARIO, 5)


def wheels_of(log, **errors):
    """At 10 Hz."""
    truth = truth_at(log.scenario.journey, log.imu.t_ns[10:-40:10])
    return simulate_wheels(truth, WheelErrors(**errors), np.random.default_rng(1))


def select(fixes, rows):
    return GnssFixSeries(*(getattr(fixes, field.name)[rows] for field in fields(fixes)))


def test_scale_delay_and_quantum_are_found(log):
    told = wheels_of(log, scale=1.03, late=0.3, quantum=0.25)
    fit = fit_speed(told, log.timeline().fixes)
    assert fit.scale == pytest.approx(1.03, rel=0.004)
    assert fit.delay == pytest.approx(-0.3, abs=0.05)
    assert fit.quantum == pytest.approx(0.25, rel=0.01)
    settled = apply_fit(told, fit)
    np.testing.assert_allclose(settled.speed, wheels_of(log, quantum=0.25).speed, atol=0.1)
    assert settled.std > 0.05


def test_a_sensor_that_counts_backwards_has_a_negative_scale(log):
    assert fit_speed(wheels_of(log, scale=-0.02), log.timeline().fixes).scale == pytest.approx(-0.02, rel=0.004)


def test_wheels_of_another_drive_are_refused(log):
    other = wheels_of(log)
    shuffled = replace(other, speed=np.roll(other.speed, len(other) // 3))
    assert fit_speed(shuffled, log.timeline().fixes) is None


def test_turns_by_the_wheels_are_fitted_to_the_gyro(log):
    slope, scatter = fit_turn(wheels_of(log, track=1.5), log.imu, np.array([0.0, 0.0, 1.0]))
    assert slope == pytest.approx(1 / 1.5, rel=0.02)
    assert scatter < 0.02


def test_epochs_lie_between_samples():
    t_ns = np.array([0, 1, 2, 10, 11]) * SECOND
    wheels = SpeedSeries(t_ns, np.zeros(5), np.full(5, np.nan))
    assert (covered_times(wheels, np.array([-1, 1, 1.5, 5, 10.5, 12]) * SECOND) / SECOND).tolist() == [1, 1.5, 10.5]


def test_speeds_must_be_finite_and_in_order():
    with pytest.raises(LogError, match="strictly increase"):
        SpeedSeries(np.array([1, 1]), np.zeros(2), np.zeros(2))
    with pytest.raises(LogError, match="not finite"):
        SpeedSeries(np.array([1, 2]), np.array([0.0, np.nan]), np.zeros(2))


def test_residuals_are_measured_less_predicted():
    state = NavState.at(np.array([0.7, 0.1, 50.0]), np.array([10.0, 0.0, 0.0]), np.array([1.0, 0, 0, 0]))
    rate_b = np.array([0.0, 0.0, 0.2])
    moved = body_velocity(state, VehiclePoint(np.eye(3), np.array([0.0, 0.5, 0.0])), rate_b, 15)
    measured = wheel_speed_measurement(moved, 10.3, 0.1)
    assert measured.residual[0] == pytest.approx(10.3 - (10.0 - 0.2 * 0.5))
    turned = wheel_turn_measurement(0.25, rate_b, np.eye(3), 0.02, 15)
    assert turned.residual[0] == pytest.approx(0.05)
    np.testing.assert_array_equal(turned.jacobian[0, 9:12], [0.0, 0.0, -1.0])


def test_an_outage_with_wheels_is_a_fraction_of_one_without():
    """Three draws of everything; 40 s without fixes."""
    ends, squares = {False: [], True: []}, []
    for seed in range(1, 4):
        drawn = simulate(SCENARIO, seed)
        seconds = (drawn.timeline().fixes.t_ns - drawn.imu.t_ns[0]) / 1e9
        fixes = select(drawn.timeline().fixes, (seconds < 120) | (seconds > 160))
        settled = wheels_of(drawn, scale=1.02, late=0.2, quantum=0.1)
        settled = apply_fit(settled, fit_speed(settled, fixes))
        settled = replace(settled, turn=settled.turn / 1.5 * 1.02)
        at = truth_at(drawn.scenario.journey, int(drawn.imu.t_ns[0]) + np.array([158, 159, 160]) * SECOND)
        for known in (False, True):
            timeline = replace(drawn.timeline(), fixes=fixes, speed=settled if known else None)
            vehicle = VehicleOptions(zero_velocity=True, no_slip=True, mounting=(0.0, 0.0))
            options = FilterOptions(imu_noise=SCENARIO.imu.noise, output_rate=2.0, vehicle=vehicle)
            solution = run_filter(timeline, build_method("fixed"), options)
            error = evaluate(solution, at).errors["position"]
            ends[known].append(np.hypot(*error.error[-1, :2]))
            squares += [error.nees[-1]] if known else []
    assert np.mean(ends[True]) < 0.7 * np.mean(ends[False])
    assert np.mean(squares) < 7
