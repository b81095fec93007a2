"""Speed of a whole run and of the filter alone: python benchmarks/run_speed.py

1. `navreplay run` with report and recording on a one-hour synthetic drive (200 Hz IMU, 1 Hz fixes, zstd MCAP): wall time and
   peak memory of the process.
2. The second start of `navreplay run` on a one-minute log: what a user waits for when the caches are warm.
3. CPU time of the filter per IMU sample, start-up excluded, beside a plain numpy propagation of a dense 15-state covariance at
   the same rate in the same process.
"""

import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.timeline import Timeline
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import SyntheticLog, simulate
from synthetic_logs.writers import write

REPEATS = 5


def simulate_drive(duration_s: float) -> SyntheticLog:
    scenario = SCENARIOS["car-city"]
    return simulate(replace(scenario, journey=replace(scenario.journey, duration=duration_s, imu_rate=200.0)), seed=1)


def write_drive(duration_s: float, path: Path) -> None:
    """In a process of its own: the peak memory of a child counts from the memory its parent has when it starts."""
    process = multiprocessing.get_context("spawn").Process(target=_write_drive, args=(duration_s, path))
    process.start()
    process.join()


def _write_drive(duration_s: float, path: Path) -> None:
    write(simulate_drive(duration_s), path)


def time_command(log: Path, truth: Path, out: Path) -> tuple[float, float]:
    """Wall seconds and peak resident memory [GB] of one `navreplay run`."""
    command = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "run",
        str(log),
        "--reference",
        str(truth),
        "-o",
        str(out),
        "--force",
        "--quiet",
    ]
    start = time.perf_counter()
    process = subprocess.Popen(command)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - start, usage.ru_maxrss / 1e6


def time_filter(log: SyntheticLog) -> float:
    """Median CPU seconds per IMU sample."""
    timeline = Timeline(imu=log.imu, fixes=log.fixes, fix_lever_b=np.array(log.scenario.journey.lever_b))
    method, options = build_method("fixed", {}), FilterOptions(imu_noise=log.scenario.imu.noise)
    run_filter(timeline, method, options)
    seconds = []
    for _ in range(REPEATS):
        start = time.process_time()
        run_filter(timeline, method, options)
        seconds.append(time.process_time() - start)
    return statistics.median(seconds) / len(log.imu)


def time_dense_propagation(samples: int = 20_000) -> float:
    """Median CPU seconds per step of P = Phi P Phi' + Q with dense 15 x 15 numpy matrices."""
    transition = np.eye(15) + 1e-3 * np.random.default_rng(0).standard_normal((15, 15))
    transition /= np.abs(np.linalg.eigvals(transition)).max()
    noise, cov = 1e-6 * np.eye(15), np.eye(15)
    seconds = []
    for _ in range(REPEATS):
        start = time.process_time()
        for _ in range(samples):
            cov = transition @ cov @ transition.T + noise
        seconds.append(time.process_time() - start)
    return statistics.median(seconds) / samples


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for label, duration_s, repeats in (("hour", 3600.0, 1), ("minute", 60.0, REPEATS)):
            log, truth = folder / f"{label}.mcap", folder / f"{label}.truth.csv"
            write_drive(duration_s, log)
            if label == "minute":
                time_command(log, truth, folder / label)
            runs = [time_command(log, truth, folder / label) for _ in range(repeats)]
            wall, memory = (statistics.median(column) for column in zip(*runs, strict=True))
            print(f"navreplay run, one {label} at 200 Hz: {wall:.1f} s wall, {memory:.2f} GB (median of {repeats})")
    per_sample, dense = time_filter(simulate_drive(600.0)), time_dense_propagation()
    print(f"filter, 15 states, 200 Hz, 1 Hz fixes: {per_sample * 1e6:.2f} us CPU per IMU sample (median of {REPEATS})")
    print(f"dense numpy covariance step alone: {dense * 1e6:.2f} us; ratio {dense / per_sample:.1f}")


if __name__ == "__main__":
    main()
