"""Who runs jobs: what is lost is told, what would not fit waits, a real scheduler with real workers does the same."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from navreplay.timeline import LogError
from pipelines import cli
from pipelines.archive.executors import DaskCluster, Executor, InProcess, ProcessPool
from pipelines.archive.job import DestinationFullError
from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.paths import ROOT

AMPLE = 4e9


def double(job: str) -> str:
    if job == "deadly" or (job.startswith("/") and not Path(job).exists()):
        if job != "deadly":
            Path(job).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return job * 2


def span(job: str) -> tuple[float, float]:
    begin = time.monotonic()
    time.sleep(0.3)
    return begin, time.monotonic()


def fill(job: str) -> None:
    raise DestinationFullError("the disk is full")


def run(executor: Executor, jobs: list[str]) -> dict[str, tuple[str | None, str]]:
    started: list[str] = []
    ended = {job: (result, lost) for job, result, lost in executor.run(double, jobs, [1.0] * len(jobs), AMPLE, started.append)}
    assert sorted(started) == sorted(jobs)
    return ended


def test_a_worker_of_a_pool_that_dies_costs_its_own_job_a_retry_and_then_that_job(tmp_path: Path) -> None:
    once = str(tmp_path / "once")
    ended = run(ProcessPool(2), ["a", "deadly", "b", once, "c"])
    assert ended.pop("deadly") == (None, "its worker died twice (killed, or out of memory)")
    assert ended == {job: (job * 2, "") for job in ("a", "b", "c", once)}


def test_what_would_not_fit_beside_another_waits() -> None:
    jobs, weights = ["big", "small", "large"], [3e9, 0.5e9, 3.9e9]
    spans = {job: times for job, times, _ in ProcessPool(3).run(span, jobs, weights, AMPLE, lambda job: None)}
    assert spans["small"][0] < spans["big"][1], "these two fit"
    assert spans["large"][0] >= max(spans["big"][1], spans["small"][1]) - 1e-3


@pytest.mark.parametrize("executor", [InProcess(), ProcessPool(1)], ids=["in process", "pool"])
def test_a_full_destination_ends_all(executor: Executor) -> None:
    with pytest.raises(LogError, match="the disk is full"):
        list(executor.run(fill, ["a", "b"], [1.0, 1.0], AMPLE, lambda job: None))


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a Dask scheduler with two workers, each a process of its own on loopback."""
    pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("dask")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    address_file = folder / "scheduler.json"
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    commands = [["scheduler", *own, "--port", "0", "--scheduler-file", str(address_file)]]
    worker = ["worker", "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(address_file), "--nthreads", "1"]
    commands += [[*worker, "--local-directory", str(folder)]] * 2
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT, "env": environment}
    processes = []
    try:
        for command in commands:
            processes.append(subprocess.Popen([sys.executable, "-m", "dask", *command], start_new_session=True, **quiet))
            ends = time.monotonic() + 30
            while not (address_file.exists() and address_file.stat().st_size) and time.monotonic() < ends:
                time.sleep(0.05)
        yield json.loads(address_file.read_text())["address"]
    finally:
        for process in processes:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def test_a_real_scheduler_survives_the_death_of_workers(scheduler: str, tmp_path: Path) -> None:
    once = str(tmp_path / "once")
    ended = run(DaskCluster(scheduler, 0), ["a", "deadly", once, "b"])
    assert ended.pop("deadly") == (None, "its worker died twice (killed, or out of memory)")
    assert ended == {job: (job * 2, "") for job in ("a", "b", once)}


def test_a_batch_on_a_real_scheduler_is_the_same_as_here(scheduler: str, tmp_path: Path) -> None:
    for seed in (1, 2):
        write(simulate(with_duration(SCENARIOS["car-short"], 20.0), seed), tmp_path / "in" / f"d{seed}" / "drive.bag")
    (tmp_path / "in" / "d1" / "cut.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    options = ["--quiet", "--set", "output.recording=false"]
    assert cli.main(["batch", str(tmp_path / "in"), "-o", str(tmp_path / "here"), "--workers", "1", *options]) == 2
    assert cli.main(["batch", str(tmp_path / "in"), "-o", str(tmp_path / "there"), "--scheduler", scheduler, *options]) == 2
    trees = [
        {
            str(path.relative_to(out)): path.read_bytes()
            for path in sorted(out.rglob("*"))
            if path.is_file() and "log" not in path.parts
        }
        for out in (tmp_path / "here", tmp_path / "there")
    ]
    assert trees[0] == trees[1]


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("pipelines.archive.executors._ANSWER_S", 1)
    with pytest.raises(LogError, match="no scheduler answers there"):
        DaskCluster("tcp://127.0.0.1:1", 0)
