"""What the user sees of a run: a progress line on a terminal, a line for each new decision, a summary."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain, repeat

from controller.decision.decision import Decision
from controller.terminal.outlet import Outlet, Words, write

BAR = 24
# A reason gets a line of its own only if it holds for this long.
SETTLED_S = 0.5
# A standstill is reported from this duration on.
STUCK_S = 10.0
# The progress line is redrawn every this many calls, not at every control step.
STEPS_SHOWN = 10


class Console:
    """Writes events and summary to standard output; warnings, and progress on a terminal, to standard error.

    quiet: no events and no progress. aside: everything to standard error, because standard output is for the
    observations.
    """

    def __init__(self, quiet: bool, aside: bool = False) -> None:
        self._quiet, self._aside = quiet, aside
        self._live = sys.stderr.isatty() and not quiet
        self._calls = 0
        self._said: tuple[str, int | None] | None = None
        self._heard: tuple[str, int | None] | None = None
        self._heard_at_s = 0.0
        self._stuck_told_s = 0.0
        self._stop_told = False
        self._view_lines = 0
        self._write = write

    @contextmanager
    def beside_a_drive(self) -> Iterator[None]:
        """Write through an Outlet in the block, so that a reader that stops does not block the drive."""
        with Outlet() as outlet:
            self._write = outlet.write
            try:
                yield
            finally:
                self._write = write

    def progress(self, share: float, text: str) -> None:
        """Redraw the progress line. share: 0..1 of the whole."""
        self._calls += 1
        if self._live and self._calls % STEPS_SHOWN == 1:
            done = round(BAR * min(max(share, 0.0), 1.0))
            bar = "#" * done + "." * (BAR - done)
            self._write(Words(f"\r\033[K[{bar}] {text[:90]}", to_stderr=True, whole=False))

    def view(self, stamp_s: float, rows: list[tuple[str, str]]) -> None:
        """What is known now, as (subject, text): on a terminal a block that is redrawn, else one line."""
        if self._quiet:
            return
        if not (sys.stderr if self._aside else sys.stdout).isatty():
            self.event(f"{stamp_s:7.2f} s  " + "  |  ".join(f"{name} {text}" for name, text in rows))
            return
        back = f"\033[{self._view_lines}A" if self._view_lines else ""
        lines = _block(rows, shutil.get_terminal_size().columns - 1)
        self._write(Words(f"{back}\r\033[J" + "\n".join(lines) + "\n", self._aside, whole=False))
        self._view_lines = len(lines)

    def decision(self, stamp_s: float, decision: Decision, speed_mps: float) -> None:
        """One line whenever a new rule or obstacle has determined the speed for half a second."""
        reason = decision.reason
        now = (reason.rule, reason.obstacle_id)
        if now != self._heard:
            self._heard, self._heard_at_s = now, stamp_s
        if now != self._said and stamp_s - self._heard_at_s >= SETTLED_S:
            self._said = now
            self.event(
                f"{stamp_s:7.2f} s  {speed_mps:4.2f} m/s  {decision.action.value:8}  {reason.sentence}"
            )

    def stopping(self, stamp_s: float, speed_mps: float, reason: str) -> None:
        """One line, once: why the robot stops although the way ahead may be free."""
        if not self._stop_told:
            self._stop_told = True
            self.event(f"{stamp_s:7.2f} s  {speed_mps:4.2f} m/s  stops     {reason}")

    def standing(self, stamp_s: float, lasted_s: float, decision: Decision) -> None:
        """One line on why the robot still stands: after ten seconds, and whenever the time has doubled."""
        if lasted_s < STUCK_S:
            self._stuck_told_s = 0.0
        elif lasted_s >= 2.0 * self._stuck_told_s:
            self._stuck_told_s = lasted_s
            since_s = stamp_s - lasted_s
            self.event(
                f"{stamp_s:7.2f} s  standing for {lasted_s:.0f} s, since {since_s:.2f} s: "
                f"{decision.reason.sentence}"
            )

    def complaints(self, stamp_s: float, new: Sequence[str], battery_v: float = math.nan) -> None:
        """One line for each new fault that the base reports without stopping.

        The voltage is added where it is known, because not every base has a bit for a low battery.
        """
        battery = f" (battery {battery_v:.1f} V)" if math.isfinite(battery_v) else ""
        for complaint in new:
            self.event(f"{stamp_s:7.2f} s  the base says: {complaint}{battery}")

    def unanswered(self, stamp_s: float, why: str) -> None:
        """One line where the base was told zero because it did not answer; nothing for ""."""
        if why:
            self.event(f"{stamp_s:7.2f} s  {why}")

    def event(self, line: str) -> None:
        """Write a line that stays, unless quiet."""
        if not self._quiet:
            self._clear()
            self._view_lines = 0
            self._write(Words(line, self._aside))

    def warning(self, line: str) -> None:
        """What the user should know before the drive: on standard error, even if quiet."""
        self._clear()
        self._view_lines = 0
        self._write(Words(f"treadwatch: warning: {line}", to_stderr=True))

    def summary(self, rows: list[tuple[str, str]]) -> None:
        """The result, one line for each (subject, text)."""
        self._clear()
        width = max(len(name) for name, _ in rows)
        for name, text in rows:
            self._write(Words(f"{name:<{width}}  {text}", self._aside))

    def _clear(self) -> None:
        if self._live:
            self._write(Words("\r\033[K", to_stderr=True, whole=False))


def _block(rows: list[tuple[str, str]], columns: int) -> list[str]:
    """The rows as lines of at most this many columns; a long text goes on below its beginning."""
    width = max(len(name) for name, _ in rows)
    lines = []
    for name, text in rows:
        wrapped = textwrap.wrap(text, max(columns - width - 2, 20))
        subjects = chain([name], repeat(""))
        lines += [f"{subject:<{width}}  {part}" for subject, part in zip(subjects, wrapped, strict=False)]
    return lines
