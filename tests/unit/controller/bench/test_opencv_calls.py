from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from controller.bench.opencv_calls import OpenCvCall, intercept_cv2, recorded_calls, time_bare

SOURCE = """
import cv2
import numpy as np

def edges(grey):
    return cv2.Canny(grey, 50.0, 150.0)

def brighten_in_place(image):
    cv2.add(image, np.full_like(image, 5), dst=image)
    return image

def threshold(image):
    return cv2.threshold(image, 100, 255, cv2.THRESH_BINARY)[1]
"""


def module(source: str = SOURCE) -> ModuleType:
    made = ModuleType("under_watch")
    exec(compile(source, "under_watch.py", "exec"), vars(made))
    return made


def picture() -> NDArray[np.uint8]:
    image = np.zeros((40, 60), np.uint8)
    image[10:30, 20:40] = 200
    return image


class Ticking:
    """Each reading is one nanosecond later than the difference before it."""

    def __init__(self) -> None:
        self.readings = 0
        self.now_ns = 0

    def __call__(self) -> int:
        self.readings += 1
        self.now_ns += self.readings
        return self.now_ns


def test_calls_are_recorded_in_order_with_arguments() -> None:
    timed_functions = module()
    with recorded_calls([timed_functions]) as calls:
        timed_functions.edges(picture())
        timed_functions.threshold(picture())
    assert [call.name for call in calls] == ["Canny", "threshold"]
    assert calls[0].args[1:] == (50.0, 150.0)
    assert calls[1].args[1:] == (100, 255, cv2.THRESH_BINARY)
    np.testing.assert_array_equal(calls[0].args[0], picture())


def test_results_reach_the_caller_unchanged() -> None:
    timed_functions = module()
    expected = timed_functions.edges(picture())
    with recorded_calls([timed_functions]):
        np.testing.assert_array_equal(timed_functions.edges(picture()), expected)


def test_an_executed_record_gives_the_same_result() -> None:
    timed_functions = module()
    with recorded_calls([timed_functions]) as calls:
        seen = timed_functions.edges(picture())
    assert seen.any()
    np.testing.assert_array_equal(calls[0].execute(), seen)


def test_arguments_are_those_from_before_the_call() -> None:
    timed_functions = module()
    image = picture()
    with recorded_calls([timed_functions]) as calls:
        after = timed_functions.brighten_in_place(image)
    assert after.max() == 205
    assert calls[0].args[0].max() == 200
    assert calls[0].kwargs["dst"] is calls[0].args[0], "what was one array stays one array"


def test_a_fresh_call_spends_only_its_own_arguments() -> None:
    image = picture()
    call = OpenCvCall("add", (image, np.full_like(image, 5)), {"dst": image})
    call.copied().execute()
    np.testing.assert_array_equal(image, picture())
    call.execute()
    assert image.max() == 205


def test_cv2_is_itself_again_afterwards() -> None:
    timed_functions = module()
    canny = cv2.Canny
    with recorded_calls([timed_functions]) as calls:
        assert timed_functions.cv2 is not cv2
        cv2.Canny(picture(), 1.0, 2.0)  # somebody else's call: not recorded
    assert timed_functions.cv2 is cv2
    assert cv2.Canny is canny
    assert calls == []


def test_cv2_is_itself_again_after_an_error() -> None:
    timed_functions = module()
    with pytest.raises(cv2.error), recorded_calls([timed_functions]):
        timed_functions.edges(np.zeros((4, 4), np.float64))
    assert timed_functions.cv2 is cv2


def test_modules_without_cv2_are_left_alone() -> None:
    plain = ModuleType("plain")
    with recorded_calls([plain]):
        assert not hasattr(plain, "cv2")
    assert not hasattr(plain, "cv2")


def test_constants_and_classes_pass_through() -> None:
    timed_functions = module()
    with recorded_calls([timed_functions]) as calls:
        assert timed_functions.cv2.THRESH_BINARY == cv2.THRESH_BINARY
        assert timed_functions.cv2.error is cv2.error
    assert calls == []


def test_an_unknown_name_is_refused_as_by_cv2() -> None:
    timed_functions = module()
    with recorded_calls([timed_functions]), pytest.raises(AttributeError):
        _ = timed_functions.cv2.NoSuchFunction


def test_the_stand_in_asks_its_owner_to_make_the_call() -> None:
    timed_functions = module()
    seen: list[str] = []

    def answer(name: str, real: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> str:
        seen.append(name)
        return "instead"

    with intercept_cv2([timed_functions], answer):
        assert timed_functions.edges(picture()) == "instead"
    assert seen == ["Canny"]


def test_bare_time_is_added_up_by_function() -> None:
    calls = [
        OpenCvCall("norm", (np.ones(3),), {}),
        OpenCvCall("mean", (np.ones(3),), {}),
        OpenCvCall("norm", (np.ones(3),), {}),
    ]
    # Readings 1, 3 | 6, 10 | 15, 21: the calls take 2, 4 and 6 ns.
    assert time_bare(calls, Ticking()) == {"norm": 8, "mean": 4}


def test_bare_timing_does_not_use_up_the_record() -> None:
    image = picture()
    time_bare([OpenCvCall("add", (image, np.full_like(image, 5)), {"dst": image})], Ticking())
    np.testing.assert_array_equal(image, picture())
