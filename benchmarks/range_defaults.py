"""How ranges are weighed by default, on stretches of drives.

    python benchmarks/range_defaults.py [--drive CONFIG LOG...] [--seeds 4]

The bundled drive in Tokyo, synthetic cities whose receiver tells no noise, and any drive with a reference named by --drive,
each cut into stretches of one to five minutes. A figure is that of a stretch over that of a plain filter (3 m and 0.1 m/s for
all satellites, a gate), the geometric mean over the stretches of a drive: horizontal median / 95 % / largest error, then 3-D
median / 95 %; below 1 is better. Biases are considered throughout, so that the filters differ in the weights alone.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.options import ConsiderOptions, FilterOptions
from navreplay.timeline import Floats, Timeline
from pipelines.config.spec import filter_options, load_config
from pipelines.drive.process import read_drive
from synthetic_logs import SCENARIOS, simulate, with_duration

TOKYO = Path(__file__).parents[1] / "examples" / "tsukishima_2020"
PLAIN = (3.0, 0.1)


@dataclass(frozen=True, eq=False, slots=True)
class Case:
    """A drive, from start_s on in so many stretches."""

    name: str
    timeline: Timeline
    options: FilterOptions
    start_s: float
    stretches: int


def cases(drives: list[list[str]], seeds: int) -> Iterator[Case]:
    """The drives, in order."""
    config = load_config(TOKYO / "city.toml")
    drive = read_drive([TOKYO / "tsukishima_2020.mcap"], config)
    yield Case("Tokyo", drive.timeline, filter_options(config), 110.0, 4)
    for path, *logs in drives:
        config = load_config(Path(path))
        timeline = read_drive(logs, config).timeline
        yield Case(Path(path).stem, timeline, filter_options(config), 0.0, 5)
    for seed in range(1, seeds + 1):
        log = simulate(with_duration(SCENARIOS["ermakf-city"], 600.0), seed)
        yield Case(
            f"city, seed {seed}", tell(log.timeline(), np.nan, np.nan), FilterOptions(imu_noise=log.scenario.imu.noise), 30.0, 4
        )


def tell(timeline: Timeline, pseudorange: float, rate: float) -> Timeline:
    """The timeline whose receiver tells these standard deviations [m, m/s] of all satellites."""
    ranges = timeline.ranges
    assert ranges is not None
    count = len(ranges)
    told = replace(ranges, pseudorange_std=np.full(count, pseudorange), range_rate_std=np.full(count, rate))
    return replace(timeline, ranges=told)


def score(case: Case, method: str, plain: bool = False) -> Floats:
    """(stretches, 5) errors [m]."""
    timeline = tell(case.timeline, *PLAIN) if plain else case.timeline
    considered = ConsiderOptions(every_method=True)
    solution = run_filter(timeline, build_method(method), replace(case.options, consider=considered, output_rate=0.0))
    assert timeline.reference is not None
    assert timeline.ranges is not None
    lever = timeline.reference_lever_b - (0.0 if timeline.imu is not None else timeline.fix_lever_b)
    judged = evaluate(solution, timeline.reference, np.asarray(lever))
    error, seconds = judged.errors["position"].error, (judged.t_ns - timeline.ranges.t_ns[0]) / 1e9
    edges = np.linspace(case.start_s, seconds[-1] + 1e-6, case.stretches + 1)
    return np.array([_figures(error[(seconds >= a) & (seconds < b)]) for a, b in pairwise(edges)])


def _figures(error: Floats) -> list[float]:
    across, total = np.hypot(error[:, 0], error[:, 1]), np.linalg.norm(error, axis=1)
    return [*np.percentile(across, [50, 95]).tolist(), float(across.max()), *np.percentile(total, [50, 95]).tolist()]


def main() -> None:
    """A line per drive, a column per method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--drive", action="append", nargs="+", default=[], metavar=("CONFIG", "LOG"))
    parser.add_argument("--methods", nargs="+", default=["fixed", "student-t"])
    arguments = parser.parse_args()
    print("| | " + " | ".join(arguments.methods) + " |\n" + "|---" * (1 + len(arguments.methods)) + "|")
    for case in cases(arguments.drive, arguments.seeds):
        plain = score(case, "fixed", plain=True)
        ratios = [np.exp(np.log(score(case, method) / plain).mean(axis=0)) for method in arguments.methods]
        cells = ["{:.2f} / {:.2f} / {:.2f}, {:.2f} / {:.2f}".format(*ratio) for ratio in ratios]
        print(f"| {case.name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
