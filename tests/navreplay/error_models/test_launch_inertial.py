"""The launch-inertial frame: gravity gradient, transition, and the same solution as the mechanisation in NED."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from navreplay.error_models.launch_inertial import LaunchInertialModel, inertial_model
from navreplay.error_models.ned import NedErrorModel
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.earth import GM, ecef_from_lla, ned_between
from navreplay.geodesy.launch_frame import LaunchFrame
from navreplay.geodesy.rotation import euler_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from navreplay.mechanisation._launch_kernel import fill_gradient
from navreplay.mechanisation.strapdown import Leg, NavState, make_steps
from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, ImuNoise, LaunchOptions
from navreplay.timeline import LogError
from pipelines.config.spec import Config, filter_options
from pipelines.trajectory.launch_csv import LAUNCH_COLUMNS, write_launch_csv
from synthetic_logs import SCENARIOS, ideal_imu, simulate, truth_at, with_duration

ARCSEC = pi / 180 / 3600
SCENARIO = SCENARIOS["ballistic"]
FLIGHT = SCENARIO.journey.motion
NOISE = replace(SCENARIO.imu.noise, gyro_bias_walk=1e-9, accel_bias_walk=1e-6)
STILL = ImuNoise(0.0, 0.0, 1e-6, 1e-3, 0.0, 0.0)


def launch_model(noise=NOISE):
    return LaunchInertialModel(noise, LaunchFrame(FLIGHT.lla, FLIGHT.azimuth), SCENARIO.journey.start_ns)


def test_gravity_gradient_is_the_derivative_of_a_point_mass():
    r = np.array([3e5, 6.6e6, -2e5])
    gradient = np.empty((3, 3))
    fill_gradient.py_func(r, gradient)
    steps = 10.0 * np.eye(3)
    pulls = [[-GM * (r + s * step) / np.linalg.norm(r + s * step) ** 3 for s in (1, -1)] for step in steps]
    np.testing.assert_allclose(gradient, [(plus - minus) / 20.0 for plus, minus in pulls], atol=1e-14)
    assert np.trace(gradient) == pytest.approx(0, abs=1e-20)
    compiled = np.empty((3, 3))
    fill_gradient(r, compiled)
    np.testing.assert_allclose(compiled, gradient, rtol=1e-14)


def test_the_centre_of_the_earth_lies_off_the_plumb_line():
    frame = LaunchFrame(FLIGHT.lla, 0.0)
    centre = frame.origin_i @ frame.c_il
    assert np.linalg.norm(centre) == pytest.approx(np.linalg.norm(ecef_from_lla(np.array(FLIGHT.lla))))
    # geodetic less geocentric latitude is 0.19 degrees here
    assert np.degrees(np.arctan2(centre[0], centre[1])) == pytest.approx(-0.19, abs=0.01)


def moved_by(model, start, steps, ends):
    return model.propagate(start, np.eye(15), Leg(steps, 0, ends, 0.05, keep=True))


def test_a_noise_free_flight_is_the_same_as_in_ned():
    journey = SCENARIO.journey
    imu = ideal_imu(journey)
    truth = truth_at(journey, imu.t_ns)
    start = NavState.at(truth.lla[0], truth.vel_n[0], truth.q_nb[0])
    steps = make_steps(imu, np.empty(0, dtype=np.int64))
    ends = np.arange(5, len(steps) + 1, 500)
    launch = moved_by(launch_model(), start, steps, ends).states
    ned = moved_by(NedErrorModel(NOISE), start, steps, ends).states
    for other, metres in ((ned, 0.01), (np.hstack([truth.lla, truth.vel_n, truth.q_nb])[ends], 0.01)):
        assert np.abs(ned_between(other[:, :3], launch[:, :3])).max() < metres
        np.testing.assert_allclose(launch[:, 3:6], other[:, 3:6], atol=5e-5)
        turn = rotvec_from_quat(quat_multiply(launch[:, 6:10], quat_conjugate(other[:, 6:10])))
        assert np.abs(turn).max() < 0.001 * ARCSEC


def test_transition_is_the_derivative_of_the_motion():
    imu = ideal_imu(with_duration(SCENARIO, 60.0).journey)
    truth = truth_at(SCENARIO.journey, imu.t_ns[:1])
    model = launch_model(STILL)
    start = NavState.at(truth.lla[0], truth.vel_n[0], truth.q_nb[0])
    steps = make_steps(imu, np.empty(0, dtype=np.int64))
    ends = np.array([3000, 6000])
    base = moved_by(model, start, steps, ends)
    total = base.transitions[1] @ base.transitions[0]
    scale = np.repeat([1.0, 0.01, 1e-4, 1e-7, 1e-5], 3)
    for i, size in enumerate(scale):
        moved = [
            NavState.unpack(moved_by(model, model.retract(start, sign * size * np.eye(15)[i]), steps, ends).states[-1])
            for sign in (1, -1)
        ]
        column = model.difference(*moved) / (2 * size)
        np.testing.assert_allclose(total[:, i] * size, column * size, rtol=2e-3, atol=2e-3 * np.abs(column * size).max())


def test_covariance_and_transition_agree_with_those_in_ned():
    imu = ideal_imu(with_duration(SCENARIO, 60.0).journey)
    truth = truth_at(SCENARIO.journey, imu.t_ns[:1])
    start = NavState.at(truth.lla[0], truth.vel_n[0], truth.q_nb[0])
    cov = np.diag(np.repeat([5.0, 0.1, 10 * ARCSEC, 0.5 * ARCSEC, 5e-3], 3) ** 2)
    steps = make_steps(imu, np.empty(0, dtype=np.int64))
    cross = np.eye(15)[:, :2]
    found = [
        model.propagate(start, cov, Leg(steps, 0, np.array([6000]), 0.05, keep=True), cross)
        for model in (launch_model(), NedErrorModel(NOISE))
    ]
    launch, ned = found
    scale = np.sqrt(np.diag(ned.covariances[0]))
    np.testing.assert_allclose(
        launch.covariances[0] / np.outer(scale, scale), ned.covariances[0] / np.outer(scale, scale), atol=5e-3
    )
    np.testing.assert_allclose(launch.crosses[0], launch.transitions[0] @ cross)
    again = launch.transitions[0] @ cov @ launch.transitions[0].T + launch.noises[0]
    np.testing.assert_allclose(launch.covariances[0], again, rtol=1e-9, atol=1e-20)


def told(log, launch):
    truth = log.truth
    q_nb = quat_multiply(quat_from_rotvec(np.array([10.0, 6.0, 10.0]) * ARCSEC), truth.q_nb[0])
    alignment = AlignmentOptions(
        method="given",
        given=tuple(euler_from_quat(q_nb)),
        given_std=(10 * ARCSEC,) * 3,
        position=tuple(truth.lla[0]),
        position_std=(5.0,) * 3,
        velocity=tuple(truth.vel_n[0]),
    )
    options = FilterOptions(imu_noise=log.scenario.imu.noise, alignment=alignment, output_rate=0.0, gate=GateOptions(1.0))
    return replace(options, launch=launch)


@pytest.mark.parametrize("smooth", [False, True])
def test_the_filter_on_stars_gives_the_same_in_both_frames(smooth):
    log = simulate(with_duration(SCENARIO, 60.0), 7)
    launch = LaunchOptions(FLIGHT.lla, FLIGHT.azimuth)
    ned, inertial = (
        run_filter(log.timeline(), build_method("fixed"), replace(told(log, frame), smooth=smooth)) for frame in (None, launch)
    )
    errors = [evaluate(solution, log.truth).errors["inertial_attitude"] for solution in (ned, inertial)]
    np.testing.assert_allclose(errors[1].error, errors[0].error, atol=0.005 * ARCSEC)
    np.testing.assert_allclose(errors[1].std, errors[0].std, rtol=5e-3)
    np.testing.assert_allclose(inertial.std[-1], ned.std[-1], rtol=1e-2)
    assert np.abs(ned_between(ned.lla, inertial.lla)).max() < 0.5


def test_the_launch_frame_serves_fixes_as_well():
    log = simulate(with_duration(SCENARIOS["car-short"], 60.0), 3)
    options = FilterOptions(imu_noise=log.scenario.imu.noise)
    launch = LaunchOptions(tuple(log.truth.lla[0]), 0.3)
    solutions = [run_filter(log.timeline(), build_method("fixed"), replace(options, launch=frame)) for frame in (None, launch)]
    assert np.abs(ned_between(solutions[0].lla, solutions[1].lla)).max() < 0.05
    np.testing.assert_allclose(solutions[1].std[-1], solutions[0].std[-1], rtol=0.02)


def test_what_the_launch_frame_cannot_hold_is_one_clear_line():
    options = FilterOptions(imu_noise=replace(NOISE, gyro_scale_std=1e-3), launch=LaunchOptions((0.7, 2.0, 0.0)))
    with pytest.raises(LogError, match=r"imu\.gyro_scale_std_ppm.*filter\.frame = 'ned'"):
        inertial_model(options, 0)
    log = simulate(with_duration(SCENARIO, 10.0), 7)
    with pytest.raises(LogError, match="cubature points move in NED"):
        run_filter(log.timeline(), build_method("ckf"), told(log, LaunchOptions(FLIGHT.lla)))


def test_launch_csv_tells_the_flight_in_launch_axes(tmp_path):
    log = simulate(with_duration(SCENARIO, 30.0), 7)
    solution = run_filter(log.timeline(), build_method("fixed"), told(log, None))
    path = tmp_path / "launch.csv"
    write_launch_csv(path, solution, log.imu, LaunchOptions(FLIGHT.lla, FLIGHT.azimuth))
    table = np.genfromtxt(path, delimiter=",", names=True)
    assert list(table.dtype.names) == list(LAUNCH_COLUMNS)
    assert len(table) == len(solution)
    height = table["y_m"][-1]
    assert height == pytest.approx(log.truth.lla[-1, 2], rel=0.01)
    assert 0.1 < table["std_phi_x_arcsec"][-1] < 0.5


def test_the_configuration_chooses_the_frame():
    ned = filter_options(Config())
    assert ned.launch is None
    settings = {"filter": {"frame": "launch-inertial"}, "alignment": {"position_deg_m": [40.0, 116.0, 5.0]}}
    launch = filter_options(Config.model_validate(settings)).launch
    np.testing.assert_allclose(launch.position, [np.radians(40.0), np.radians(116.0), 5.0])
    with pytest.raises(LogError, match=r"launch\.point_deg_m"):
        filter_options(Config.model_validate({"filter": {"frame": "launch-inertial"}}))
