"""Satellites and lines of sight: against light time solved in inertial space, finite differences and a day of visibility."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from navreplay.geodesy.earth import EARTH_RATE, ecef_from_lla
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT, look_angles
from synthetic_logs import SCENARIOS, Receiver
from synthetic_logs.ranges.constellation import arrange_constellation, ascending_node, refer_to, satellite_states
from synthetic_logs.ranges.sight import sight_satellites
from synthetic_logs.ranges.signals import carrier_of, signal_of, system_of
from synthetic_logs.sensors.gnss import antenna_path
from synthetic_logs.simulation import orbits_of

HOUR_NS = 3_600_000_000_000
REFERENCE_NS = 387_000 * HOUR_NS
ORBITS = arrange_constellation("GEC", REFERENCE_NS)
LEVER = np.array([-0.4, 0.2, -1.3])
DRIVE = SCENARIOS["ranges-open"].journey.motion.trace(120.0)


def sight_at(t_s):
    """Sights of the antenna of a drive that began 2000 s after the reference time."""
    antenna = antenna_path(DRIVE.at(t_s), LEVER)
    return sight_satellites(ORBITS, t_s + 2000.0, antenna.lla, antenna.vel_n, 10 * pi / 180), antenna


def turned(vector_e, angle):
    """A vector, given in axes that have turned by angle about the pole, in the axes that have not."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([cosine * vector_e[0] - sine * vector_e[1], sine * vector_e[0] + cosine * vector_e[1], vector_e[2]])


def inertial_flight(orbit, t_s, here_e):
    here_i = turned(here_e, EARTH_RATE * t_s)

    def excess(flight):
        there_e = satellite_states(orbit, np.array([t_s - flight])).pos_e[0]
        return np.linalg.norm(turned(there_e, EARTH_RATE * (t_s - flight)) - here_i) / SPEED_OF_LIGHT - flight

    return brentq(excess, 0.05, 0.12, xtol=1e-17, rtol=1e-15)


def test_distance_is_that_of_light_time_in_inertial_space():
    t_s = np.array([0.0, 47.0])
    sights, antenna = sight_at(t_s)
    here_e = ecef_from_lla(antenna.lla)
    assert len(sights.epoch) > 30
    for row, (epoch, satellite) in enumerate(zip(sights.epoch, sights.satellite, strict=True)):
        time = t_s[epoch] + 2000.0
        flight = inertial_flight(ORBITS.rows(np.array([satellite])), time, here_e[epoch])
        assert sights.distance[row] == pytest.approx(SPEED_OF_LIGHT * flight, abs=1e-6)
        there = satellite_states(ORBITS.rows(np.array([satellite])), np.array([time - flight]))
        np.testing.assert_allclose(sights.pos_e[row], turned(there.pos_e[0], -EARTH_RATE * flight), atol=1e-6)
        np.testing.assert_allclose(sights.vel_e[row], turned(there.vel_e[0], -EARTH_RATE * flight), atol=1e-9)
        assert sights.clock[row] == pytest.approx(there.clock[0], abs=1e-18)


def test_distance_joins_the_places_told():
    sights, antenna = sight_at(np.arange(0.0, 100.0, 7.0))
    straight = np.linalg.norm(sights.pos_e - ecef_from_lla(antenna.lla)[sights.epoch], axis=1)
    np.testing.assert_allclose(sights.distance, straight, atol=1e-8)
    elevation, azimuth = look_angles(antenna.lla[sights.epoch], sights.pos_e)
    np.testing.assert_allclose(sights.elevation, elevation, atol=1e-12)
    np.testing.assert_allclose(sights.azimuth, azimuth, atol=1e-12)


def test_rate_is_the_derivative_of_the_distance():
    step = 0.005
    t_s = np.arange(5.0, 115.0, 5.0)
    now, before, after = (sight_at(t_s + shift)[0] for shift in (0.0, -step, step))
    assert np.array_equal(now.satellite, before.satellite)
    assert np.array_equal(now.satellite, after.satellite)
    np.testing.assert_allclose(now.rate, (after.distance - before.distance) / (2 * step), atol=1e-5)
    assert np.ptp(now.rate) > 500


