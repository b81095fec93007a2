"""CPU time of a bank of five over that of the single filter: python benchmarks/bank_cost.py

At 200 Hz IMU with 1 Hz fixes, and at 100 Hz with 20 Hz, both in turns in one process with linear algebra on one thread; the
least of several runs, which other work on the machine disturbs least.
"""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import time
from dataclasses import replace

from navreplay.filters.presets import Method, build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.timeline import Timeline
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import simulate

REPEATS = 15
DURATION_S = 120.0


def time_run(timeline: Timeline, method: Method, options: FilterOptions) -> float:
    """CPU seconds of one run."""
    start = time.process_time()
    run_filter(timeline, method, options)
    return time.process_time() - start


def main() -> None:
    scenario = SCENARIOS["car-city"]
    options = FilterOptions(imu_noise=scenario.imu.noise)
    methods = {name: build_method(name) for name in ("fixed", "immae")}
    for imu_rate, gnss_rate in ((200.0, 1.0), (100.0, 20.0)):
        journey = replace(scenario.journey, duration=DURATION_S, imu_rate=imu_rate, gnss_rate=gnss_rate)
        timeline = simulate(replace(scenario, journey=journey), seed=1).timeline()
        times: dict[str, list[float]] = {name: [] for name in methods}
        for _ in range(REPEATS + 1):
            for name, method in methods.items():
                times[name].append(time_run(timeline, method, options))
        single, bank = (min(times[name][1:]) / DURATION_S * 1e6 for name in methods)
        rates = f"{imu_rate:g} Hz IMU, {gnss_rate:g} Hz fixes"
        print(
            f"{rates}: single {single:.0f}, bank of five {bank:.0f} us CPU per second of log; "
            f"ratio {bank / single:.2f} (least of {REPEATS})"
        )


if __name__ == "__main__":
    main()
