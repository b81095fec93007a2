"""Errors and consistency of every method on synthetic drives: python benchmarks/method_errors.py --seeds 10

Seeds are the same for every method. A line per method: 3-D RMS errors against the truth, mean over the seeds with half of its
95 % interval, and mean NEES per degree of freedom (1 is right, larger is overconfident). `fixed`: told noise; `oracle`: the
same filter told the true second moments of the noise, epoch by epoch. The gate is the default one.
"""

import argparse
from dataclasses import replace

import numpy as np
from scipy.stats import t

from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import PRESETS, build_method
from navreplay.filters.run import run_filter
from navreplay.options import FilterOptions
from navreplay.timeline import Timeline
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import SyntheticLog, simulate

SCENARIO_NAMES = ("step-noise", "mixture", "car-correlated", "told-noise")
QUANTITIES = {"position": ("m", 1.0), "velocity": ("m/s", 1.0), "attitude": ("deg", 180 / np.pi)}


def tell_true_noise(log: SyntheticLog) -> Timeline:
    """The log with the true second moments of its fixes."""
    timeline = log.timeline()
    errors = log.fix_errors
    return replace(timeline, fixes=replace(timeline.fixes, cov_pos=errors.cov_pos, cov_vel=errors.cov_vel))


def measure(log: SyntheticLog, name: str) -> np.ndarray:
    """(6,) RMS errors of the quantities, then NEES per degree of freedom."""
    timeline = tell_true_noise(log) if name == "oracle" else log.timeline()
    method = build_method("fixed" if name == "oracle" else name)
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=1.0)
    judged = evaluate(run_filter(timeline, method, options), log.truth)
    rms = [np.sqrt((judged.errors[name].error ** 2).sum(axis=1).mean()) * unit for name, (_, unit) in QUANTITIES.items()]
    return np.array([*rms, *(judged.nees[name].mean / judged.nees[name].dof for name in QUANTITIES)])


def print_table(scenario: str, names: list[str], seeds: int) -> None:
    found = np.empty((seeds, len(names), 6))
    for seed in range(seeds):
        log = simulate(SCENARIOS[scenario], seed)
        for i, name in enumerate(names):
            found[seed, i] = measure(log, name)
    half = t.ppf(0.975, max(seeds - 1, 1)) * found.std(axis=0, ddof=min(1, seeds - 1)) / np.sqrt(seeds)
    print(
        f"\n{scenario}, {seeds} seeds\n\n| method | " + " | ".join(f"{name} {unit}" for name, (unit, _) in QUANTITIES.items()),
        end="",
    )
    print(" | NEES position | velocity | attitude |\n|---|---|---|---|---|---|---|")
    for i, name in enumerate(names):
        cells = [f"{value:.3g} ± {width:.2g}" for value, width in zip(found[:, i, :3].mean(axis=0), half[i], strict=False)]
        print("| " + " | ".join([name, *cells, *(f"{value:.2f}" for value in found[:, i, 3:].mean(axis=0))]) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--scenarios", default=",".join(SCENARIO_NAMES))
    parser.add_argument("--filters", default=",".join(name for name in PRESETS if not name.endswith("-ga")))
    arguments = parser.parse_args()
    for scenario in arguments.scenarios.split(","):
        print_table(scenario, ["oracle", *arguments.filters.split(",")], arguments.seeds)


if __name__ == "__main__":
    main()
