"""Which missions a campaign consists of, and on which processes they run."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass

from controller.campaign.judge import Row
from controller.campaign.task import Task, run_task
from controller.errors import UserError
from controller.workers import worker_processes

# Tasks submitted per worker, enough to keep every worker busy. The rest waits here and can still be dropped.
_TASKS_PER_WORKER = 4


@dataclass(frozen=True, slots=True)
class Mission:
    """One mission of a campaign, defined by its family and seed."""

    family: str
    seed: int


def missions(count: int, families: tuple[str, ...], seed: int) -> list[Mission]:
    """count missions, alternating between the families; each family counts its seeds up from seed."""
    return [Mission(families[k % len(families)], seed + k // len(families)) for k in range(count)]


def run_local(tasks: list[Task], workers: int) -> Generator[list[Row], None, None]:
    """Run tasks in processes of this machine, or in this process if workers is 1. Rows come as they are
    done."""
    if workers == 1:
        for task in tasks:
            yield run_task(task)
        return
    with worker_processes(workers) as pool:
        yield from _run(pool, tasks, workers, set())


def run_on_cluster(tasks: list[Task], scheduler: str) -> Generator[list[Row], None, None]:
    """Run tasks on a cluster, through the executor of Dask distributed. Raises UserError."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UserError(
            "--scheduler needs Dask distributed, which is not installed: pip install -e '.[campaign]'"
        ) from error
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise UserError(
            f"--scheduler {scheduler}: no scheduler answers ({error}); is `dask scheduler` running?"
        ) from error
    with client:
        workers = max(len(client.scheduler_info()["workers"]), 1)
        running: set[Future[list[Row]]] = set()
        try:
            yield from _run(client.get_executor(pure=False), tasks, workers, running)
        finally:
            for task in running:
                task.cancel()


def _run(
    pool: Executor, tasks: list[Task], workers: int, running: set[Future[list[Row]]]
) -> Iterator[list[Row]]:
    """Run tasks on pool. running: the submitted tasks, kept up to date for the caller."""
    remaining = iter(tasks)
    for _, task in zip(range(workers * _TASKS_PER_WORKER), remaining, strict=False):
        running.add(pool.submit(run_task, task))
    while running:
        done = next(as_completed(running))
        running.remove(done)
        next_task = next(remaining, None)
        if next_task is not None:
            running.add(pool.submit(run_task, next_task))
        yield done.result()
