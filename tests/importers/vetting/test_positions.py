"""Repeated fixes and fixes that jump away and back are rejected with their reason; sound ones never are."""

from dataclasses import replace

import numpy as np
import pytest

from importers.vetting.jumps import leave_out_jumps
from importers.vetting.repeats import leave_out_repeats
from importers.vetting.vet import vet
from navreplay.timeline import ChannelUse, GnssFixSeries, Provenance
from synthetic_logs import SCENARIOS, simulate, with_duration
from tests.field.promise import DRIVES, spoil


def rounded(fixes: GnssFixSeries, digits: int) -> GnssFixSeries:
    """Positions with so many digits of a degree, as a driver prints them."""
    degrees = np.round(np.degrees(fixes.lla[:, :2]), digits)
    return replace(fixes, lla=np.column_stack([np.radians(degrees), np.round(fixes.lla[:, 2], 1)]))


@pytest.mark.parametrize("drive", ["town", "town-rtk", "town-positions"])
@pytest.mark.parametrize(("start", "length"), [(40.0, 3.0), (40.0, 5.0), (60.0, 15.0), (60.0, 30.0)])
def test_a_frozen_receiver_gives_no_fixes(drive: str, start: float, length: float) -> None:
    fixes = spoil(drive, f"frozen-{length:g}s-at-{start:g}s").log.fixes
    vetted = leave_out_repeats(fixes)
    at = (fixes.t_ns - fixes.t_ns[0]) / 1e9
    kept = np.isin(fixes.t_ns, vetted.fixes.t_ns[vetted.fixes.has_position])
    assert np.array_equal(~kept, (at >= start) & (at < start + length))
    assert vetted.positions_out == int((~kept).sum())
    assert vetted.findings[0].code == "repeated-fixes"


def test_what_is_published_twice_counts_once() -> None:
    fixes = spoil("town", "twice").log.fixes
    vetted = leave_out_repeats(fixes)
    assert np.array_equal(vetted.fixes.t_ns, fixes.t_ns[::2])
    assert vetted.rows_out == len(fixes) // 2


@pytest.mark.parametrize("rate", [5.0, 10.0])
def test_rows_between_the_fixes_of_a_slower_receiver_are_repeats(rate: float) -> None:
    log = spoil("town-rtk", None).log.fixes
    held = log.lla[np.arange(len(log)) // 5 * 5]
    bare = np.full_like(log.vel_n, np.nan)
    vetted = leave_out_repeats(replace(log, lla=held, vel_n=bare, cov_vel=np.full_like(log.cov_vel, np.nan)))
    moving = np.hypot(*log.vel_n[:, :2].T) > 4
    assert vetted.positions_out > 0.75 * moving.sum()
    assert np.isin(log.t_ns[::5], vetted.fixes.t_ns).all()


@pytest.mark.parametrize("digits", [9, 7, 6, 5])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_coarse_receiver_is_not_a_frozen_one(drive: str, digits: int) -> None:
    fixes = rounded(spoil(drive, None).log.fixes, digits)
    vetted = leave_out_repeats(fixes)
    assert vetted.positions_out <= 0.01 * len(fixes)


@pytest.mark.parametrize("name", [name for name, one in SCENARIOS.items() if one.gnss is not None])
def test_sound_positions_are_left_alone(name: str) -> None:
    log = simulate(with_duration(SCENARIOS[name], 150.0), 4)
    if name == "car-outliers":
        return  # its outliers are jumps
    vetted, findings = vet(log.timeline())
    assert findings == ()
    assert vetted.fixes is log.fixes


@pytest.mark.parametrize(("offset", "length"), [(3.0, 4.0), (3.0, 20.0), (30.0, 2.0), (200.0, 10.0), (5000.0, 5.0)])
def test_a_jump_away_and_back_is_left_out(offset: float, length: float) -> None:
    fixes = spoil("town-rtk", f"jump-{offset:g}m-{length:g}s").log.fixes
    vetted = leave_out_jumps(fixes)
    at = (fixes.t_ns - fixes.t_ns[0]) / 1e9
    assert np.array_equal(~vetted.fixes.has_position, (at >= 50.0) & (at < 50.0 + length))
    assert vetted.fixes.has_velocity.all()


def test_a_jump_without_return_is_kept() -> None:
    fixes = spoil("town-rtk", None).log.fixes
    moved = fixes.lla.copy()
    moved[300:, 0] += 3.0 / 6.37e6
    assert leave_out_jumps(replace(fixes, lla=moved)).findings == ()


def test_what_is_left_out_is_accounted_for() -> None:
    spoilt = spoil("town", "twice").log
    timeline = spoilt.timeline()
    n = len(spoilt.fixes)
    use = ChannelUse("/fix", "log", "sensor_msgs/msg/NavSatFix", "fix", n + 2, n, {"no fix": 2})
    vetted, findings = vet(replace(timeline, provenance=Provenance((), (use,), ())))
    (channel,) = vetted.provenance.channels
    assert channel.rejected == {"no fix": 2, "repeats the fix before": n // 2}
    assert channel.used == len(vetted.fixes)
    assert len(findings) == 1