def test_velocity_and_clock_rate_are_derivatives():
    step = 0.1
    t_s = np.linspace(-7000.0, 7000.0, len(ORBITS))
    now, before, after = (satellite_states(ORBITS, t_s + shift) for shift in (0.0, -step, step))
    np.testing.assert_allclose(now.vel_e, (after.pos_e - before.pos_e) / (2 * step), atol=2e-6)
    np.testing.assert_allclose(now.clock_rate, (after.clock - before.clock) / (2 * step), atol=1e-15)


def test_the_next_ephemeris_describes_the_same_motion():
    t_s = np.linspace(0.0, 7200.0, len(ORBITS))
    later = refer_to(ORBITS, REFERENCE_NS + 2 * HOUR_NS)
    first, second = satellite_states(ORBITS, t_s), satellite_states(later, t_s - 7200.0)
    np.testing.assert_allclose(second.pos_e, first.pos_e, atol=1e-6)
    np.testing.assert_allclose(second.vel_e, first.vel_e, atol=1e-9)
    np.testing.assert_allclose(second.clock, first.clock, atol=1e-16)


def test_node_turns_back_with_the_earth_from_the_beginning_of_the_week():
    week_start = replace(ORBITS, reference_ns=2304 * 168 * HOUR_NS)
    node = ascending_node(week_start, 0)
    np.testing.assert_allclose(np.remainder(node - ORBITS.node_longitude + pi, 2 * pi), pi, atol=1e-12)
    an_hour_later = ascending_node(replace(week_start, reference_ns=week_start.reference_ns + HOUR_NS), 0)
    turn = np.remainder(an_hour_later - node, 2 * pi)
    np.testing.assert_allclose(turn, 3600 * ORBITS.earth_rate, atol=1e-9)


def test_orbits_are_those_of_the_systems():
    states = satellite_states(ORBITS, np.zeros(len(ORBITS)))
    radius, systems = np.linalg.norm(states.pos_e, axis=1), system_of(ORBITS.sat)
    for system, count, nominal in (("G", 30, 26.56e6), ("E", 24, 29.6e6), ("C", 24, 27.9e6)):
        chosen = systems == system
        assert chosen.sum() == count
        np.testing.assert_allclose(radius[chosen], nominal, rtol=0.02)
    assert len(set(ORBITS.sat.tolist())) == 78
    assert np.abs(states.clock).max() < 1e-3


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(47.4, 8.5), (39.1, 117.2), (-34.0, 151.0), (1.3, 103.8), (65.0, 25.0)])
def test_as_many_satellites_as_in_reality(lat_deg, lon_deg):
    t_s = np.arange(0.0, 86400.0, 1800.0)
    n = len(t_s)
    lla = np.tile([np.radians(lat_deg), np.radians(lon_deg), 100.0], (n, 1))
    sights = sight_satellites(ORBITS, t_s, lla, np.zeros((n, 3)), 10 * pi / 180)
    assert np.degrees(sights.elevation.min()) >= 10
    systems = system_of(ORBITS.sat[sights.satellite])
    for system, low, high in (("G", 8.0, 12.0), ("E", 6.0, 10.0), ("C", 6.0, 10.0)):
        counts = np.bincount(sights.epoch[systems == system], minlength=n)
        assert low < counts.mean() < high
        assert counts.min() >= 5


def test_all_sights_are_found_that_a_lower_mask_has():
    lla, t_s = np.tile([0.8, 0.2, 50.0], (20, 1)), np.arange(20) * 900.0
    low, high = (sight_satellites(ORBITS, t_s, lla, np.zeros((20, 3)), mask) for mask in (0.1, 0.3))
    kept = low.elevation >= 0.3
    np.testing.assert_array_equal(low.satellite[kept], high.satellite)
    np.testing.assert_array_equal(low.distance[kept], high.distance)


def test_signals_and_carriers_by_system():
    sat = np.array(["G01", "E05", "C19"])
    assert signal_of(sat).tolist() == ["1C", "1C", "2I"]
    np.testing.assert_array_equal(carrier_of(sat), [1575.42e6, 1575.42e6, 1561.098e6])


def test_orbits_of_a_journey_are_shared_and_read_only():
    journey = SCENARIOS["ranges-open"].journey
    orbits = orbits_of(journey, Receiver(systems="GC"))
    assert set(system_of(orbits.sat).tolist()) == {"G", "C"}
    assert 0 <= journey.start_ns - orbits.reference_ns < HOUR_NS
    with pytest.raises(ValueError, match="read-only"):
        orbits.af0[0] = 0.0
