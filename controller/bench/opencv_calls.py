"""Records a package's OpenCV calls with their arguments, and times the same calls alone.

For a while, the modules of the package see a stand-in for cv2. cv2 itself is not changed, so OpenCV calls
from elsewhere (a thread that decodes images, the renderer) are not counted.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import cv2

OnCall = Callable[[str, Callable[..., Any], tuple[Any, ...], dict[str, Any]], Any]


@dataclass(frozen=True, slots=True)
class OpenCvCall:
    """One call of cv2.<name>. The arguments are copies of what they were before the call."""

    name: str
    args: tuple[Any, ...]
    kwargs: dict[str, Any]

    def copied(self) -> OpenCvCall:
        """The same call with copied arguments, because some functions write into their arguments."""
        args, kwargs = copy.deepcopy((self.args, self.kwargs))
        return OpenCvCall(self.name, args, kwargs)

    def execute(self) -> Any:
        """Make the call. Call this once only, because the function may write into the arguments."""
        return getattr(cv2, self.name)(*self.args, **self.kwargs)


class OpenCvProxy:
    """Replaces cv2; passes every function call to on_call, which must make the call.

    Classes and constants are passed through. Methods of OpenCV objects are not intercepted.
    """

    def __init__(self, on_call: OnCall) -> None:
        self._on_call = on_call

    def __getattr__(self, name: str) -> Any:
        real = getattr(cv2, name)
        if not callable(real) or isinstance(real, type):
            return real

        def intercepted(*args: Any, **kwargs: Any) -> Any:
            return self._on_call(name, real, args, kwargs)

        setattr(self, name, intercepted)
        return intercepted


@contextmanager
def intercept_cv2(modules: Sequence[ModuleType], on_call: OnCall) -> Iterator[None]:
    """Inside the block, OpenCV calls of these modules go to on_call."""
    users = [module for module in modules if getattr(module, "cv2", None) is cv2]
    proxy = OpenCvProxy(on_call)
    for module in users:
        vars(module)["cv2"] = proxy
    try:
        yield
    finally:
        for module in users:
            vars(module)["cv2"] = cv2


@contextmanager
def recorded_calls(modules: Sequence[ModuleType]) -> Iterator[list[OpenCvCall]]:
    """Inside the block, the OpenCV calls of these modules are appended to the list, in order."""
    calls: list[OpenCvCall] = []

    def record(name: str, real: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        calls.append(OpenCvCall(name, args, kwargs).copied())
        return real(*args, **kwargs)

    with intercept_cv2(modules, record):
        yield calls


def time_bare(calls: Sequence[OpenCvCall], stopwatch_ns: Callable[[], int]) -> dict[str, int]:
    """Nanoseconds by function name for making the calls one after the other, with nothing in between.

    Copying the arguments is not counted; freeing the results is.
    """
    spent_ns: dict[str, int] = {}
    for call in [call.copied() for call in calls]:
        function, args, kwargs = getattr(cv2, call.name), call.args, call.kwargs
        started_ns = stopwatch_ns()
        function(*args, **kwargs)
        ended_ns = stopwatch_ns()
        spent_ns[call.name] = spent_ns.get(call.name, 0) + ended_ns - started_ns
    return spent_ns
