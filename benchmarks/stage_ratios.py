"""What each stage costs against the forward pass of `fixed`, in one run: python benchmarks/stage_ratios.py [SECONDS]

A synthetic car (200 Hz IMU, 15 states, 1 Hz fixes with velocity; 600 s unless SECONDS says otherwise). CPU time, medians of
repeats that take turns, so that a machine that slows down slows them all.
- propagate: the forward pass with a fix a minute; update: what the others add.
- rows: forward with rows at 10 and 200 Hz. smooth: smoothed with rows at the fixes, at 10 and at 200 Hz.
- methods: `auto`, the bank, `eckf` (biases considered), scale factors (21 states).
- write: solution.csv and solution.parquet of 720 000 rows.
- start: `navreplay run` on a minute of it, from the second run on; beside it `python -c "import numba"`.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.solution import Solution
from navreplay.timeline import Timeline
from pipelines.config.sections import OutageSection
from pipelines.drive.outages import withhold_fixes
from pipelines.trajectory.solution_csv import write_solution_csv, write_solution_parquet
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import SyntheticLog, simulate, with_duration
from synthetic_logs.writers import write

REPEATS = 3
ROWS = 720_000
Arm = Callable[[], object]


def make_log(duration_s: float) -> SyntheticLog:
    """A car with an IMU at 200 Hz."""
    scenario = SCENARIOS["car-city"]
    return simulate(with_duration(replace(scenario, journey=replace(scenario.journey, imu_rate=200.0)), duration_s), seed=1)


def filter_arms(log: SyntheticLog) -> dict[str, Arm]:
    """By name, runs of the filter on the log; the first is what all others are told against."""
    timeline = Timeline(imu=log.imu, fixes=log.fixes, fix_lever_b=np.array(log.scenario.journey.lever_b))
    plain = FilterOptions(imu_noise=log.scenario.imu.noise)
    scaled = replace(plain, imu_noise=replace(plain.imu_noise, gyro_scale_std=1e-3, accel_scale_std=1e-3))

    def arm(method: str, options: FilterOptions = plain, **changes: object) -> Arm:
        """One run."""
        return lambda: run_filter(timeline, build_method(method), replace(options, **changes))  # type: ignore[arg-type]

    arms = {"fixed, forward": arm("fixed", output_rate=0.0)}
    arms |= {f"rows at {rate:g} Hz": arm("fixed", output_rate=rate) for rate in (10.0, 200.0)}
    arms |= {f"smoothed, rows at {rate:g} Hz": arm("fixed", output_rate=rate, smooth=True) for rate in (0.0, 10.0, 200.0)}
    for name, method, options in (("21 states", "fixed", scaled), ("eckf", "eckf", plain)):
        arms[f"{name}, forward"] = arm(method, options, output_rate=0.0)
        arms[f"{name}, smoothed, rows at 10 Hz"] = arm(method, options, output_rate=10.0, smooth=True)
    return arms | {name: arm(name, output_rate=0.0) for name in ("checked", "auto", "immae")}


def take_turns(arms: dict[str, Arm], repeats: int = REPEATS) -> dict[str, float]:
    """Median CPU seconds of each; the first turn compiles and fills caches, and does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in arms}
    for turn in range(repeats + 1):
        for name, run in arms.items():
            start = time.process_time()
            run()
            if turn > 0:
                seconds[name].append(time.process_time() - start)
    return {name: statistics.median(spent) for name, spent in seconds.items()}


def tell_filters(log: SyntheticLog) -> None:
    """Prints a line per arm."""
    seconds = take_turns(filter_arms(log))
    base = seconds["fixed, forward"]
    sparse = replace(log, fixes=withhold_fixes(log.fixes, OutageSection(fix_interval_s=60.0)))
    alone = take_turns({"propagate": filter_arms(sparse)["fixed, forward"]})["propagate"]
    print(f"propagate {alone / base:.2f}, update {1 - alone / base:.2f} of the forward pass")
    for name, spent in seconds.items():
        print(f"{name:36} {spent / len(log.imu) * 1e6:7.2f} us per IMU sample, {spent / base:6.2f} times")


def stretch(solution: Solution, rows: int) -> Solution:
    """A solution of so many rows, made of that one's over and over."""
    index = np.arange(rows) % len(solution)
    names = ("lla", "vel_n", "q_nb", "gyro_bias", "accel_bias", "cov", "status")
    t_ns = solution.t_ns[0] + 5_000_000 * np.arange(rows)
    return replace(solution, t_ns=t_ns, **{name: getattr(solution, name)[index] for name in names})


def tell_writing(log: SyntheticLog, folder: Path) -> None:
    """Prints the seconds of both formats."""
    solution = filter_arms(log)["fixed, forward"]()
    assert isinstance(solution, Solution)
    long = stretch(solution, ROWS)
    writers: dict[str, Arm] = {
        "solution.csv": lambda: write_solution_csv(folder / "solution.csv", long),
        "solution.parquet": lambda: write_solution_parquet(folder / "solution.parquet", long),
    }
    for name, spent in take_turns(writers).items():
        print(f"{name} of {ROWS} rows: {spent:.2f} s CPU, {spent / ROWS * 1e6:.2f} us per row")


def tell_start(folder: Path) -> None:
    """Prints the wall seconds of a run on a minute."""
    log = folder / "minute.mcap"
    write(make_log(60.0), log)
    commands = {
        "import numba": [sys.executable, "-c", "import numba"],
        "navreplay run, one minute": [sys.executable, "-m", "pipelines.cli", "run", str(log), "-o", str(folder / "out")]
        + ["--force", "--quiet"],
    }
    for name, command in commands.items():
        spent = []
        for turn in range(REPEATS + 1):
            start = time.perf_counter()
            subprocess.run(command, check=True)
            spent += [time.perf_counter() - start] if turn else []
        print(f"{name}: {statistics.median(spent):.2f} s wall")


def main() -> None:
    log = make_log(float(sys.argv[1]) if len(sys.argv) > 1 else 600.0)
    tell_filters(log)
    with tempfile.TemporaryDirectory() as name:
        tell_writing(log, Path(name))
        tell_start(Path(name))


if __name__ == "__main__":
    main()
