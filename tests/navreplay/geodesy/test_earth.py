"""WGS-84 against published values (NGA.STND.0036; Moritz, Geodetic Reference System 1980 for the shape of the checks)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.geodesy import earth


def test_gravity_at_the_equator_and_the_pole():
    assert earth.gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=2e-9)
    assert earth.gravity(np.pi / 2, 0.0) == pytest.approx(9.8321849379, abs=2e-9)


def test_normal_gravity_on_the_ellipsoid_is_that_of_somigliana_and_points_straight_down():
    lat = np.linspace(-1.5, 1.5, 61)
    gravity_n = earth.gravity_n(lat, np.zeros_like(lat))
    sine2 = np.sin(lat) ** 2
    somigliana = 9.7803253359 * (1 + 1.931852652458e-3 * sine2) / np.sqrt(1 - earth.ECCENTRICITY_SQUARED * sine2)
    np.testing.assert_allclose(gravity_n[:, 2], somigliana, atol=2e-9)
    np.testing.assert_allclose(gravity_n[:, :2], 0, atol=2e-9)


@pytest.mark.parametrize("height", [0.0, 3e5, 2e7])
def test_gravitation_is_the_gradient_of_the_zonal_potential(height):
    def potential(r):
        distance = np.linalg.norm(r)
        zonal = [0, 0, 1.08262982131e-3, 0, -2.37091120053e-6, 0, 6.08346498882e-9]
        ratio = earth.SEMI_MAJOR_AXIS / distance
        weighted = [coefficient * ratio**degree for degree, coefficient in enumerate(zonal)]
        return earth.GM / distance * (1 - np.polynomial.legendre.legval(r[2] / distance, weighted))

    r = earth.ecef_from_lla(np.array([0.6, 2.0, height]))
    steps = 100.0 * np.eye(3)
    gradient = [(potential(r + step) - potential(r - step)) / 200.0 for step in steps]
    np.testing.assert_allclose(earth.gravitation(r), gradient, atol=2e-8)


def test_gravity_falls_with_height_as_the_free_air_gradient():
    gradient = (earth.gravity(np.radians(45), 1.0) - earth.gravity(np.radians(45), 0.0)) / 1.0
    assert gradient == pytest.approx(-3.086e-6, rel=1e-3)


def test_radii_of_curvature():
    meridian, normal = earth.radii(0.0)
    assert normal == pytest.approx(6378137.0)
    assert meridian == pytest.approx(6335439.327, abs=1e-3)
    meridian, normal = earth.radii(np.pi / 2)
    assert meridian == pytest.approx(6399593.6258, abs=1e-4)
    assert normal == pytest.approx(6399593.6258, abs=1e-4)


def test_ecef_of_the_axes():
    np.testing.assert_allclose(earth.ecef_from_lla(np.array([0.0, 0.0, 10.0])), [6378147.0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(earth.ecef_from_lla(np.array([np.pi / 2, 0.0, 0.0])), [0, 0, 6356752.3142], atol=1e-4)


@given(st.floats(-1.57, 1.57), st.floats(-3.14, 3.14), st.floats(-500, 3e7))
def test_ecef_round_trip(lat, lon, height):
    lla = np.array([lat, lon, height])
    back = earth.lla_from_ecef(earth.ecef_from_lla(lla))
    np.testing.assert_allclose(back[:2], lla[:2], atol=1e-13, rtol=0)
    assert back[2] == pytest.approx(height, abs=2e-8)


def test_matrix_en_is_a_rotation_whose_third_column_points_down():
    c = earth.matrix_en(0.7, -2.0)
    np.testing.assert_allclose(c.T @ c, np.eye(3), atol=1e-15)
    assert np.linalg.det(c) == pytest.approx(1)
    lla = np.array([0.7, -2.0, 100.0])
    down = earth.ecef_from_lla(lla - [0, 0, 1.0]) - earth.ecef_from_lla(lla)
    np.testing.assert_allclose(c[:, 2], down, atol=1e-8)


def test_move_lla_and_ned_between_agree_for_lever_arms():
    lla = np.array([0.9, 0.3, 200.0])
    offset = np.array([3.0, -2.0, 1.5])
    np.testing.assert_allclose(earth.ned_between(lla, earth.move_lla(lla, offset)), offset, atol=2e-6)


def test_transport_rate_is_the_turn_of_the_frame():
    lla, velocity = np.array([0.8, 0.1, 500.0]), np.array([50.0, -30.0, 2.0])
    dt = 1.0
    after = earth.move_lla(lla, velocity * dt / 2)
    before = earth.move_lla(lla, -velocity * dt / 2)
    turn = earth.matrix_en(before[0], before[1]).T @ earth.matrix_en(after[0], after[1])
    rate = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2 / dt
    np.testing.assert_allclose(rate, earth.transport_rate_n(lla, velocity), rtol=1e-6)
