"""The whole simulated set before all methods, on as many processes as wished."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

import cv2

from controller.evaluation.contestants import ALWAYS, BASELINES
from controller.evaluation.run_sequence import SequenceRecord, run_sequence
from controller.evaluation.sequences import Sequence
from controller.workers import worker_processes

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
    """What one worker does: everything on one core."""
    cv2.setNumThreads(1)
    shown = SHOWN_FRAMES.get(task.sequence.name, ())
    return run_sequence(task.sequence, task.methods, shown, time.perf_counter_ns)
