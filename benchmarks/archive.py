"""An archive of 200 drives of mixed formats, lengths and defects through `navreplay batch`: wall time by who works, what a
killed worker and a killed batch leave, overhead of a drive, manifest and catalogue at size, memory of a long log.

python benchmarks/archive.py [--drives 200] [--scale 0.25] [--rows 100000] [--only archive,overhead,rows,long]
"""

import argparse
import contextlib
import hashlib
import io
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import zstandard

from pipelines import cli
from pipelines.archive.catalogue import read_catalogue, select_rows, write_catalogue
from pipelines.archive.index_page import write_index
from pipelines.archive.job import Job, run_job
from pipelines.archive.manifest import Entry, code_version, config_hash, input_hash, read_manifest, write_manifest
from pipelines.archive.sources.drives import ArchiveDrive
from pipelines.archive.sources.rules import Assigned
from pipelines.archive.sources.seen import Seen, SeenFiles
from pipelines.config.spec import load_config
from pipelines.files.remote import status_of
from synthetic_logs import SCENARIOS, simulate, with_duration, write

ROOT = Path(__file__).parents[1]
REAL = (ROOT / "examples/drive_0708/drive_0708.mcap", ROOT / "examples/tsukishima_2020/tsukishima_2020.mcap")
FORMATS = (".mcap", ".bag", ".csv", ".db3", ".mcap.zst")
NAMES = ("car-city", "car-highway", "car-outages", "car-outliers", "uav-flight")


def timed(name: str, work: Callable[[], object]) -> float:
    """Seconds that work takes, printed with those of CPU, of children too."""
    begin, cpu = time.perf_counter(), _cpu()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        work()
    seconds = time.perf_counter() - begin
    load = os.getloadavg()[0]
    print(f"{name:<52}{seconds:8.1f} s wall{_cpu() - cpu:8.1f} s CPU   load {load:.1f}", flush=True)
    return seconds


