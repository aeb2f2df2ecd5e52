"""The words for an answer that came after its time limit, for drivers that ask one question at a time."""

from __future__ import annotations

from hal.clocks import NS_PER_MS


def late_answer(delay_ns: int, limit_ns: int) -> str:
    """How late it came. What answers late is neither silent nor wrongly wired: the line, or this computer, is
    too slow."""
    return (
        f"the last answer came {delay_ns / NS_PER_MS:.0f} ms after its request, too late: the limit is "
        f"{limit_ns / NS_PER_MS:.0f} ms"
    )
