"""Who runs jobs: this process, a pool of processes, or a Dask cluster; all by futures, and a job's loss is its own."""

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol

from navreplay.timeline import LogError

__all__ = ["DaskCluster", "Executor", "Finished", "InProcess", "ProcessPool", "choose_executor"]

Work = Callable[[Any], Any]
Started = Callable[[Any], None]
Finished = tuple[Any, Any, str]
"""A job, what it gave (None where it was lost), and why it was lost (empty where it was not)."""
_LOST = "its worker died twice (killed, or out of memory)"
_ANSWER_S, _PATIENCE_S = 15, 30


class Executor(Protocol):
    """Runs jobs and gives them back as they finish, in any order."""

    def run(
        self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float, started: Started
    ) -> Iterator[Finished]:
        """work of each job, told to started as it begins. weights (bytes) of jobs that run at a time stay below budget, but one
        always runs. Raises the LogError of a job, which is not for one job alone."""
        ...


class InProcess:
    """One after the other, here."""

    def run(
        self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float, started: Started
    ) -> Iterator[Finished]:
        """See `Executor`."""
        for job in jobs:
            started(job)
            yield job, work(job), ""


class _Window:
    """Jobs that run, as many as there are slots and as their weights allow; those that would not fit wait for others to end."""

    def __init__(self, jobs: Sequence[Any], weights: Sequence[float], budget: float, started: Started) -> None:
        self.waiting = deque(zip(jobs, weights, strict=True))
        self.running: dict[Any, tuple[Any, float]] = {}
        self._budget, self._started = budget, started

    def fill(self, slots: int, submit: Callable[[Any], Any]) -> None:
        """Submits what fits."""
        while self.waiting and len(self.running) < slots:
            used = sum(weight for _, weight in self.running.values())
            if self.running and used + self.waiting[0][1] > self._budget:
                return
            job, weight = self.waiting.popleft()
            self._started(job)
            self.running[submit(job)] = job, weight


class ProcessPool:
    """A pool of worker processes that stay warm. A worker that dies breaks its pool: the jobs that were running are tried
    again, each alone, and one that loses its worker again is given up."""

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def run(
        self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float, started: Started
    ) -> Iterator[Finished]:
        """See `Executor`."""
        window = _Window(jobs, weights, budget, started)
        while window.waiting:
            try:
                yield from self._pool(work, window, budget)
            except BrokenProcessPool:
                for job, _ in window.running.values():
                    yield self._alone(work, job, budget)
            window.running.clear()

    def _pool(self, work: Work, window: _Window, budget: float) -> Iterator[Finished]:
        with _processes(self._workers, budget) as pool:
            while window.waiting or window.running:
                window.fill(self._workers, lambda job: pool.submit(work, job))
                done, _ = wait(window.running, return_when=FIRST_COMPLETED)
                for future in done:
                    result = future.result()
                    job, _ = window.running.pop(future)
                    yield job, result, ""

    @staticmethod
    def _alone(work: Work, job: Any, budget: float) -> Finished:
        try:
            with _processes(1, budget) as pool:
                return job, pool.submit(work, job).result(), ""
        except BrokenProcessPool:
            return job, None, _LOST


def _processes(workers: int, budget: float) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_bound_memory, initargs=(budget,))


def _bound_memory(budget: float) -> None:
    """No worker takes more than all of them may: what goes wrong is then a MemoryError of one drive, not the machine's."""
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = int(budget) if hard == resource.RLIM_INFINITY else min(int(budget), hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


class DaskCluster:
    """A running Dask scheduler, or a local cluster of so many workers of one thread. Raises LogError where it cannot be had."""

    def __init__(self, address: str | None, workers: int) -> None:
        try:
            import dask
            from distributed import Client, LocalCluster
        except ImportError as error:
            raise LogError("a Dask cluster needs the extra [cluster]: pip install 'navreplay[cluster]'") from error
        self._cluster = None
        if address == "local":
            with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
                self._cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, processes=True)
        try:
            self._client = Client(self._cluster or address, timeout=_ANSWER_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise LogError(
                f"--scheduler {address}: no scheduler answers there ({type(error).__name__}); is it running?"
            ) from error
        self._address = address

    def run(
        self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float, started: Started
    ) -> Iterator[Finished]:
        """See `Executor`; the budget is the memory of the cluster's workers where they tell it."""
        try:
            self._await_workers()
            window = _Window(jobs, weights, self._memory() or budget, started)
            doubted = []
            for job, future in self._run(work, window):
                if _is_lost(future):
                    doubted.append(job)
                else:
                    yield job, future.result(), ""
            for job in doubted:  # alone, since a worker that dies takes with it what waits there
                for _, future in self._run(work, _Window([job], [0.0], budget, lambda job: None)):
                    yield (job, None, _LOST) if _is_lost(future) else (job, future.result(), "")
        finally:
            self._client.close()
            if self._cluster is not None:
                self._cluster.close()

    def _run(self, work: Work, window: _Window) -> Iterator[tuple[Any, Any]]:
        """Jobs with their futures, as these end."""
        from distributed import wait as wait_for

        while window.waiting or window.running:
            window.fill(max(sum(self._client.ncores().values()), 1), lambda job: self._client.submit(work, job, pure=False))
            for future in wait_for(list(window.running), return_when="FIRST_COMPLETED").done:
                yield window.running.pop(future)[0], future

    def _await_workers(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE_S)
        except TimeoutError as error:
            raise LogError(
                f"--scheduler {self._address}: has no workers; start some (dask worker ADDRESS --nthreads 1)"
            ) from error

    def _memory(self) -> float:
        """Of all workers together [bytes], 0 where one does not tell."""
        limits = [worker.get("memory_limit") or 0 for worker in self._client.scheduler_info(n_workers=-1)["workers"].values()]
        return float(sum(limits)) if limits and all(limits) else 0.0


def _is_lost(future: Any) -> bool:
    return future.status != "finished" and type(future.exception()).__name__ == "KilledWorker"


def choose_executor(scheduler: str | None, workers: int) -> Executor:
    """By the command line. Raises LogError where a cluster cannot be had."""
    if scheduler is not None:
        return DaskCluster(scheduler, workers)
    return InProcess() if workers == 1 else ProcessPool(workers)
