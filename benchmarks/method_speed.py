"""Cost of the methods beside the fixed filter: python benchmarks/method_speed.py

Loosely coupled: 15 states (16 with cubature), 200 Hz IMU, fixes with velocity at 1 Hz, windows of 50. Tightly coupled: 20
states, 200 Hz IMU, pseudoranges and rates of about ten satellites at 1 Hz. CPU time of the filter, start-up excluded: the
difference between a long and a short log, median of repeats; methods take turns, so that a machine that slows down slows
them all.
"""

import statistics
import time
from collections.abc import Sequence
from dataclasses import replace

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import AlignmentOptions, FilterOptions
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import Scenario, SyntheticLog, simulate, with_duration

REPEATS = 5
SHORT_S, LONG_S = 60.0, 300.0
LOOSE = ("fixed", "iae", "sage-husa", "huber", "student-t", "vb", "ml", "ckf", "mlckf")
TIGHT = ("fixed", "eiakf", "srmakf", "ermakf", "ermakf-derived")


def loose_scenario() -> Scenario:
    """A drive with fixes."""
    scenario = SCENARIOS["car-city"]
    return replace(scenario, journey=replace(scenario.journey, imu_rate=200.0))


def tight_scenario() -> Scenario:
    """A drive with the ranges of one constellation under open sky, and the paper's 20 states."""
    scenario = SCENARIOS["ranges-open"]
    noise = replace(scenario.imu.noise, gyro_markov_std=1e-6)
    return replace(
        scenario,
        journey=replace(scenario.journey, imu_rate=200.0),
        imu=replace(scenario.imu, noise=noise),
        receiver=None if scenario.receiver is None else replace(scenario.receiver, systems=("G",)),
    )


def filter_seconds(log: SyntheticLog, method: str) -> float:
    """CPU seconds of one run."""
    options = FilterOptions(imu_noise=log.scenario.imu.noise, alignment=AlignmentOptions("reference"))
    start = time.process_time()
    run_filter(log.timeline(), build_method(method), options)
    return time.process_time() - start


def compare(title: str, scenario: Scenario, methods: Sequence[str]) -> None:
    """Prints a line per method."""
    short, long = (simulate(with_duration(scenario, duration), seed=1) for duration in (SHORT_S, LONG_S))
    seconds: dict[str, list[float]] = {method: [] for method in methods}
    for repeat in range(REPEATS + 1):
        for method in methods:
            spent = filter_seconds(long, method) - filter_seconds(short, method)
            if repeat > 0:  # the first compiles and fills caches
                seconds[method].append(spent)
    samples = (LONG_S - SHORT_S) * scenario.journey.imu_rate
    epochs = (LONG_S - SHORT_S) * scenario.journey.gnss_rate
    fixed = statistics.median(seconds["fixed"])
    print(title)
    for method, spent in seconds.items():
        median = statistics.median(spent)
        per_epoch = (median - fixed) / epochs * 1e3
        print(
            f"  {method:16} {median / samples * 1e6:6.2f} us per IMU sample, {median / fixed:5.2f} times fixed, "
            f"{per_epoch:+6.3f} ms per epoch"
        )


def main() -> None:
    compare("loosely coupled, 15 states, 200 Hz and 1 Hz", loose_scenario(), LOOSE)
    compare("tightly coupled, 20 states, 200 Hz and 1 Hz", tight_scenario(), TIGHT)


if __name__ == "__main__":
    main()
