"""Times every function of a package: its own time, and that of its OpenCV calls.

For a while, every function of the package is wrapped by a stopwatch. That costs a few microseconds a call, so
it is done in a separate pass and does not distort the totals.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from controller.bench.opencv_calls import intercept_cv2
from hal.clocks import NS_PER_MS


@dataclass(slots=True)
class FunctionTime:
    """Time of one function.

    calls: how often it was called.
    own_ns: its own time, without the functions and OpenCV calls inside it.
    opencv_ns: time of its OpenCV calls.
    """

    calls: int = 0
    own_ns: int = 0
    opencv_ns: int = 0


@dataclass
class StageTimer:
    """Adds up times by function name. While an inner function runs, the outer one is not charged."""

    stopwatch_ns: Callable[[], int]
    spent: defaultdict[str, FunctionTime] = field(default_factory=lambda: defaultdict(FunctionTime))
    _running: list[str] = field(default_factory=list)
    _mark_ns: int = 0

    def take(self) -> dict[str, FunctionTime]:
        """The times since the last call."""
        spent, self.spent = dict(self.spent), defaultdict(FunctionTime)
        return spent

    def run(
        self, name: str, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        """Call function and charge its own time to name."""
        self._charge()
        self.spent[name].calls += 1
        self._running.append(name)
        try:
            return function(*args, **kwargs)
        finally:
            self._charge()
            self._running.pop()

    def run_opencv(
        self, name: str, function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        """Call a function of cv2 and charge its time as OpenCV to the calling function."""
        self._charge()
        try:
            return function(*args, **kwargs)
        finally:
            now_ns = self.stopwatch_ns()
            if self._running:
                self.spent[self._running[-1]].opencv_ns += now_ns - self._mark_ns
            self._mark_ns = now_ns

    def _charge(self) -> None:
        now_ns = self.stopwatch_ns()
        if self._running:
            self.spent[self._running[-1]].own_ns += now_ns - self._mark_ns
        self._mark_ns = now_ns


@dataclass(frozen=True, slots=True)
class StageFigures:
    """A function or a group of them per frame: mean number of calls, medians of the times as in
    FunctionTime."""

    calls: float
    own_ms: float
    opencv_ms: float

    def as_json(self) -> dict[str, float]:
        """Plain values."""
        return {
            "calls": round(self.calls, 2),
            "own_ms": round(self.own_ms, 4),
            "opencv_ms": round(self.opencv_ms, 4),
        }


def summarise(
    frames: Sequence[Mapping[str, FunctionTime]], group: Callable[[str], str] = lambda name: name
) -> dict[str, StageFigures]:
    """Figures over all frames by group, the one with the most own time first.

    group: gives the group of a function name.
    A frame in which a function did not run counts as zero for it.
    """
    names = dict.fromkeys(group(name) for spent in frames for name in spent)
    values = {name: np.zeros((len(frames), 3)) for name in names}
    for index, spent in enumerate(frames):
        for name, item in spent.items():
            values[group(name)][index] += (item.calls, item.own_ns, item.opencv_ns)
    figures = {
        name: StageFigures(
            float(table[:, 0].mean()),
            float(np.median(table[:, 1])) / NS_PER_MS,
            float(np.median(table[:, 2])) / NS_PER_MS,
        )
        for name, table in values.items()
    }
    return dict(sorted(figures.items(), key=lambda item: -item[1].own_ms))


def modules_of(package: ModuleType) -> tuple[ModuleType, ...]:
    """The package and all its modules, imported."""
    inside = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    return (package, *(importlib.import_module(info.name) for info in inside))


@contextmanager
def timed_functions(modules: Sequence[ModuleType], timer: StageTimer) -> Iterator[None]:
    """Inside the block, watch times every function and method of modules, and their OpenCV calls.

    Methods whose names begin with two underscores are not wrapped; their time counts as their caller's.
    """
    undo: list[tuple[Any, str, object]] = []
    try:
        for holder, name, function in _functions(modules):
            undo.append((holder, name, function))
            setattr(holder, name, _timed(function, timer))
        with intercept_cv2(modules, timer.run_opencv):
            yield
    finally:
        for holder, name, original in undo:
            setattr(holder, name, original)


def _functions(modules: Sequence[ModuleType]) -> list[tuple[Any, str, FunctionType]]:
    """All names bound to a function of modules, where it is defined and where it is imported."""
    own = {module.__name__ for module in modules}
    found: list[tuple[Any, str, FunctionType]] = []
    for module in modules:
        for name, value in vars(module).items():
            if isinstance(value, FunctionType) and value.__module__ in own:
                found.append((module, name, value))
            elif inspect.isclass(value) and value.__module__ == module.__name__:
                methods = vars(value).items()
                found.extend(
                    (value, key, method)
                    for key, method in methods
                    if isinstance(method, FunctionType) and not key.startswith("__")
                )
    return found


def _timed(function: FunctionType, timer: StageTimer) -> Callable[..., Any]:
    name = f"{function.__module__}.{function.__qualname__}"

    @functools.wraps(function)
    def timed(*args: Any, **kwargs: Any) -> Any:
        return timer.run(name, function, args, kwargs)

    return timed
