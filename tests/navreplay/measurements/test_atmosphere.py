"""Atmosphere models and look angles against published examples, tables and geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.geodesy import earth
from navreplay.measurements.atmosphere import beidou_delay, klobuchar_delay, look_angles, saastamoinen_delay

ALPHA_BETA = np.array([0.3820e-7, 0.1490e-7, -0.1790e-6, 0.0, 0.1430e6, 0.0, -0.3280e6, 0.1130e6])


def test_klobuchar_equals_a_published_example():
    """40 N, 100 W, elevation 20 deg, azimuth 210 deg, 593100 s of week: 23.784 m, a much used example."""
    delay = klobuchar_delay(ALPHA_BETA, *np.radians([40.0, 260.0, 20.0, 210.0]), 593100.0)
    assert float(delay) == pytest.approx(23.784, abs=1e-3)


def test_klobuchar_at_night_is_five_nanoseconds_at_the_zenith():
    delay = klobuchar_delay(ALPHA_BETA, np.radians(45.0), 0.0, np.pi / 2, 0.0, 3600.0)
    slant = 1 + 16 * (0.53 - 0.5) ** 3
    assert float(delay) == pytest.approx(5e-9 * 299792458 * slant, rel=1e-9)


@given(st.floats(-1.5, 1.5), st.floats(-3.1, 3.1), st.floats(0.05, 1.57), st.floats(0, 6.28), st.floats(0, 604800))
def test_klobuchar_stays_within_bounds_and_broadcasts(lat, lon, elevation, azimuth, tow):
    one = float(klobuchar_delay(ALPHA_BETA, lat, lon, elevation, azimuth, tow))
    assert 1.4 < one < 150
    many = klobuchar_delay(ALPHA_BETA, np.full(3, lat), lon, np.full(3, elevation), azimuth, tow)
    np.testing.assert_allclose(many, one, rtol=1e-12)


def test_beidou_delay_at_the_zenith_follows_its_formula():
    """40 N (0.2222 semicircles), 105 E: 7 h of GPS time are 14 h there; an hour later the cosine of a period of 86400 s."""
    coefficients = np.array([2e-8, 1e-7, -3e-7, 4e-7, 86400.0, 0.0, 0.0, 0.0])
    amplitude = 2e-8 + 1e-7 / 4.5 - 3e-7 / 4.5**2 + 4e-7 / 4.5**3
    for tow_s, share in ((7 * 3600.0, 1.0), (8 * 3600.0, np.cos(np.pi / 12)), (18 * 3600.0, 0.0)):
        for lat in (40.0, -40.0):
            delay = beidou_delay(coefficients, np.radians(lat), np.radians(105.0), np.pi / 2, 0.3, tow_s)
            expected = (5e-9 + share * amplitude) * 299792458 * (1561.098 / 1575.42) ** 2
            assert float(delay) == pytest.approx(expected, rel=1e-12)


@given(st.floats(-1.5, 1.5), st.floats(-3.1, 3.1), st.floats(0.05, 1.5), st.floats(0, 6.28))
def test_beidou_delay_is_that_where_the_ray_pierces_the_shell(lat, lon, elevation, azimuth):
    """The ray met with a sphere 375 km up, by vectors; there the delay is that at the zenith over the cosine of the angle."""
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.cross(up, east)
    ray = np.sin(elevation) * up + np.cos(elevation) * (np.cos(azimuth) * north + np.sin(azimuth) * east)
    here, shell = 6378.0 * up, 6378.0 + 375.0
    length = -here @ ray + np.sqrt((here @ ray) ** 2 - 6378.0**2 + shell**2)
    pierced = (here + length * ray) / shell
    place = np.arcsin(pierced[2]), np.arctan2(pierced[1], pierced[0])
    coefficients = np.array([1e-8, 2e-7, -1e-6, 2e-6, 1e5, 2e5, -3e5, 4e5])
    slant = float(beidou_delay(coefficients, lat, lon, elevation, azimuth, 50_000.0))
    assert slant == pytest.approx(
        float(beidou_delay(coefficients, *place, np.pi / 2, 0.0, 50_000.0)) / (pierced @ ray), rel=1e-6
    )


def test_saastamoinen_at_the_zenith_is_the_sum_of_its_parts():
    """Sea level, 1013.25 hPa: 2.3 m hydrostatic; 15 deg C at 70 %: 11.9 hPa of vapour, 0.12 m wet (worked by hand)."""
    assert float(saastamoinen_delay(np.radians(45.0), 0.0, np.pi / 2)) == pytest.approx(2.3069 + 0.1203, abs=2e-3)


def test_saastamoinen_falls_with_height_and_grows_towards_the_horizon():
    heights = np.array([0.0, 1000.0, 3000.0, 8000.0])
    zenith = saastamoinen_delay(0.7, heights, np.pi / 2)
    assert (np.diff(zenith) < 0).all()
    assert zenith[3] == pytest.approx(0.0022768 * 356, abs=0.05)
    assert float(saastamoinen_delay(0.7, 0.0, np.radians(30))) == pytest.approx(2 * zenith[0], rel=1e-9)
    assert np.isfinite(saastamoinen_delay(0.7, -5000.0, -0.3))


def test_look_angles_of_satellites_in_known_directions():
    lla = np.array([0.6, -1.2, 250.0])
    here, c_en = earth.ecef_from_lla(lla), earth.matrix_en(lla[0], lla[1])
    directions_n = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [-1.0, -1.0, -np.sqrt(2)]])
    satellites = here + 2.2e7 * directions_n @ c_en.T
    elevation, azimuth = look_angles(lla, satellites)
    np.testing.assert_allclose(np.degrees(elevation), [0, 0, 90, 45], atol=1e-6)
    np.testing.assert_allclose(np.degrees(azimuth)[[0, 1, 3]], [0, 90, -135], atol=1e-6)
