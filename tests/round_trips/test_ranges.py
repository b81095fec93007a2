"""Synthetic ranges, every writer, importer: satellites computed from ephemerides equal those that were simulated."""

from pathlib import Path

import numpy as np
import pytest

from importers import load_timeline
from navreplay.timeline import RangeSeries
from synthetic_logs import SCENARIOS, simulate, with_duration, write

LOG = simulate(with_duration(SCENARIOS["ranges-open"], 6.0), 5)


def both(tmp_path: Path, name: str) -> tuple[RangeSeries, RangeSeries]:
    *paths, _ = write(LOG, tmp_path / name)
    ranges = load_timeline(paths).ranges
    assert ranges is not None
    assert LOG.ranges is not None
    return ranges, LOG.ranges


@pytest.mark.parametrize("name", ["log.mcap", "log.csv"])
def test_corrected_ranges_come_back_exactly(tmp_path: Path, name: str) -> None:
    ranges, told = both(tmp_path, name)
    for column in ("t_ns", "sat", "signal", "pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0"):
        np.testing.assert_array_equal(getattr(ranges, column), getattr(told, column))
    np.testing.assert_array_equal(ranges.sat_pos_e, told.sat_pos_e)
    np.testing.assert_array_equal(ranges.sat_vel_e, told.sat_vel_e)


@pytest.mark.parametrize(("name", "rounding_m"), [("log.obs", 6e-4), ("log.bag", 1e-6), ("log.db3", 1e-6)])
def test_raw_ranges_come_back_with_their_satellites(tmp_path: Path, name: str, rounding_m: float) -> None:
    ranges, told = both(tmp_path, name)
    for column in ("t_ns", "sat", "signal"):
        np.testing.assert_array_equal(getattr(ranges, column), getattr(told, column))
    np.testing.assert_allclose(ranges.sat_pos_e, told.sat_pos_e, atol=1e-3)
    np.testing.assert_allclose(ranges.sat_vel_e, told.sat_vel_e, atol=1e-6)
    np.testing.assert_allclose(ranges.pseudorange, told.pseudorange, atol=rounding_m)
    np.testing.assert_allclose(ranges.range_rate, told.range_rate, atol=2e-4)
    assert ranges.klobuchar is not None
    np.testing.assert_allclose(ranges.klobuchar, told.klobuchar, rtol=1e-12)
