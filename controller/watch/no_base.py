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
        return ChassisState(
            stamp_ns=now_ns,
            mode=ChassisMode.STANDBY,
            reason="there is no base",
            feedback_ns=None,
            v_mps=math.nan,
            w_radps=math.nan,
            pose=UNKNOWN,
            battery_v=math.nan,
            faults=(),
            sent=None,
        )
