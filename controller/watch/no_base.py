"""A camera without a base (`treadwatch watch --no-chassis`): nothing is known of any motion."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from controller.base.localise import UNKNOWN
from hal.types import ChassisMode, ChassisState


class NoBase:
    """hal.api.ChassisListener without a device."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def listen(self, now_ns: int) -> ChassisState:
        """Everything unknown."""
        nan = math.nan
        return ChassisState(
            now_ns, ChassisMode.STANDBY, "there is no base", None, nan, nan, UNKNOWN, nan, (), None
        )
