"""Rotations: every change of representation against another, and against scipy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navreplay.geodesy import rotation

angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
rotvecs = st.tuples(st.floats(-1.7, 1.7), st.floats(-1.7, 1.7), st.floats(-1.7, 1.7))


@given(angles)
def test_euler_as_scipy_has_it(rpy):
    expected = Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()
    np.testing.assert_allclose(rotation.matrix_from_euler(*rpy), expected, atol=1e-14)
    np.testing.assert_allclose(rotation.euler_from_quat(rotation.quat_from_euler(*rpy)), rpy, atol=1e-7)


@given(angles)
def test_matrix_and_quaternion_are_inverse(rpy):
    q = rotation.quat_from_euler(*rpy)
    q = -q if q[0] < 0 else q
    np.testing.assert_allclose(np.abs(rotation.quat_from_matrix(rotation.matrix_from_quat(q)) @ q), 1, atol=1e-14)


@given(rotvecs)
def test_rotation_vector_round_trip(vector):
    q = rotation.quat_from_rotvec(np.array(vector))
    np.testing.assert_allclose(rotation.rotvec_from_quat(q), vector, atol=1e-14)
    np.testing.assert_allclose(rotation.matrix_from_quat(q), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)


def test_tiny_rotation_vectors_keep_their_digits():
    vector = np.array([1e-12, -2e-13, 3e-14])
    np.testing.assert_allclose(rotation.rotvec_from_quat(rotation.quat_from_rotvec(vector)), vector, rtol=1e-12)


@given(angles, angles)
def test_product_turns_right_factor_first(a, b):
    p, q = rotation.quat_from_euler(*a), rotation.quat_from_euler(*b)
    expected = rotation.matrix_from_quat(p) @ rotation.matrix_from_quat(q)
    np.testing.assert_allclose(rotation.matrix_from_quat(rotation.quat_multiply(p, q)), expected, atol=1e-14)


def test_level_body_facing_east_in_both_conventions():
    facing_east_ros = np.array([1.0, 0, 0, 0])  # FLU in ENU: x forward lies on east
    np.testing.assert_allclose(
        rotation.euler_from_quat(rotation.frd_ned_from_flu_enu(facing_east_ros)), [0, 0, np.pi / 2], atol=1e-15
    )


@given(angles)
def test_ros_convention_is_its_own_inverse_and_maps_vectors(rpy):
    q = rotation.quat_from_euler(*rpy)
    ros = rotation.frd_ned_from_flu_enu(q)
    np.testing.assert_allclose(np.abs(rotation.frd_ned_from_flu_enu(ros) @ q), 1, atol=1e-14)
    body = np.array([0.3, -0.2, 0.9])
    in_ned = rotation.matrix_from_quat(q) @ body
    in_enu = rotation.matrix_from_quat(ros) @ rotation.flu_from_frd(body)
    np.testing.assert_allclose(rotation.enu_from_ned(in_ned), in_enu, atol=1e-14)


def test_scalar_order():
    np.testing.assert_array_equal(rotation.scalar_first_from_last(np.array([1.0, 2, 3, 4])), [4, 1, 2, 3])
    np.testing.assert_array_equal(rotation.scalar_last_from_first(np.array([4.0, 1, 2, 3])), [1, 2, 3, 4])


def test_skew_is_the_cross_product():
    a, b = np.array([1.0, -2, 3]), np.array([0.5, 4, -1])
    np.testing.assert_allclose(rotation.skew(a) @ b, np.cross(a, b))


def test_wrap_angle():
    np.testing.assert_allclose(rotation.wrap_angle([3 * np.pi, -np.pi, 0.1, -0.1 - 2 * np.pi]), [-np.pi, -np.pi, 0.1, -0.1])
