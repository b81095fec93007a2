"""An archive of synthetic drives through `navreplay batch`: wall time by workers, overhead of a drive, manifest and catalogue
at size.

python benchmarks/archive.py [--drives 24] [--rows 100000]
"""

import argparse
import contextlib
import io
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from pipelines import cli
from pipelines.archive.catalogue import read_catalogue, select_rows, write_catalogue
from pipelines.archive.index_page import write_index
from pipelines.archive.manifest import read_manifest, write_manifest
from synthetic_logs import SCENARIOS, simulate, with_duration, write


def timed(name: str, work: Callable[[], object]) -> float:
    """Seconds that work takes, printed."""
    begin = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        work()
    seconds = time.perf_counter() - begin
    print(f"{name:<44}{seconds:8.1f} s", flush=True)
    return seconds


def main() -> None:
    """Makes the archive, processes it, and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=24)
    parser.add_argument("--rows", type=int, default=100_000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        formats = ("mcap", "bag", "csv")
        for seed in range(arguments.drives):
            log = simulate(with_duration(SCENARIOS["car-city"], 60.0 if seed % 4 else 600.0), seed)
            write(log, folder / "in" / f"day{seed % 5}" / f"drive{seed:03d}.{formats[seed % 3]}")
        for seed in range(0, arguments.drives, 10):
            whole = folder / "in" / f"day{seed % 5}" / f"drive{seed:03d}.{formats[seed % 3]}"
            if whole.exists():
                whole.with_name(f"cut{seed:03d}{whole.suffix}").write_bytes(whole.read_bytes()[:5000])
        print(f"{arguments.drives} drives of 1 and 10 minutes, some cut short")
        seconds = {}
        for workers in (1, 2):
            command = ["batch", str(folder / "in"), "-o", str(folder / f"out{workers}"), "--workers", str(workers), "--quiet"]
            seconds[workers] = timed(f"batch, {workers} worker(s)", lambda command=command: cli.main(command))
        command = ["batch", str(folder / "in"), "-o", str(folder / "out2"), "--resume", "--quiet"]
        timed("the same resumed, nothing to do", lambda: cli.main(command))
        print(f"two workers are {seconds[1] / seconds[2]:.2f} times as fast as one")
        some = next(iter(read_manifest(folder / "out2").values()))
        entries = [replace(some, drive=f"d{number:06d}") for number in range(arguments.rows)]
        print(f"{arguments.rows} rows")
        timed("write manifest", lambda: write_manifest(folder, entries))
        timed("read manifest", lambda: read_manifest(folder))
        timed("write catalogue", lambda: write_catalogue(folder, entries))
        timed("query catalogue", lambda: select_rows(read_catalogue(folder), "duration_s > 1 and drive ~ d0001", None, None))
        timed("write index.html", lambda: write_index(folder, entries))


if __name__ == "__main__":
    main()
