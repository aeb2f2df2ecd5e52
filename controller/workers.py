"""Worker processes: one core each, and shielded from the signals that a terminal sends to all processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import FrameType
from typing import NoReturn, ParamSpec, TypeVar

from controller.errors import UserError

_ONE_CORE = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

Given = ParamSpec("Given")
Result = TypeVar("Result")


@contextmanager
def held(*numbers: signal.Signals) -> Iterator[None]:
    """Processes started in the block never receive these signals, not even while they import.

    This process receives them after the block. A terminal sends SIGINT, and SIGHUP when it closes, to all
    processes, but only the one that the user started knows how to react.
    """
    # The resource tracker would else start with the first process, and unblock SIGINT for that process.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def worker_processes(count: int) -> Iterator[Executor]:
    """A pool of count processes for picklable tasks; an error in the block ends them at once.

    SIGTERM leaves the block, too, since without their parent they would wait for tasks for ever. Raises
    UserError if one of them dies by itself.
    """
    with _one_core_each(), _sigterm_as_exit():
        pool = _Pool(count, multiprocessing.get_context("spawn"))
        try:
            yield pool
        except BrokenProcessPool as error:
            raise UserError(
                "a worker process died, most likely for want of memory; try again with --workers 1"
            ) from error
        except BaseException:
            for child in multiprocessing.active_children():
                child.terminate()
            raise
        finally:
            pool.shutdown()


class _Pool(ProcessPoolExecutor):
    """A pool that starts a process whenever a task finds none idle."""

    def submit(
        self, task: Callable[Given, Result], /, *args: Given.args, **kwargs: Given.kwargs
    ) -> Future[Result]:
        with held(signal.SIGINT):
            return super().submit(task, *args, **kwargs)


@contextmanager
def _sigterm_as_exit() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, _exit)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _exit(number: int, _frame: FrameType | None) -> NoReturn:
    # The exit code that shells report for a program that a signal has ended.
    sys.exit(128 + number)


@contextmanager
def _one_core_each() -> Iterator[None]:
    """Set the thread counts of NumPy's linear algebra, which a spawned worker reads when it imports NumPy."""
    before = {name: os.environ.get(name) for name in _ONE_CORE}
    os.environ.update(dict.fromkeys(_ONE_CORE, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