def _cpu() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def make_archive(folder: Path, drives: int, scale: float) -> float:
    """Drives of 1 to 60 minutes times scale, one in ten broken, and the real ones; their hours. Each simulation is written in
    five formats."""
    random = np.random.default_rng(1)
    scenarios = [SCENARIOS[name] for name in NAMES]
    hours, log = 0.0, None
    for number in range(drives - len(REAL)):
        if number % len(FORMATS) == 0:
            minutes = float(np.exp(random.uniform(0.0, np.log(60.0)))) * scale
            log = simulate(with_duration(scenarios[number // len(FORMATS) % len(scenarios)], 60.0 * max(minutes, 0.5)), number)
        suffix = FORMATS[number % len(FORMATS)]
        path = folder / f"day{number % 7}" / f"drive-{number:03d}{'' if suffix == '.csv' else 'r'}{suffix}"
        _write(log, path)
        hours += float(log.imu.t_ns[-1] - log.imu.t_ns[0]) / 3600e9
        if number % 10 == 3:
            _break(path, number // 10 % 4)
    for path in REAL:
        (folder / "real").mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / "real" / path.name)
    return hours


def _write(log: object, path: Path) -> None:
    if path.suffix != ".zst":
        write(log, path)
        return
    plain = path.with_suffix("")
    write(log, plain)
    path.write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
    plain.unlink()


def _break(path: Path, way: int) -> None:
    """Cut off, emptied, overwritten in the middle, or text."""
    path = path if path.exists() else path.with_suffix(".imu.csv")
    data = path.read_bytes()
    random = np.random.default_rng(len(data))
    broken = (data[: len(data) // 50], b"", data[:400] + random.bytes(len(data) - 400), b"<html>404 not found</html>\n")
    path.write_bytes(broken[way])


def tree(folder: Path) -> dict[str, str]:
    """Hashes of all files but the log."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.relative_to(folder).parts[0] != "log"
    }


def same_recordings(one: Path, other: Path) -> bool:
    """By Rerun's own comparison."""
    rerun = str(Path(sys.executable).parent / "rerun")
    command = [rerun, "rrd", "compare", "--unordered", str(one), str(other)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@contextlib.contextmanager
def scheduler(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A Dask scheduler on loopback with workers, all processes of their own."""
    address = folder / f"scheduler{workers}.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    own = [sys.executable, "-m", "dask"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    host = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(address)]
    processes = [subprocess.Popen([*own, "scheduler", *host, "--port", "0"], env=environment, **quiet)]
    try:
        while not (address.exists() and address.stat().st_size):
            time.sleep(0.1)
        command = [*own, "worker", *host, "--nthreads", "1", "--local-directory", str(folder)]
        processes += [subprocess.Popen(command, env=environment, **quiet) for _ in range(workers)]
        time.sleep(5.0)
        yield json.loads(address.read_text())["address"], processes
    finally:
        for process in processes:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def measure_archive(folder: Path, drives: int, scale: float, options: list[str]) -> None:
    """Wall time in process, in a pool of two, on Dask with one worker and two; one killed; the whole killed three times."""
    made = folder / "in"
    hours = make_archive(made, drives, scale)
    size = sum(path.stat().st_size for path in made.rglob("*") if path.is_file())
    print(f"{drives} drives, {hours:.1f} h, {size / 1e9:.2f} GB, a tenth broken, lengths 1 to 60 min times {scale:g}")

    def batch(out: str, *more: str) -> None:
        cli.main(["batch", str(made), "-o", str(folder / out), "--quiet", *options, *more])

    alone = timed("in process, 1 worker", lambda: batch("alone", "--workers", "1"))
    pair = timed("pool, 2 workers", lambda: batch("pair", "--workers", "2"))
    timed("resumed, nothing to do", lambda: batch("pair", "--resume"))
    print(f"two workers {alone / pair:.2f} times as fast as one; {60 * hours / alone:.1f} h of drive per minute of one worker")
    with scheduler(folder, 1) as (address, _):
        one = timed("Dask, 1 worker", lambda: batch("dask1", "--scheduler", address))
    with scheduler(folder, 2) as (address, processes):
        two = timed("Dask, 2 workers", lambda: batch("dask2", "--scheduler", address))
        killer = subprocess.Popen(["sh", "-c", f"sleep 8; kill -9 -{processes[1].pid}"])
        timed("Dask, one of 2 workers killed after 8 s", lambda: batch("dask3", "--scheduler", address))
        killer.wait()
    print(f"Dask: two workers {one / two:.2f} times as fast as one")
    _kill_three_times(made, folder / "killed", len(read_manifest(folder / "alone")), pair, options)
    trees = {name: tree(folder / name) for name in ("alone", "pair", "dask1", "dask2", "dask3", "killed")}
    for name, one_tree in trees.items():
        other = {key for key in one_tree | trees["alone"] if one_tree.get(key) != trees["alone"].get(key)}
        recordings = sorted(key for key in other if key.endswith(".rrd"))
        unequal = [key for key in recordings[:20] if not same_recordings(folder / "alone" / key, folder / name / key)]
        print(
            f"    {name}: {len(one_tree)} files; {len(recordings)} recordings of other chunks, {len(unequal)} of 20 unequal; "
            f"{len(other) - len(recordings)} other files differ {sorted(other - {*recordings})[:3]}"
        )
    print(read_catalogue(folder / "alone").groupby("status").size().to_dict())


def _lines(out: Path) -> int:
    path = out / "manifest.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def _kill_three_times(made: Path, out: Path, entries: int, lasts_s: float, options: list[str]) -> None:
    """With a fifth, a half and four fifths of the entries done."""
    command = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "batch",
        str(made),
        "-o",
        str(out),
        "--quiet",
        "--workers",
        "2",
        "--resume",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for part in (0.2, 0.5, 0.8):
        process = subprocess.Popen([*command, *options], start_new_session=True, env=environment)
        begin = time.monotonic()
        while process.poll() is None and time.monotonic() - begin < 4 * lasts_s and _lines(out) < part * entries:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        print(f"    killed with {len(read_manifest(out))} entries", flush=True)
    timed("killed three times, the rest", lambda: cli.main([*command[3:], *options]))


def measure_overhead(folder: Path) -> None:
    """CPU of a minute-long drive in a warm worker, and of a ten-minute one, with and without recording."""
    for minutes in (1, 10):
        path = folder / f"minutes{minutes}.mcap"
        write(simulate(with_duration(SCENARIOS["car-city"], 60.0 * minutes), 1), path)
        for recording in (True, False):
            reference = f"input.reference.file={json.dumps(str(path.with_suffix('.truth.csv')))}"
            config = load_config(None, [reference, f"output.recording={str(recording).lower()}"])
            job = Job(path.stem, (str(path),), (("checked", config),), str(folder / "one"))
            run_job(job)
            spent = []
            for _ in range(5):
                begin = time.process_time()
                (outcome,) = run_job(job)
                spent.append(time.process_time() - begin)
            cpu = float(np.median(spent))
            kind = "with" if recording else "without"
            stages = ", ".join(f"{name} {seconds:.2f}" for name, seconds in outcome.timing_s.items())
            print(
                f"{minutes} min, {kind} recording: {cpu:.2f} s CPU, {minutes / cpu:.1f} h per core-minute (wall: {stages})",
                flush=True,
            )


def measure_rows(folder: Path, rows: int) -> None:
    """Manifest, resume decision, catalogue and index with so many rows, each of figures of its own."""
    log = folder / "few.bag"
    write(simulate(with_duration(SCENARIOS["car-city"], 60.0), 1), log)
    cli.main(["batch", str(log), "-o", str(folder / "few"), "--quiet", "--workers", "1", "--set", "output.recording=false"])
    some = next(iter(read_manifest(folder / "few").values()))
    random = np.random.default_rng(1)
    entries = [_another(some, number, random) for number in range(rows)]
    out = folder / "many"
    timed(f"{rows} rows: write manifest", lambda: write_manifest(out, entries))
    timed("read manifest", lambda: read_manifest(out))
    timed("write catalogue", lambda: write_catalogue(out, entries))
    query = "horizontal_rms_m > 0.8 and drive ~ d0001"
    timed("query catalogue", lambda: select_rows(read_catalogue(out), query, "-horizontal_rms_m", None))
    timed("write index.html", lambda: write_index(out, entries))
    sizes = {path.name: f"{path.stat().st_size / 1e6:.0f} MB" for path in sorted(out.iterdir())}
    print(f"    {sizes}")
    _measure_resume(folder, entries)


def _another(some: Entry, number: int, random: np.random.Generator) -> Entry:
    row = {key: value * random.uniform(0.5, 2) if isinstance(value, float) else value for key, value in some.row.items()}
    return replace(some, drive=f"d{number // 100:04d}/n{number:06d}", row=row)


def _measure_resume(folder: Path, entries: list[Entry]) -> None:
    """The decision of a batch that has nothing to do over as many files: listing, their state, drives, manifest, outputs."""
    made, out, config = folder / "tiny", folder / "tiny-out", load_config(None, [])
    code, books, planned = code_version(), [], []
    for entry in entries:
        path = made / f"{entry.drive}.bag"
        for parent in (path.parent, out / "drives" / entry.drive / entry.method):
            parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        (out / "drives" / entry.drive / entry.method / "report.json").touch()
        digest = hashlib.sha256(entry.drive.encode()).hexdigest()
        books.append(Seen(str(path), *status_of(path), digest, ("fix", "imu"), asked=True))
        stamps = ((str(path), *status_of(path), digest),)
        planned.append(replace(entry, files=stamps, inputs=input_hash(stamps), code=code))
    hashed = config_hash(Assigned(ArchiveDrive("", ()), config), entries[0].method)
    write_manifest(out, [replace(entry, config=hashed) for entry in planned])
    book = SeenFiles(config.input, code)
    book.write(out / "sources.jsonl")
    with (out / "sources.jsonl").open("a", encoding="utf-8") as file:
        file.writelines(f"{json.dumps(asdict(one))}\n" for one in books)
    told = io.StringIO()

    def decide() -> None:
        with contextlib.redirect_stdout(told):
            cli.main(["batch", str(made), "-o", str(out), "--workers", "1", "--resume", "--dry-run"])

    timed("resume decision", decide)
    print(f"    {told.getvalue().splitlines()[-1]}")


def measure_long(folder: Path, hours: float) -> None:
    """Memory and time of a long log at 200 Hz, in a process of its own."""
    made = "from synthetic_logs import SCENARIOS, simulate, with_duration, write; from dataclasses import replace; import sys; "
    made += "s = SCENARIOS['car-city']; s = replace(s, journey=replace(s.journey, imu_rate=200.0)); "
    made += f"write(simulate(with_duration(s, {3600 * hours}), 1), sys.argv[1])"
    path = folder / "long.mcap"
    subprocess.run([sys.executable, "-c", made, str(path)], check=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
    program = (
        "import sys, resource, time; from pipelines import cli; begin = time.perf_counter(); code = cli.main(sys.argv[1:]); "
        "gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6; "
        "print(f'exit code {code}, {time.perf_counter() - begin:.0f} s, {gb:.2f} GB')"
    )
    print(f"{hours:g} h at 200 Hz, {path.stat().st_size / 1e6:.0f} MB", flush=True)
    for recording in ("true", "false"):
        arguments = ["batch", str(path), "-o", str(folder / f"long-{recording}"), "--quiet", "--workers", "1"]
        command = [sys.executable, "-c", program, *arguments, "--set", f"output.recording={recording}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": str(ROOT)})
        print(f"    recording {recording}: {done.stdout.strip()} {done.stderr.strip()}", flush=True)


def main() -> None:
    """Makes what is asked for, measures, prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--scale", type=float, default=0.25, help="of the lengths of drives")
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--hours", type=float, default=10.0, help="of the long log")
    parser.add_argument("--only", default="archive,overhead,rows,long")
    parser.add_argument("--set", action="append", default=[], help="as of batch")
    arguments = parser.parse_args()
    options = [part for one in arguments.set for part in ("--set", one)]
    wanted = arguments.only.split(",")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "overhead" in wanted:
            measure_overhead(folder)
        if "archive" in wanted:
            measure_archive(folder, arguments.drives, arguments.scale, options)
        if "rows" in wanted:
            measure_rows(folder, arguments.rows)
        if "long" in wanted:
            measure_long(folder, arguments.hours)


if __name__ == "__main__":
    main()
