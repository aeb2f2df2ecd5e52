"""The whole simulated set before all methods, on as many processes as wished."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import cv2

from controller.errors import UserError
from controller.evaluation.contestants import ALWAYS, BASELINES
from controller.evaluation.run_sequence import SequenceRecord, run_sequence
from controller.evaluation.sequences import Sequence

Baselines = Literal["none", "some", "all"]

# The slow baselines look at these by default: every kind of drive, both noises, movers and none.
BASELINE_SEQUENCES = frozenset(
    {
        "still-group",
        "slow-crossing",
        "walk-oncoming",
        "fast-two",
        "accelerating-crossing",
        "arc-tight-crossing",
        "vibration-robot",
        "static-straight",
        "static-s-curve",
    }
)
SHOWN_FRAMES: dict[str, tuple[int, ...]] = {
    "walk-oncoming": (45,),
    "slow-crossing": (60,),
    "arc-tight-robot": (55,),
}


@dataclass(frozen=True, slots=True)
class Task:
    """One sequence and the methods that look at it."""

    sequence: Sequence
    methods: tuple[str, ...]


def plan(sequences: tuple[Sequence, ...], baselines: Baselines) -> tuple[Task, ...]:
    """baselines: "some" looks at BASELINE_SEQUENCES alone. The longest tasks first."""
    tasks = [
        Task(one, ALWAYS + (BASELINES if _with_baselines(one.name, baselines) else ())) for one in sequences
    ]
    return tuple(sorted(tasks, key=lambda task: -len(task.methods)))


def _with_baselines(name: str, baselines: Baselines) -> bool:
    return baselines == "all" or (baselines == "some" and name in BASELINE_SEQUENCES)


def run_campaign(
    tasks: tuple[Task, ...], workers: int, on_done: Callable[[SequenceRecord], None]
) -> tuple[SequenceRecord, ...]:
    """Records by name of the sequence; on_done as each is finished. Equal for any number of workers,
    but for the times."""
    records = []
    for record in _records(tasks, workers):
        on_done(record)
        records.append(record)
    return tuple(sorted(records, key=lambda record: record.name))


def _records(tasks: tuple[Task, ...], workers: int) -> Iterator[SequenceRecord]:
    with _one_core_each(), ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(run_task, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            raise UserError(
                "a worker process died, most likely for want of memory; try again with --workers 1"
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _one_core_each() -> Iterator[None]:
    """NumPy's linear algebra reads these when it is imported, which a spawned worker has yet to do."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def run_task(task: Task) -> SequenceRecord:
    """What one worker does: everything on one core."""
    cv2.setNumThreads(1)
    shown = SHOWN_FRAMES.get(task.sequence.name, ())
    return run_sequence(task.sequence, task.methods, shown, time.perf_counter_ns)
