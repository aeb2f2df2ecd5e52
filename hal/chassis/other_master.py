"""Detects a second master that commands the base on the same CAN bus.

A computer never receives its own frames. So one received frame that only a host sends is proof of another
program, another computer, or a tool that was left running. The base would follow both in turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from hal.clocks import NS_PER_S

# Identifiers that only a host sends, and what they do. Frames that move nothing (light, version) do not
# count.
HOST_FRAMES: Mapping[int, str] = MappingProxyType(
    {0x111: "motion commands", 0x421: "the control mode", 0x441: "clearing of errors"}
)

# The bus counts as free again this long after the last such frame. The base stops half a second after it.
_CLEAR_AFTER_NS = NS_PER_S


class OtherMaster:
    """sentence: "" while nobody else commands the base."""

    def __init__(self) -> None:
        self.sentence = ""
        self._last_frame_ns: int | None = None

    def note_frame(self, arbitration_id: int, now_ns: int) -> None:
        """A frame of another host came. The first kind is reported until the bus is free again."""
        self._last_frame_ns = now_ns
        self.sentence = self.sentence or (
            f"another sender has sent {HOST_FRAMES[arbitration_id]} (0x{arbitration_id:X}) on this bus; stop "
            "the other program or computer first: a base has one master"
        )

    def step(self, now_ns: int) -> None:
        """Forget the other master once the bus has been free of its frames for long enough."""
        if self._last_frame_ns is not None and now_ns - self._last_frame_ns > _CLEAR_AFTER_NS:
            self.sentence, self._last_frame_ns = "", None
