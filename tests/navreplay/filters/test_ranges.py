"""Ranges through the epoch loop: consistency, few satellites, clock resets, faults, no IMU, and the choice of aiding."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import synthetic_logs
from navreplay.evaluation.metrics import evaluate, find_outages
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import earth, rotation
from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, MotionOptions, RangeOptions
from navreplay.solution import Solution
from navreplay.timeline import FixStatus, GnssFixSeries, LogError, RangeSeries, Timeline, Trajectory
from tests.helpers.range_samples import PLACE, SKY, make_ranges

SCENARIO = synthetic_logs.SCENARIOS["ranges-open"]
COLUMNS = (
    *("t_ns", "sat", "signal", "pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0"),
    *("sat_pos_e", "sat_vel_e"),
)


@pytest.fixture(scope="module")
def log() -> synthetic_logs.SyntheticLog:
    return synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIO, 120.0), 5)


def options(**changes) -> FilterOptions:
    alignment = AlignmentOptions(course_std=np.radians(0.3))
    ranges = RangeOptions(clock_drift_walk=SCENARIO.receiver.clock.frequency_walk)
    plain = FilterOptions(imu_noise=SCENARIO.imu.noise, alignment=alignment, output_rate=1.0, ranges=ranges)
    return replace(plain, **changes)


def select(ranges: RangeSeries, keep: np.ndarray) -> RangeSeries:
    return replace(ranges, **{name: getattr(ranges, name)[keep] for name in COLUMNS})


def errors(solution: Solution, truth: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """True minus computed (k, 9) and covariances (k, 9, 9) at the rows whose time is in truth."""
    at = np.minimum(np.searchsorted(truth.t_ns, solution.t_ns), len(truth) - 1)
    rows = truth.t_ns[at] == solution.t_ns
    at = at[rows]
    turn = rotation.quat_multiply(truth.q_nb[at], rotation.quat_conjugate(solution.q_nb[rows]))
    position = earth.ned_between(solution.lla[rows], truth.lla[at])
    error = np.hstack([position, truth.vel_n[at] - solution.vel_n[rows], rotation.rotvec_from_quat(turn)])
    return error, solution.cov[rows, :9, :9]


def normalised(solution: Solution, truth: Trajectory, block: slice) -> np.ndarray:
    error, cov = errors(solution, truth)
    e, p = error[:, block], cov[:, block, block]
    return np.einsum("ki,ki->k", e, np.linalg.solve(p, e[..., None])[..., 0])


def events(solution: Solution, word: str) -> list[str]:
    return [event.text for event in solution.events if word in event.text]


def test_nees_lies_in_its_bounds():
    seeds, squares = 20, []
    scenario = synthetic_logs.with_duration(SCENARIO, 90.0)
    for seed in range(seeds):
        drive = synthetic_logs.simulate(scenario, 300 + seed)
        solution = run_filter(drive.timeline(), build_method("fixed"), options(gate=GateOptions(probability=1.0)))
        squares.append([normalised(solution, drive.truth, slice(3 * i, 3 * i + 3))[-55:] for i in range(3)])
    low, high = chi2.ppf([0.025, 0.975], 3 * seeds) / seeds
    for name, nees in zip(("position", "velocity", "attitude"), np.mean(squares, axis=0), strict=True):
        assert ((nees > low) & (nees < high)).mean() >= 0.85, (name, nees.mean())
        assert nees.mean() == pytest.approx(3, abs=0.6), name


def test_states_are_those_of_the_paper_with_a_clock_offset_per_constellation(log):
    ranges = log.timeline().ranges
    gps = select(ranges, np.char.startswith(ranges.sat, "G"))
    solution = run_filter(replace(log.timeline(), ranges=gps), build_method("fixed"), options())
    assert len(solution.state_names) == 20
    assert solution.state_names[-2:] == ("clock_offset_G", "clock_drift")
    every = run_filter(log.timeline(), build_method("fixed"), options())
    assert sum(name.startswith("clock_offset") for name in every.state_names) == len(np.unique(ranges.sat.astype("U1")))


@pytest.mark.parametrize("name", ["iae", "sage-husa", "huber", "eiakf", "srmakf", "ermakf", "ermakf-derived"])
def test_adapters_run_though_satellites_come_and_go(log, name):
    ranges = log.timeline().ranges
    coming_and_going = np.random.default_rng(1).random(len(ranges)) < 0.8
    timeline = replace(log.timeline(), ranges=select(ranges, coming_and_going))
    solution = run_filter(timeline, build_method(name), options())
    scale = solution.std
    assert np.linalg.eigvalsh(solution.cov / (scale[:, :, None] * scale[:, None, :])).min() > 0
    error, _ = errors(solution, log.truth)
    assert np.abs(error[-20:, :3]).max() < 3
    assert {series.kind for series in solution.innovations} == {"range", "range_rate"}


@pytest.mark.parametrize("count", [3, 2, 1])
def test_few_satellites_still_bound_the_drift_and_the_covariance_says_how_well(log, count):
    ranges = log.timeline().ranges
    begin = ranges.t_ns[0] + 60_000_000_000
    inside = (ranges.t_ns > begin) & (ranges.t_ns <= begin + 30_000_000_000)
    some = select(ranges, ~inside | np.isin(ranges.sat, np.unique(ranges.sat[inside])[:count]))
    none = select(ranges, ~inside)
    solution = run_filter(replace(log.timeline(), ranges=some), build_method("fixed"), options())
    without = run_filter(replace(log.timeline(), ranges=none), build_method("fixed"), options())
    assert normalised(solution, log.truth, slice(0, 3)).max() < 25
    at = np.searchsorted(solution.t_ns, begin + 29_000_000_000)
    before = np.searchsorted(without.t_ns, begin + 29_000_000_000)
    assert np.trace(solution.cov[at, :3, :3]) < np.trace(without.cov[before, :3, :3])
    assert len(find_outages(solution)) < len(find_outages(without)) == 1


def test_millisecond_resets_of_the_clock_are_absorbed_and_told():
    scenario = synthetic_logs.with_duration(synthetic_logs.SCENARIOS["ranges-resets"], 150.0)
    drive = synthetic_logs.simulate(scenario, 2)
    solution = run_filter(drive.timeline(), build_method("fixed"), options())
    assert any("1.000000 ms" in text for text in events(solution, "clock jumped"))
    assert solution.innovations[0].used.mean() > 0.99
    assert normalised(solution, drive.truth, slice(0, 3)).mean() == pytest.approx(3, abs=2)


def test_an_odd_jump_of_the_clock_is_absorbed_but_a_single_fault_is_not_one(log):
    ranges = log.timeline().ranges
    late = ranges.t_ns > ranges.t_ns[0] + 70_000_000_000
    jumped = replace(ranges, pseudorange=ranges.pseudorange + np.where(late, 12_345.0, 0.0))
    solution = run_filter(replace(log.timeline(), ranges=jumped), build_method("fixed"), options())
    assert len(events(solution, "clock jumped")) == 1
    assert np.abs(errors(solution, log.truth)[0][-20:, :3]).max() < 2
    first = ranges.sat == ranges.sat[-1]
    faulty = replace(ranges, pseudorange=ranges.pseudorange + np.where(late & first, 12_345.0, 0.0))
    solution = run_filter(replace(log.timeline(), ranges=faulty), build_method("fixed"), options())
    assert not events(solution, "clock jumped")
    assert np.abs(errors(solution, log.truth)[0][-20:, :3]).max() < 2


def test_each_rejected_range_keeps_its_reason(log):
    ranges = log.timeline().ranges
    bad = (ranges.sat == ranges.sat[-1]) & (ranges.t_ns == ranges.t_ns[-1] - 20_000_000_000)
    assert bad.sum() == 1
    faulty = replace(ranges, pseudorange=ranges.pseudorange + 60.0 * bad, range_rate=ranges.range_rate - 5.0 * bad)
    solution = run_filter(replace(log.timeline(), ranges=faulty), build_method("fixed"), options())
    for series in solution.innovations:
        at = (series.t_ns == ranges.t_ns[bad][0]) & (np.array(series.sources) == ranges.sat[-1])
        assert at.sum() == 1
        assert not series.used[at][0]
        assert "beyond the gate" in series.reason[int(np.flatnonzero(at)[0])]
        assert series.residual.shape == (len(series.t_ns), 1)


def test_a_constellation_that_rises_later_brings_its_own_offset(log):
    ranges = log.timeline().ranges
    letters = list(dict.fromkeys(ranges.sat.astype("U1").tolist()))
    early = ranges.t_ns < ranges.t_ns[0] + 80_000_000_000
    later = select(ranges, ~(early & np.char.startswith(ranges.sat, letters[-1])))
    solution = run_filter(replace(log.timeline(), ranges=later), build_method("fixed"), options())
    at = solution.state_names.index(f"clock_offset_{letters[-1]}")
    assert solution.std[5, at] > 200
    assert solution.std[-1, at] < 3
    assert solution.innovations[0].used.mean() > 0.99


def test_without_imu_the_filter_says_so_and_follows_the_antenna():
    velocity = (8.0, 6.0, 0.0)
    ranges = make_ranges(120, noise=(1.0, 0.05), told=(1.0, 0.05), vel_n=velocity)
    for model in ("velocity", "acceleration"):
        solution = run_filter(
            Timeline(ranges=ranges), build_method("fixed"), FilterOptions(motion=MotionOptions(model, 0.1, 0.1))
        )
        assert solution.method == "fixed without IMU"
        assert events(solution, "the log holds no IMU")
        t_s = (solution.t_ns - ranges.t_ns[0]) / 1e9
        truth = earth.move_lla(PLACE, t_s[:, None] * np.array(velocity))
        error = earth.ned_between(truth, solution.lla)
        nees = np.einsum("ki,ki->k", error, np.linalg.solve(solution.cov[:, :3, :3], error[..., None])[..., 0])
        assert nees.mean() == pytest.approx(3, abs=2)
        yaw = rotation.euler_from_quat(solution.q_nb)[-1, 2]
        assert yaw == pytest.approx(np.arctan2(6, 8), abs=0.05)
        assert (solution.std[:, 6:8] > 0.1).all()
    unknown = np.full((len(t_s), 4), np.nan)
    reference = Trajectory(solution.t_ns, truth, np.tile(velocity, (len(t_s), 1)), unknown, np.full((len(t_s), 3, 3), np.nan))
    assert evaluate(solution, reference).statistics["all"]["position"]["3d"].p95 < 3


def test_a_filter_starts_where_enough_satellites_agree():
    ranges = make_ranges(30, noise=(1.0, 0.05))
    poor = ranges.t_ns < ranges.t_ns[0] + 10_000_000_000
    four = np.isin(ranges.sat, ["G01", "G05", "G12", "G17"])
    solution = run_filter(Timeline(ranges=select(ranges, ~poor | four)), build_method("fixed"), FilterOptions())
    assert solution.t_ns[0] == ranges.t_ns[0] + 10_000_000_000


def test_what_aids_the_filter_can_be_chosen(log):
    timeline = log.timeline()
    at = np.arange(0, len(log.truth), 100)
    n = len(at)
    fixes = GnssFixSeries(
        log.truth.t_ns[at],
        log.truth.lla[at],
        np.full((n, 3), np.nan),
        np.tile(np.eye(3), (n, 1, 1)),
        np.full((n, 3, 3), np.nan),
        np.full(n, FixStatus.SINGLE, dtype=np.int8),
    )
    both = replace(timeline, fixes=fixes)
    kinds = {
        use: {series.kind for series in run_filter(both, build_method("fixed"), options(use=use)).innovations}
        for use in ("auto", "ranges", "fixes")
    }
    assert kinds == {"auto": {"range", "range_rate"}, "ranges": {"range", "range_rate"}, "fixes": {"position"}}
    with pytest.raises(LogError, match=r"filter\.use is 'ranges', but the log holds none"):
        run_filter(Timeline(imu=timeline.imu, fixes=fixes), build_method("fixed"), options(use="ranges"))
    with pytest.raises(LogError, match="no GNSS fixes"):
        run_filter(Timeline(imu=timeline.imu, ranges=timeline.ranges), build_method("fixed"), options(use="fixes"))
    with pytest.raises(LogError, match="no IMU channel"):
        run_filter(Timeline(fixes=fixes, ranges=timeline.ranges), build_method("fixed"), options(use="fixes"))


def test_epochs_scattered_over_years_are_refused_in_one_line(log):
    """As when the week of a table is taken from a column that counts epochs."""
    ranges = log.timeline().ranges
    epoch = (ranges.t_ns - ranges.t_ns[0]) // 10**9
    scattered = replace(ranges, t_ns=ranges.t_ns + epoch * 7 * 86_400 * 10**9)
    with pytest.raises(LogError, match=r"reach over [\d.]+ days, too long for rows at 1 Hz; are their stamps right"):
        run_filter(Timeline(ranges=scattered), build_method("fixed"), options())


def test_the_same_run_twice_is_identical(log):
    first = run_filter(log.timeline(), build_method("iae"), options())
    second = run_filter(log.timeline(), build_method("iae"), options())
    for name in ("t_ns", "lla", "vel_n", "q_nb", "cov"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_rates_alone_or_pseudoranges_alone_will_do(log):
    ranges = log.timeline().ranges
    silent = replace(ranges, range_rate=np.full(len(ranges), np.nan))
    solution = run_filter(replace(log.timeline(), ranges=silent), build_method("fixed"), options())
    assert {series.kind for series in solution.innovations} == {"range"}
    assert np.abs(errors(solution, log.truth)[0][-20:, :3]).max() < 5


def test_masks_are_told_with_their_counts():
    ranges = make_ranges(10)
    solution = run_filter(
        Timeline(ranges=ranges),
        build_method("fixed"),
        FilterOptions(ranges=RangeOptions(elevation_mask=np.radians(22))),
    )
    (text,) = events(solution, "left out")
    assert text == f"of {10 * len(SKY)} ranges are left out: 10 below 22 deg of elevation"


def test_estimated_multipath_makes_the_covariance_honest():
    """Under multipath of 20 s a filter that takes it for white noise believes what it averages; one with states does not."""
    receiver = replace(SCENARIO.receiver, pseudorange_std=0.5, multipath_std=1.5)
    scenario = replace(synthetic_logs.with_duration(SCENARIO, 90.0), receiver=receiver)
    judged = {}
    for share in (0.0, 0.8):
        ranges = RangeOptions(clock_drift_walk=receiver.clock.frequency_walk, multipath_share=share, multipath_time=20.0)
        nees = []
        for seed in (1, 2):
            drive = synthetic_logs.simulate(scenario, seed)
            solution = run_filter(drive.timeline(), build_method("fixed"), options(ranges=ranges))
            nees.append(normalised(solution, drive.truth, slice(0, 3))[-60:].mean())
        judged[share] = np.mean(nees)
    assert judged[0.0] > 15
    # a minute holds three values of such an error: six seeds have 44 and 4.0 on the average, single ones 1.8 to 7.8
    assert 1.0 < judged[0.8] < 9.0


def test_multipath_states_start_stationary_and_are_named():
    ranges = make_ranges(5, noise=(0.5, 0.02))
    solution = run_filter(
        Timeline(ranges=ranges), build_method("fixed"), FilterOptions(ranges=RangeOptions(multipath_share=0.5), output_rate=0.0)
    )
    first = solution.state_names.index(f"multipath_{min(SKY)}")
    assert solution.state_names[first:] == tuple(f"multipath_{name}" for name in sorted(SKY))
    assert set(solution.state_units[first:]) == {"1"}
    np.testing.assert_allclose(solution.cov[0][first:, first:], np.eye(len(SKY)))
    assert (solution.std[-1, first:] < 1).all()
