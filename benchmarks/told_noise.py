"""The default method on logs whose noise is told wrong: its error over that of the fixes, and its NEES.

    python benchmarks/told_noise.py [--seconds 300] [--drive CONFIG LOG...]

Four scenarios by seed 1, and the bundled real drive with fixes at 1 Hz (there the fixes are the reference, so its error is told
over that with the noise as told). --drive adds another drive with a reference of its own, without simulated outages.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.earth import ned_between
from navreplay.options import FilterOptions
from navreplay.timeline import Timeline
from pipelines.config.spec import load_config
from pipelines.drive.process import filter_drive, read_drive
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration

FACTORS = (0.05, 0.2, 1.0, 5.0, 20.0)
NAMES = ("car-city", "car-outages", "car-highway", "uav-flight")
_MANY = {"position": "positions", "velocity": "velocities"}
REAL = Path(__file__).parents[1] / "examples" / "drive_0708"


def tell(timeline: Timeline, position: float, velocity: float) -> Timeline:
    """The timeline with standard deviations told by factors."""
    fixes = timeline.fixes
    assert fixes is not None
    return replace(timeline, fixes=replace(fixes, cov_pos=fixes.cov_pos * position**2, cov_vel=fixes.cov_vel * velocity**2))


def row(name: str, figures: list[str]) -> None:
    """A line of the table."""
    print(f"| {name:<34} | " + " | ".join(f"{figure:>14}" for figure in figures) + " |", flush=True)


def main() -> None:
    """Prints the table: ratio of RMS errors outside outages; position NEES per degree of freedom."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--drive", action="append", nargs="+", default=[], metavar=("CONFIG", "LOG"))
    arguments = parser.parse_args()
    row("told by a factor of", [f"{factor:g}" for factor in FACTORS])
    row("---", ["---"] * len(FACTORS))
    for name in NAMES:
        log = simulate(with_duration(SCENARIOS[name], arguments.seconds), 1)
        timeline, fixes = log.timeline(), log.fixes
        assert fixes is not None
        antenna = truth_at(log.scenario.journey, fixes.t_ns)
        errors = ned_between(antenna.lla, fixes.lla)[:, :2]
        # the lever arm is no error of a fix
        own = float(np.sqrt(np.mean(np.sum((errors - np.median(errors, axis=0)) ** 2, axis=1))))
        std = np.array(log.scenario.gnss.position_std[:2]) if log.scenario.gnss else np.zeros(2)
        own = min(own, float(np.linalg.norm(std))) if std.any() else own
        for kind in ("position", "velocity"):
            figures = []
            for factor in FACTORS:
                told = tell(timeline, factor if kind == "position" else 1.0, factor if kind == "velocity" else 1.0)
                options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0)
                judged = evaluate(run_filter(told, build_method("checked"), options), log.truth)
                horizontal = judged.statistics["outside"]["position"]["horizontal"].rms
                figures.append(f"{horizontal / own:.2f}; {judged.nees['position'].mean / 3:.2g}")
            row(f"{name}, {_MANY[kind]}", figures)
    show_drive("drive_0708", REAL / "drive.toml", [REAL / "drive_0708.mcap"], [])
    for config, *logs in arguments.drive:
        show_drive(Path(logs[0]).parent.name, Path(config), [Path(log) for log in logs], ["outages.windows_gps_tow=[]"])


def show_drive(name: str, config: Path, logs: list[Path], settings: list[str]) -> None:
    """Two lines of the table: over the error of the fixes or, where those are the reference, as told."""
    settings = [*settings, "output.recording=false"]
    drive = read_drive(logs, load_config(config, settings))
    for kind in ("position", "velocity"):
        found = []
        for factor in FACTORS:
            result = filter_drive(drive, load_config(config, [f"gnss.{kind}_noise_scale={factor}", *settings]))
            judged = result.evaluation
            assert judged is not None
            own = result.verdict.fix_errors
            horizontal = judged.statistics["outside"]["position"]["horizontal"].rms
            over = own.fixes if own is not None and not own.own else None
            found.append((own.solution if own is not None and over else horizontal, over, judged.nees["position"].mean / 3))
        as_told = found[FACTORS.index(1.0)][0]
        row(f"{name}, {_MANY[kind]}", [f"{error / (over or as_told):.2f}; {nees:.2g}" for error, over, nees in found])


if __name__ == "__main__":
    main()
