"""Runs all methods on the whole simulated set, on a chosen number of processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

import cv2

from controller.evaluation.methods.timed_methods import ALWAYS, BASELINES
from controller.evaluation.run_sequence import SequenceRecord, run_sequence
from controller.evaluation.simulated_set.sequences import Sequence
from controller.workers import worker_processes

Baselines = Literal["none", "some", "all"]

# By default the slow baselines run on these sequences only. They contain every kind of drive, both kinds of
# noise, and scenes with and without movers.
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
# Frames for Fig. 6, by sequence.
SHOWN_FRAMES: dict[str, tuple[int, ...]] = {
    "walk-oncoming": (45,),
    "slow-crossing": (60,),
    "arc-tight-robot": (55,),
}


@dataclass(frozen=True, slots=True)
class Task:
    """One sequence and the methods that run on it."""

    sequence: Sequence
    methods: tuple[str, ...]


def plan(sequences: tuple[Sequence, ...], baselines: Baselines) -> tuple[Task, ...]:
    """One task a sequence, the longest first. baselines: "some" runs them on BASELINE_SEQUENCES only."""
    tasks = [
        Task(sequence, ALWAYS + (BASELINES if _with_baselines(sequence.name, baselines) else ()))
        for sequence in sequences
    ]
    return tuple(sorted(tasks, key=lambda task: -len(task.methods)))


def _with_baselines(name: str, baselines: Baselines) -> bool:
    return baselines == "all" or (baselines == "some" and name in BASELINE_SEQUENCES)


def run_set(
    tasks: tuple[Task, ...], workers: int, on_done: Callable[[SequenceRecord], None]
) -> tuple[SequenceRecord, ...]:
    """One record a sequence, sorted by name. Apart from times they do not depend on the number of workers.

    on_done: called with each record as it is finished.
    """
    records = []
    with closing(_records(tasks, workers)) as done:
        for record in done:
            on_done(record)
            records.append(record)
    return tuple(sorted(records, key=lambda record: record.name))


def _records(tasks: tuple[Task, ...], workers: int) -> Generator[SequenceRecord, None, None]:
    with worker_processes(workers) as pool:
        futures = [pool.submit(run_task, task) for task in tasks]
        for future in as_completed(futures):
            yield future.result()


def run_task(task: Task) -> SequenceRecord:
    """Run one task; called in a worker process. OpenCV is held to one core."""
    cv2.setNumThreads(1)
    shown = SHOWN_FRAMES.get(task.sequence.name, ())
    return run_sequence(task.sequence, task.methods, shown, time.perf_counter_ns)
