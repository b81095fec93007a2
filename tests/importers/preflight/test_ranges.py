"""What inspect tells of raw ranges."""

from dataclasses import replace

import numpy as np
import pytest

from importers.preflight.ranges import check_ranges, clock_jumps
from navreplay.timeline import ChannelUse, RangeSeries

MILLISECOND_M = 299_792.458
S = 10**9


def series(epochs: int = 20, sats: tuple[str, ...] = ("E01", "E02", "G03", "G04", "G05")) -> RangeSeries:
    """Satellites that recede at 100 m/s, once a second."""
    n = epochs * len(sats)
    epoch = np.repeat(np.arange(epochs), len(sats))
    unknown = np.full(n, np.nan)
    return RangeSeries(
        t_ns=1_300_000_000 * S + epoch * S,
        sat=np.tile(np.array(sats), epochs),
        signal=np.full(n, "1C"),
        pseudorange=2.2e7 + 100.0 * epoch,
        range_rate=np.full(n, 100.0),
        pseudorange_std=unknown,
        range_rate_std=unknown,
        cn0=np.full(n, 42.0),
        sat_pos_e=np.full((n, 3), 2e7),
        sat_vel_e=np.zeros((n, 3)),
    )


def test_satellites_and_signal_strength_are_listed() -> None:
    (finding,) = check_ranges(series(), ())
    assert finding.text.startswith("Ranges of 5 satellites at a time (5 to 5); 2 of Galileo, 3 of GPS in all; C/N0 42 dB-Hz")


@pytest.mark.parametrize("jump_ms", [-1.0, 3.0])
def test_a_common_step_is_a_jump_of_the_clock(jump_ms: float) -> None:
    ranges = series()
    step = np.where(ranges.t_ns >= ranges.t_ns[0] + 7 * S, jump_ms * MILLISECOND_M, 0.0)
    ranges = replace(ranges, pseudorange=ranges.pseudorange + step)
    times, sizes = clock_jumps(ranges)
    assert times.tolist() == [ranges.t_ns[0] + 7 * S]
    assert sizes == pytest.approx([jump_ms * MILLISECOND_M])
    text = next(finding.text for finding in check_ranges(ranges, ()) if finding.code == "clock-jumps")
    assert text == f"The receiver's clock jumps 1 times, by {abs(jump_ms):g} ms as a rule."


def test_a_step_of_one_satellite_is_no_jump() -> None:
    ranges = series()
    wrong = (ranges.sat == "G03") & (ranges.t_ns > ranges.t_ns[0] + 7 * S)
    assert len(clock_jumps(replace(ranges, pseudorange=ranges.pseudorange + np.where(wrong, 1e6, 0.0)))[0]) == 0


def test_gaps_few_satellites_and_poor_coverage_are_told() -> None:
    ranges = series(sats=("G01", "G02"))
    ranges = replace(ranges, t_ns=ranges.t_ns + np.where(ranges.t_ns > ranges.t_ns[0] + 9 * S, 30 * S, 0))
    use = ChannelUse("a", "a", "ubx/RXM-RAWX", "range", 100, 40, {"no ephemeris": 50, "satellite unhealthy": 10})
    found = {finding.code: finding for finding in check_ranges(ranges, (use,))}
    assert found.keys() == {"ranges", "range-gaps", "few-satellites", "ephemeris-coverage"}
    assert found["range-gaps"].text == "The ranges have 1 gaps, the longest of 31.0 s, 31.0 s in all."
    assert found["ephemeris-coverage"].level == "warning"
    assert found["ephemeris-coverage"].text.startswith("60 % of the pseudoranges")
