from __future__ import annotations

from types import ModuleType

import cv2
import numpy as np
import pytest

import vision
from controller.bench.stages import (
    FunctionTime,
    StageFigures,
    StageTimer,
    modules_of,
    summarise,
    timed_functions,
)

LOW = """
import cv2

def wait(clock, ns):
    clock.now_ns += ns

def find(clock, image):
    wait(clock, 10)
    cv2.countNonZero(image)
    wait(clock, 1)

class Finder:
    def __init__(self):
        self.found = 0

    def step(self, clock, image):
        wait(clock, 100)
        find(clock, image)
        self.found += 1
"""


HIGH = """
def look(clock, image):
    finder = Finder()
    finder.step(clock, image)
    find(clock, image)
    return finder.found
"""


class Clock:
    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


def module(name: str, source: str, **given: object) -> ModuleType:
    made = ModuleType(name)
    vars(made).update(given)
    exec(compile(source, f"{name}.py", "exec"), vars(made))
    return made


def test_own_time_excludes_inner_functions() -> None:
    clock = Clock()
    watch = StageTimer(clock)

    def inner() -> None:
        clock.now_ns += 5

    def outer() -> str:
        clock.now_ns += 2
        watch.run("inner", inner, (), {})
        watch.run("inner", inner, (), {})
        clock.now_ns += 1
        return "done"

    assert watch.run("outer", outer, (), {}) == "done"
    assert watch.take() == {"outer": FunctionTime(1, 3, 0), "inner": FunctionTime(2, 10, 0)}


def test_what_was_taken_is_not_counted_again() -> None:
    watch = StageTimer(Clock())
    watch.run("once", lambda: None, (), {})
    assert watch.take() == {"once": FunctionTime(1, 0, 0)}
    assert watch.take() == {}


def test_opencv_is_charged_to_its_caller_and_to_nobody_outside() -> None:
    clock = Clock()
    watch = StageTimer(clock)

    def slow() -> None:
        clock.now_ns += 7

    def caller() -> None:
        clock.now_ns += 1
        watch.run_opencv("Canny", slow, (), {})
        clock.now_ns += 2

    watch.run("caller", caller, (), {})
    watch.run_opencv("Canny", slow, (), {})
    assert watch.take() == {"caller": FunctionTime(1, 3, 7)}


def test_an_error_ends_the_function_that_raised_it() -> None:
    clock = Clock()
    watch = StageTimer(clock)

    def fail() -> None:
        clock.now_ns += 4
        raise RuntimeError("broken")

    def outer() -> None:
        with pytest.raises(RuntimeError):
            watch.run("fail", fail, (), {})
        clock.now_ns += 1

    watch.run("outer", outer, (), {})
    assert watch.take() == {"outer": FunctionTime(1, 1, 0), "fail": FunctionTime(1, 4, 0)}


def test_functions_methods_and_imported_names_are_watched() -> None:
    low = module("low", LOW)
    high = module("high", HIGH, Finder=low.Finder, find=low.find)
    clock = Clock()
    watch = StageTimer(clock)
    with timed_functions([low, high], watch):
        assert high.look(clock, np.ones((2, 2), np.uint8)) == 1
    spent = watch.take()
    assert {name: item.calls for name, item in spent.items()} == {
        "high.look": 1, "low.Finder.step": 1, "low.find": 2, "low.wait": 5,
    }  # fmt: skip
    assert spent["low.wait"].own_ns == 100 + 2 * 11


def test_everything_is_itself_again_afterwards() -> None:
    low = module("low", LOW)
    high = module("high", "", find=low.find)
    find, step = low.find, low.Finder.step

    def fail_inside() -> None:
        with timed_functions([low, high], StageTimer(Clock())):
            assert low.find is not find
            assert high.find is not find
            assert low.Finder.step is not step
            raise KeyError

    with pytest.raises(KeyError):
        fail_inside()
    assert low.find is find
    assert high.find is find
    assert low.Finder.step is step
    assert low.cv2 is cv2


def test_vision_is_whole_again_after_being_watched() -> None:
    modules = modules_of(vision)
    before = [dict(vars(module)) for module in modules]
    with timed_functions(modules, StageTimer(Clock())):
        assert [dict(vars(module)) for module in modules] != before
    assert [dict(vars(module)) for module in modules] == before


def test_modules_of_a_package_are_all_found() -> None:
    names = {module.__name__ for module in modules_of(vision)}
    assert {"vision", "vision.perception", "vision.fragments.optical_flow"} <= names


def test_summary_by_hand() -> None:
    frames = [
        {"a.f": FunctionTime(1, 1_000_000, 0), "a.g": FunctionTime(2, 3_000_000, 500_000)},
        {"a.f": FunctionTime(1, 2_000_000, 0)},
        {"a.f": FunctionTime(2, 6_000_000, 0), "a.g": FunctionTime(1, 1_000_000, 700_000)},
    ]
    assert summarise(frames) == {
        "a.f": StageFigures(4 / 3, 2.0, 0.0),
        "a.g": StageFigures(1.0, 1.0, 0.5),
    }


def test_summary_of_a_group_adds_up_each_frame_before_the_median() -> None:
    frames = [
        {
            "a.f": FunctionTime(1, 1_000_000, 0),
            "a.g": FunctionTime(1, 9_000_000, 0),
            "b.h": FunctionTime(1, 20_000_000, 0),
        },
        {
            "a.f": FunctionTime(1, 9_000_000, 0),
            "a.g": FunctionTime(1, 1_000_000, 0),
            "b.h": FunctionTime(1, 20_000_000, 0),
        },
    ]
    summary = summarise(frames, group=lambda name: name[0])
    assert list(summary) == ["b", "a"], "the one with most own time first"
    assert summary["a"] == StageFigures(2.0, 10.0, 0.0)


def test_a_stage_is_written_as_calls_and_milliseconds() -> None:
    assert StageFigures(1.5, 0.123456, 2.0).as_json() == {"calls": 1.5, "own_ms": 0.1235, "opencv_ms": 2.0}
