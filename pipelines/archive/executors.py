"""Who runs jobs: this process, a pool of processes, or a Dask cluster; all by futures, and a job's loss is its own."""

import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol

from navreplay.timeline import LogError

__all__ = ["DaskCluster", "Executor", "Finished", "InProcess", "ProcessPool", "choose_executor"]

Work = Callable[[Any], Any]
Finished = tuple[Any, Any, str]
"""A job, what it gave (None where it was lost), and why it was lost (empty where it was not)."""
_LOST = "its worker died twice (killed, or out of memory)"


class Executor(Protocol):
    """Runs jobs and gives them back as they finish, in any order."""

    def run(self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float) -> Iterator[Finished]:
        """work of each job. weights (bytes) of jobs that run at a time stay below budget, but one always runs."""
        ...


class InProcess:
    """One after the other, here."""

    def run(self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float) -> Iterator[Finished]:
        """See `Executor`."""
        for job in jobs:
            yield job, work(job), ""


class ProcessPool:
    """A pool of worker processes that stay warm. A worker that dies breaks its pool: the jobs that were running are tried
    again, each alone, and one that loses its worker again is given up."""

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def run(self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float) -> Iterator[Finished]:
        """See `Executor`."""
        waiting = deque(zip(jobs, weights, strict=True))
        doubted: list[Any] = []
        while waiting:
            try:
                yield from self._pool(work, waiting, budget, doubted)
            except BrokenProcessPool:
                for job in doubted:
                    yield self._alone(work, job)
            doubted.clear()

    def _pool(self, work: Work, waiting: deque[tuple[Any, float]], budget: float, running: list[Any]) -> Iterator[Finished]:
        with self._executor(self._workers) as pool:
            futures: dict[Future[Any], tuple[Any, float]] = {}
            while waiting or futures:
                while waiting and len(futures) < self._workers:
                    used = sum(weight for _, weight in futures.values())
                    if futures and used + waiting[0][1] > budget:
                        break
                    job, weight = waiting.popleft()
                    running.append(job)
                    futures[pool.submit(work, job)] = job, weight
                done, _ = wait(futures, return_when=FIRST_COMPLETED)
                for future in done:
                    job, _ = futures[future]
                    result = future.result()
                    del futures[future]
                    running.remove(job)
                    yield job, result, ""

    def _alone(self, work: Work, job: Any) -> Finished:
        try:
            with self._executor(1) as pool:
                return job, pool.submit(work, job).result(), ""
        except BrokenProcessPool:
            return job, None, _LOST

    @staticmethod
    def _executor(workers: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


class DaskCluster:
    """A running Dask scheduler, or a local cluster of so many workers of one thread."""

    def __init__(self, address: str | None, workers: int) -> None:
        try:
            from distributed import Client, LocalCluster
        except ImportError as error:
            raise LogError("a Dask cluster needs the extra [cluster]: pip install 'navreplay[cluster]'") from error
        self._cluster = None
        if address == "local":
            self._cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, processes=True)
        try:
            self._client = Client(self._cluster or address, timeout="15s")
        except (OSError, TimeoutError, ValueError) as error:
            raise LogError(
                f"--scheduler {address}: no scheduler answers there ({type(error).__name__}); is it running?"
            ) from error

    def run(self, work: Work, jobs: Sequence[Any], weights: Sequence[float], budget: float) -> Iterator[Finished]:
        """See `Executor`; the scheduler minds the memory of its workers."""
        from distributed import as_completed

        try:
            futures = {self._client.submit(work, job, pure=False, retries=1): job for job in jobs}
            for future in as_completed(futures):
                job = futures[future]
                if future.status == "finished":
                    yield job, future.result(), ""
                else:
                    yield job, None, f"lost on the cluster: {type(future.exception()).__name__}"
        finally:
            self._client.close()
            if self._cluster is not None:
                self._cluster.close()


def choose_executor(scheduler: str | None, workers: int) -> Executor:
    """By the command line. Raises LogError where a cluster cannot be had."""
    if scheduler is not None:
        return DaskCluster(scheduler, workers)
    return InProcess() if workers == 1 else ProcessPool(workers)
