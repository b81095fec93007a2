"""Fixes and ranges kept from the filter: thinning and simulated outages."""

import numpy as np
import pytest

from navreplay.geodesy.time_scales import gps_from_week_tow, week_tow_from_gps
from navreplay.timeline import FixStatus, GnssFixSeries, LogError
from pipelines.config.sections import OutageSection
from pipelines.drive.outages import outage_windows, withhold_fixes, withhold_ranges
from tests.helpers.range_samples import make_ranges

WEEK, START = 2374, 243258.499


def fixes_at(tow_s):
    n = len(tow_s)
    return GnssFixSeries(
        t_ns=gps_from_week_tow(WEEK, np.asarray(tow_s)),
        lla=np.tile([0.7, 0.1, 100.0], (n, 1)),
        vel_n=np.full((n, 3), np.nan),
        cov_pos=np.tile(np.eye(3), (n, 1, 1)),
        cov_vel=np.full((n, 3, 3), np.nan),
        status=np.full(n, FixStatus.FIXED, dtype=np.int8),
    )


def kept_tow(section, tow_s):
    fixes = fixes_at(tow_s)
    kept = withhold_fixes(fixes, section).t_ns
    return np.asarray(tow_s)[np.isin(fixes.t_ns, kept)]


def test_without_settings_every_fix_stays():
    tow = START + np.arange(40) * 0.25
    assert np.array_equal(kept_tow(OutageSection(), tow), tow)


def test_thinning_keeps_the_first_fix_of_each_interval_in_spite_of_jitter():
    jitter = np.array([0, 4e-4, -4e-4, 3e-4, -9e-4, 0, 2e-4, -3e-4, -8e-4, 0, 0, 0])
    tow = START + np.arange(12) * 0.25 + jitter
    assert np.array_equal(kept_tow(OutageSection(fix_interval_s=1.0), tow), tow[[0, 4, 8]])


def test_thinning_of_fixes_that_are_rarer_than_the_interval_keeps_all():
    tow = START + np.array([0.0, 2.5, 5.0, 7.5])
    assert np.array_equal(kept_tow(OutageSection(fix_interval_s=1.0), tow), tow)


def test_a_window_withholds_what_is_behind_its_start_up_to_its_end():
    tow = np.arange(100.0, 110.0)
    section = OutageSection(windows_gps_tow=((102.0, 105.0),), week=WEEK)
    assert kept_tow(section, tow).tolist() == [100, 101, 102, 106, 107, 108, 109]


def test_the_edges_of_a_window_tolerate_a_millisecond():
    tow = np.array([100.0, 102.0009, 103.0, 105.0009, 105.002])
    section = OutageSection(windows_gps_tow=((102.0, 105.0),), week=WEEK)
    assert kept_tow(section, tow).tolist() == [100.0, 102.0009, 105.002]


def test_without_a_week_windows_count_from_the_week_of_the_first_fix():
    section = OutageSection(windows_gps_tow=((102.0, 105.0),))
    (window,) = outage_windows(section, fixes_at([100.0]).t_ns)
    assert window == tuple(gps_from_week_tow(WEEK, np.array([102.0, 105.0])))


def test_a_window_without_fixes_is_told():
    section = OutageSection(windows_gps_tow=((202.0, 205.0),), week=WEEK - 1)
    with pytest.raises(
        LogError, match=r"no fix lies in the window 202\.000 to 205\.000 s of week 2373, but the fixes span 100"
    ):
        withhold_fixes(fixes_at([100.0, 101.0]), section)


def test_withholding_everything_is_told():
    section = OutageSection(windows_gps_tow=((99.0, 105.0),), week=WEEK)
    with pytest.raises(LogError, match="withhold every fix"):
        withhold_fixes(fixes_at([100.0, 101.0]), section)


def test_windows_withhold_ranges_but_for_the_satellites_kept():
    ranges = make_ranges(10)
    week, tow = week_tow_from_gps(ranges.t_ns[:1])
    start = float(tow[0])
    windows = ((start + 2, start + 5),)
    inside = (ranges.t_ns > ranges.t_ns[0] + 2_000_000_000) & (ranges.t_ns <= ranges.t_ns[0] + 5_000_000_000)
    bare = withhold_ranges(ranges, OutageSection(windows_gps_tow=windows, week=int(week[0])))
    assert np.array_equal(bare.t_ns, ranges.t_ns[~inside])
    two = withhold_ranges(ranges, OutageSection(windows_gps_tow=windows, satellites_kept=2))
    assert len(two) == len(bare) + 2 * 3
    assert len(np.unique(two.sat[(two.t_ns > windows[0][0]) & np.isin(two.t_ns, ranges.t_ns[inside])])) == 2
    assert two.troposphere_removed


def test_thinning_of_ranges_keeps_whole_epochs():
    ranges = make_ranges(10)
    assert np.array_equal(np.unique(withhold_ranges(ranges, OutageSection(fix_interval_s=3.0)).t_ns), ranges.t_ns[::33])
    assert withhold_ranges(ranges, OutageSection()) is ranges


def test_windows_without_ranges_or_that_leave_none_are_told():
    ranges = make_ranges(3)
    week, tow = week_tow_from_gps(ranges.t_ns[:1])
    with pytest.raises(LogError, match="no range lies in the window"):
        withhold_ranges(ranges, OutageSection(windows_gps_tow=((0.0, 1.0),), week=int(week[0]) + 1))
    with pytest.raises(LogError, match="withhold every range"):
        withhold_ranges(ranges, OutageSection(windows_gps_tow=((float(tow[0]) - 1, float(tow[0]) + 9),)))
