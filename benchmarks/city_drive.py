"""Methods on the bundled drive in Tokyo: python benchmarks/city_drive.py

A line per method and setting: errors of position against fixed RTK, horizontal and 3-D, median / 95 % / largest [m]; NEES of
position, mean / median (3 and 2.4 are right); and the largest errors without the epochs in which RTK is more than 5 m off the
receiver's own position. First the least-squares positions of single epochs.
"""

from pathlib import Path

import numpy as np

from navreplay.geodesy import earth
from navreplay.measurements.least_squares import fixes_of, solve_points
from navreplay.options import RangeOptions
from navreplay.timeline import Floats, LogError, Timeline, Times
from pipelines.config.spec import load_config
from pipelines.drive.process import filter_drive, read_drive

FOLDER = Path(__file__).parent.parent / "examples" / "tsukishima_2020"
PLAIN = ("vehicle.zero_velocity=false", "consider.every_method=false")
SETTINGS = (
    ("fixed, all defaults", PLAIN),
    ("fixed, zero velocity", PLAIN[1:]),
    ("fixed, zero velocity, smoothed", (*PLAIN[1:], "filter.smooth=true")),
    ("city.toml, fixed", ()),
    ("city.toml, fixed, multipath_share 0.9", ("range.multipath_share=0.9",)),
)
METHODS = ("student-t", "auto", "huber", "vb", "iae", "eiakf", "srmakf", "ermakf", "ermakf-derived", "ermakf-whitened")
WRONG_FIX = 5.0


def doubtful(timeline: Timeline, t_ns: Times) -> np.ndarray:
    """Of epochs of the reference (k,), those in which it is far off the receiver's own position."""
    fixes, reference = timeline.fixes, timeline.reference
    assert fixes is not None
    assert reference is not None
    own = fixes.lla[np.minimum(np.searchsorted(fixes.t_ns, t_ns), len(fixes) - 1)]
    told = reference.lla[np.searchsorted(reference.t_ns, t_ns)]
    return np.linalg.norm(earth.ned_between(told, own), axis=1) > WRONG_FIX


def describe(error: Floats) -> str:
    """Error (k, 3) NED."""
    lengths = np.hypot(error[:, 0], error[:, 1]), np.linalg.norm(error, axis=1)
    return " | ".join("{:.2f} / {:.2f} / {:.2f}".format(*np.percentile(each, [50, 95]), each.max()) for each in lengths)


def least_squares_errors(timeline: Timeline) -> Floats:
    """(k, 3) NED [m] at the epochs of the reference."""
    ranges, reference = timeline.ranges, timeline.reference
    assert ranges is not None
    assert reference is not None
    points, _, _ = solve_points(ranges, RangeOptions())
    fixes = fixes_of(points)
    rows = np.clip(np.searchsorted(reference.t_ns, fixes.t_ns - 50_000_000), 0, len(reference) - 1)
    known = np.abs(reference.t_ns[rows] - fixes.t_ns) < 50_000_000
    return earth.ned_between(reference.lla[rows[known]], fixes.lla[known])


def main() -> None:
    base = load_config(FOLDER / "city.toml")
    drive = read_drive([FOLDER / "tsukishima_2020.mcap"], base)
    print("| | horizontal | 3-D | NEES | largest elsewhere |\n|---|---|---|---|---|")
    print(f"| least squares, epoch by epoch | {describe(least_squares_errors(drive.timeline))} | | |", flush=True)
    more = tuple((f"city.toml, {name}", (f"filter.name={name}",)) for name in METHODS)
    for label, sets in (*SETTINGS, *more):
        try:
            evaluation = filter_drive(drive, load_config(FOLDER / "city.toml", sets)).evaluation
        except LogError as error:
            print(f"| {label} | {error} |", flush=True)
            continue
        assert evaluation is not None
        position = evaluation.errors["position"]
        good = position.error[~doubtful(drive.timeline, evaluation.t_ns)]
        largest = np.hypot(good[:, 0], good[:, 1]).max(), np.linalg.norm(good, axis=1).max()
        nees = np.nanmean(position.nees), np.nanmedian(position.nees)
        print(
            f"| {label} | {describe(position.error)} | {nees[0]:.1f} / {nees[1]:.1f} | {largest[0]:.2f}, {largest[1]:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
