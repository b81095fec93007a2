"""The bundled drive in Tokyo with only few satellites for a while: python benchmarks/few_satellites.py

Five stretches of 30 s, every 55 s from the 130th second on, in which the filter gets the ranges of the n highest satellites.
A line per n: horizontal error within the stretches against fixed RTK, median, 95 % and largest [m], and the mean position
NEES (3 is right). All else as in examples/tsukishima_2020/city.toml; --set changes it, as in `navreplay run`.
"""

import argparse
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from navreplay.measurements.atmosphere import look_angles
from navreplay.timeline import RangeSeries, Timeline
from pipelines.config.spec import Config, load_config
from pipelines.drive.process import Drive, filter_drive, read_drive

FOLDER = Path(__file__).parent.parent / "examples" / "tsukishima_2020"
STRETCHES_S = tuple((start, start + 30.0) for start in np.arange(130.0, 400.0, 55.0))


def keep_highest(ranges: RangeSeries, lla: np.ndarray, count: int, inside: np.ndarray) -> RangeSeries:
    """Of the rows marked inside (n,) only those of each epoch's highest satellites, seen from lla (3,)."""
    elevation, _ = look_angles(np.tile(lla, (len(ranges), 1)), ranges.sat_pos_e)
    order = np.lexsort((-elevation, ranges.t_ns))
    starts = np.flatnonzero(np.diff(ranges.t_ns[order], prepend=-1))
    rank = np.empty(len(ranges), dtype=np.intp)
    rank[order] = np.arange(len(ranges)) - np.repeat(starts, np.diff(np.append(starts, len(ranges))))
    kept = ~inside | (rank < count)
    columns = {
        field.name: getattr(ranges, field.name)[kept]
        for field in fields(ranges)
        if isinstance(getattr(ranges, field.name), np.ndarray) and len(getattr(ranges, field.name)) == len(ranges)
    }
    return replace(ranges, **columns)


def mark(t_ns: np.ndarray, begin_ns: int) -> np.ndarray:
    """Whether times lie within the stretches, counted from begin_ns."""
    t_s = (t_ns - begin_ns) / 1e9
    return np.any([(t_s > start) & (t_s <= end) for start, end in STRETCHES_S], axis=0)


def measure(timeline: Timeline, config: Config, count: int) -> str:
    ranges = timeline.ranges
    assert ranges is not None
    assert timeline.reference is not None
    begin_ns = int(ranges.t_ns[0])
    few = keep_highest(ranges, timeline.reference.lla[0], count, mark(ranges.t_ns, begin_ns))
    evaluation = filter_drive(Drive(replace(timeline, ranges=few), ()), config).evaluation
    assert evaluation is not None
    inside = mark(evaluation.t_ns, begin_ns)
    position = evaluation.errors["position"]
    error = np.hypot(*position.error[inside, :2].T)
    figures = " ".join(f"{value:7.2f}" for value in (*np.percentile(error, [50, 95]), error.max()))
    return f"{figures}   {np.nanmean(position.nees[inside]):7.1f}   {inside.sum()} epochs"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="sets")
    config = load_config(FOLDER / "city.toml", parser.parse_args().sets)
    timeline = read_drive([FOLDER / "tsukishima_2020.mcap"], config).timeline
    print("satellites  median    95 % largest      NEES")
    for count in (99, 3, 2, 1, 0):
        print(f"{'all' if count == 99 else count:>10} {measure(timeline, config, count)}", flush=True)


if __name__ == "__main__":
    main()
