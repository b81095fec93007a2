"""Ranges arranged and solved epoch by epoch: exactness, faults, too few satellites, honest covariance."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.geodesy import earth
from navreplay.measurements.atmosphere import klobuchar_delay, look_angles, saastamoinen_delay
from navreplay.measurements.least_squares import fixes_of, interpolate_positions, solve_points
from navreplay.measurements.range_epochs import arrange_ranges, correct_ranges
from navreplay.options import RangeOptions
from navreplay.timeline import LogError
from tests.helpers.range_samples import DRIFT, OFFSETS, PLACE, SKY, make_ranges

VELOCITY = (12.0, -5.0, 0.5)


def test_exact_ranges_give_position_velocity_clocks_and_drift():
    points, _, left_out = solve_points(make_ranges(5, vel_n=VELOCITY), RangeOptions())
    assert not left_out
    assert points.groups == ("G", "E", "C")
    c_en = earth.matrix_en(PLACE[0], PLACE[1])
    for k in range(5):
        offsets = np.array([OFFSETS[name] for name in points.groups]) + DRIFT * k
        path = c_en @ np.array(VELOCITY)
        # at the times of reception, a receiver clock offset before the stamps
        expected = earth.ecef_from_lla(PLACE) + path * (k - offsets[0] / 299792458.0)
        np.testing.assert_allclose(points.pos_e[k], expected, atol=2e-6)
        np.testing.assert_allclose(points.clock[k], offsets, atol=2e-6)
        np.testing.assert_allclose(points.vel_e[k], path, atol=1e-6)
    np.testing.assert_allclose(points.drift, DRIFT, atol=1e-6)
    assert (points.used == len(SKY)).all()
    assert (points.excluded == 0).all()


def test_errors_match_the_covariance():
    """The covariance grows where residuals are larger than told but never shrinks: a tenth too large."""
    points, _, _ = solve_points(make_ranges(2000, noise=(2.0, 0.1), told=(2.0, 0.1), seed=4), RangeOptions())
    fixes = fixes_of(points)
    error = earth.ned_between(PLACE, fixes.lla)
    nees = np.einsum("ki,ki->k", error, np.linalg.solve(fixes.cov_pos, error[..., None])[..., 0])
    assert 2.4 < nees.mean() < 3.1
    velocity = np.einsum("ki,ki->k", fixes.vel_n, np.linalg.solve(fixes.cov_vel, fixes.vel_n[..., None])[..., 0])
    assert 2.4 < velocity.mean() < 3.1


def test_a_faulty_pseudorange_is_excluded():
    ranges = make_ranges(3, noise=(0.5, 0.02), told=(0.5, 0.02))
    bent = ranges.pseudorange.copy()
    bent[[2, len(SKY) + 6]] += [80.0, -400.0]
    points, _, _ = solve_points(replace(ranges, pseudorange=bent), RangeOptions())
    assert points.excluded.tolist() == [1, 1, 0]
    error = earth.ned_between(PLACE, earth.lla_from_ecef(points.pos_e))
    assert np.abs(error).max() < 3


def test_dilution_of_precision_of_a_textbook_geometry():
    """One satellite overhead and three at the horizon 120 deg apart: GDOP = sqrt(3), TDOP = 1/sqrt(3) of it, by hand."""
    import tests.helpers.range_samples as samples

    sky = {"G01": (90, 0), "G02": (0, 0), "G03": (0, 120), "G04": (0, 240)}
    ranges = make_ranges(1, ("G01", "G05", "G12", "G17"))
    here, c_en = earth.ecef_from_lla(PLACE), earth.matrix_en(PLACE[0], PLACE[1])
    sights = [
        (np.cos(np.radians(e)) * np.cos(np.radians(a)), np.cos(np.radians(e)) * np.sin(np.radians(a)), -np.sin(np.radians(e)))
        for e, a in sky.values()
    ]
    positions = here + 2.2e7 * np.array(sights) @ c_en.T
    flat = replace(ranges, sat_pos_e=positions, pseudorange=np.linalg.norm(positions - here, axis=1) + samples.OFFSETS["G"])
    points, _, _ = solve_points(flat, RangeOptions(elevation_mask=-0.1))
    horizontal = np.sqrt(4 / 3)
    vertical = np.sqrt(4 / 3)
    clock = np.sqrt(1 / 3)
    expected = [np.sqrt(horizontal**2 + vertical**2 + clock**2), np.hypot(horizontal, vertical), horizontal, vertical]
    np.testing.assert_allclose(points.dop[0], expected, rtol=1e-4)


def test_epochs_with_too_few_satellites_are_not_solved():
    ranges = make_ranges(4)
    keep = np.ones(len(ranges), dtype=bool)
    second = np.flatnonzero(ranges.t_ns == ranges.t_ns[len(SKY)])
    keep[second[3:]] = False
    columns = ("t_ns", "sat", "signal", "pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0", "sat_pos_e")
    fewer = replace(ranges, **{name: getattr(ranges, name)[keep] for name in (*columns, "sat_vel_e")})
    points, _, _ = solve_points(fewer, RangeOptions())
    assert points.solved.tolist() == [True, False, True, True]
    assert np.isnan(points.vel_e[1]).all()
    assert len(fixes_of(points)) == 3
    filled = interpolate_positions(points.t_ns, points.pos_e)
    np.testing.assert_allclose(filled[1], (points.pos_e[0] + points.pos_e[2]) / 2)


def test_what_cannot_be_used_is_told():
    with pytest.raises(LogError, match=r"no epoch can be solved .* the most satellites in one are 3, of systems G"):
        solve_points(make_ranges(3, ("G01", "G05", "G12")), RangeOptions())
    with pytest.raises(LogError, match=r"all 33 rows are weaker than 50 dB-Hz; is the C/N0 in another unit"):
        solve_points(make_ranges(3), RangeOptions(cn0_mask=50.0))


def test_rows_left_out_are_counted_by_reason():
    ranges = make_ranges(2)
    cn0 = ranges.cn0.copy()
    cn0[3] = 12.0
    twice = replace(ranges, cn0=cn0, sat=np.where(np.arange(len(ranges)) == 1, "G01", ranges.sat))
    epochs, left_out = arrange_ranges(twice, RangeOptions())
    assert left_out == {
        "below 30 dB-Hz": 1,
        "of a satellite already seen in the epoch": 1,
    }
    assert len(epochs.sat) + sum(left_out.values()) == len(ranges)
    _, _, low = solve_points(ranges, RangeOptions(elevation_mask=np.radians(26)))
    assert low == {"below 26 deg of elevation": 4}


def test_qzss_shares_the_clock_of_gps():
    ranges = make_ranges(1)
    epochs, _ = arrange_ranges(replace(ranges, sat=np.char.replace(ranges.sat, "E", "J")), RangeOptions())
    assert epochs.groups == ("G", "C")


def test_corrections_are_made_only_where_they_are_due():
    ranges = replace(
        make_ranges(1),
        ionosphere_removed=False,
        troposphere_removed=False,
        klobuchar=np.array([0.38e-7, 0.149e-7, -0.179e-6, 0.0, 0.143e6, 0.0, -0.328e6, 0.113e6]),
    )
    here = earth.ecef_from_lla(PLACE)[None]
    epochs, _ = arrange_ranges(ranges, RangeOptions())
    corrected, _ = correct_ranges(epochs, ranges, here, RangeOptions())
    elevation, azimuth = look_angles(PLACE, ranges.sat_pos_e)
    wet_and_dry = saastamoinen_delay(PLACE[0], PLACE[2], elevation)
    tow_s = ranges.t_ns[0] % 604_800_000_000_000 / 1e9
    l1 = klobuchar_delay(ranges.klobuchar, PLACE[0], PLACE[1], elevation, azimuth, tow_s)
    np.testing.assert_allclose(ranges.pseudorange - corrected.pseudorange, wet_and_dry + l1, atol=1e-6)
    dry_only, _ = correct_ranges(epochs, ranges, here, RangeOptions(ionosphere=False))
    np.testing.assert_allclose(ranges.pseudorange - dry_only.pseudorange, wet_and_dry, atol=1e-6)
    l5 = replace(ranges, signal=np.full(len(ranges), "5Q"), troposphere_removed=True)
    slower, _ = correct_ranges(arrange_ranges(l5, RangeOptions())[0], l5, here, RangeOptions())
    np.testing.assert_allclose(l5.pseudorange - slower.pseudorange, l1 * (1575.42 / 1176.45) ** 2, atol=1e-6)


def test_noise_follows_elevation_and_strength_where_none_is_reported():
    ranges = make_ranges(1)
    unknown = np.full(len(ranges), np.nan)
    cn0 = np.where(np.arange(len(ranges)) == 0, 32.0, np.nan)
    bare = replace(ranges, pseudorange_std=unknown, range_rate_std=np.zeros(len(ranges)), cn0=cn0)
    _, corrected, _ = solve_points(bare, RangeOptions())
    sine = np.sin(np.radians([elevation for elevation, _ in SKY.values()]))
    weak = np.where(np.arange(len(ranges)) == 0, np.sqrt(2), 1.0)
    np.testing.assert_allclose(corrected.pseudorange_std, weak / sine, rtol=1e-3)
    np.testing.assert_allclose(corrected.range_rate_std, 0.05 * weak / np.sqrt(sine), rtol=1e-3)
