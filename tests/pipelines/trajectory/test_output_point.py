"""The solution moved to another point: geometry by an independent rigid body, covariance by finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.geodesy.earth import move_lla, ned_between
from navreplay.geodesy.rotation import quat_from_euler, quat_from_rotvec, quat_multiply
from navreplay.solution import Solution
from navreplay.timeline import ImuSeries
from pipelines.trajectory.output_point import move_to_point

LEVER = np.array([0.8, -0.4, 1.3])
T_NS = np.arange(5, dtype=np.int64) * 100_000_000 + 10**18
NAMES = tuple(f"{kind}_{axis}" for kind in ("position", "velocity", "attitude", "gyro_bias", "accel_bias") for axis in "xyz")


def make_solution(q_nb, vel_n=(10.0, -3.0, 0.5)):
    n = len(T_NS)
    return Solution(
        t_ns=T_NS,
        lla=np.tile([0.82, 0.14, 430.0], (n, 1)),
        vel_n=np.tile(vel_n, (n, 1)),
        q_nb=np.broadcast_to(q_nb, (n, 4)).copy(),
        gyro_bias=np.tile([1e-3, -2e-3, 5e-4], (n, 1)),
        accel_bias=np.zeros((n, 3)),
        cov=np.zeros((n, 15, 15)),
        status=np.zeros(n, dtype=np.int8),
        state_names=NAMES,
        state_units=("",) * 15,
        method="fixed",
    )


def make_imu(rate_b):
    t_ns = np.arange(-10, 80, dtype=np.int64) * 10_000_000 + T_NS[0]
    return ImuSeries(t_ns, np.tile(rate_b, (len(t_ns), 1)), np.tile([0.0, 0.0, -9.8], (len(t_ns), 1)))


def test_a_car_heading_east_has_its_right_side_in_the_south():
    solution = make_solution(quat_from_euler(0, 0, np.pi / 2))
    moved = move_to_point(solution, make_imu([0.0, 0.0, 0.0]), np.array([2.0, 1.0, 0.5]))
    assert ned_between(solution.lla, moved.lla) == pytest.approx(np.tile([-1.0, 2.0, 0.5], (5, 1)), abs=1e-6)


def test_velocity_is_the_derivative_of_position_in_a_turn():
    rate = 0.5
    seconds = (T_NS - T_NS[0]) / 1e9
    solution = make_solution(quat_from_euler(np.zeros(5), np.zeros(5), rate * seconds), vel_n=(0.0, 0.0, 0.0))
    bias = solution.gyro_bias[0]
    moved = move_to_point(solution, make_imu(np.array([0, 0, rate]) + bias), LEVER)
    path = ned_between(np.broadcast_to(solution.lla[0], (5, 3)), moved.lla)
    central = (path[2:] - path[:-2]) / 0.2
    assert moved.vel_n[1:-1] == pytest.approx(central, abs=1e-3)
    assert np.linalg.norm(moved.vel_n, axis=1) == pytest.approx(rate * np.hypot(LEVER[0], LEVER[1]), rel=1e-3)


@pytest.mark.parametrize("state", range(15))
def test_covariance_follows_a_small_change_of_each_state(state):
    solution = make_solution(quat_from_euler(0.1, -0.2, 2.0))
    imu = make_imu([0.3, -0.1, 0.4])
    x = np.zeros(15)
    x[state] = 1e-4
    changed = replace(
        solution,
        lla=move_lla(solution.lla, x[0:3]),
        vel_n=solution.vel_n + x[3:6],
        q_nb=quat_multiply(quat_from_rotvec(x[6:9]), solution.q_nb),
        gyro_bias=solution.gyro_bias + x[9:12],
    )
    before = move_to_point(replace(solution, cov=np.tile(np.outer(x, x), (5, 1, 1))), imu, LEVER)
    after = move_to_point(changed, imu, LEVER)
    expected = x.copy()
    expected[0:3] = ned_between(before.lla[0], after.lla[0])
    expected[3:6] = after.vel_n[0] - before.vel_n[0]
    # The frame rate turns with the attitude too: 1e-4 of it, left out of the first-order covariance.
    assert before.cov[0] == pytest.approx(np.outer(expected, expected), abs=2e-12)


def test_no_lever_changes_nothing():
    solution = make_solution(quat_from_euler(0.1, -0.2, 2.0))
    moved = move_to_point(solution, make_imu([0.3, 0.0, 0.0]), np.zeros(3))
    assert np.array_equal(moved.lla, solution.lla)
    assert np.array_equal(moved.vel_n, solution.vel_n)
    assert np.array_equal(moved.cov, solution.cov)
