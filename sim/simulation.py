"""The whole simulated outside in one object: the emulated base with its plant, and a referee for contacts."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from config.robot import Body
from hal.api import Device
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from sim.contact import Clearance, nearest_body
from sim.plant import TrackedPlant
from sim.world import World

# Period of the check for contacts: two bodies that approach each other at 1.5 m/s each come 1.5 cm closer.
CHECK_PERIOD_NS = NS_PER_S // 200


class Emulator(Device, Protocol):
    """A chassis emulator: answers on its link as the real base would."""

    @property
    def plant(self) -> TrackedPlant:
        """The plant that the emulator moves."""
        ...

    def advance_to(self, now_ns: int) -> None:
        """Follow commands, move and answer up to now_ns."""
        ...

    def press_estop(self) -> None:
        """Trigger the emergency stop of this base."""
        ...

    def release_estop(self) -> None:
        """Release the emergency stop."""
        ...

    def restart(self) -> None:
        """Interrupt its power for a moment."""
        ...

    def freeze(self) -> None:
        """Let it hang: it neither receives nor sends, but its own time-out still runs."""
        ...

    def thaw(self) -> None:
        """Let it go on."""
        ...


class Referee:
    """Watches the true clearance between the robot and everything at its height.

    contacts: names of what was touched, in order. closest: the smallest clearance so far.
    """

    def __init__(self, world: World, body: Body, start_ns: int) -> None:
        self._world = world
        self._body = body
        self._start_ns = start_ns
        self._touched_name: str | None = None
        self.contacts: list[str] = []
        self.closest: Clearance | None = None

    def watch(self, pose: PlanarPose, now_ns: int) -> None:
        """Check once. A contact counts once, when it begins."""
        now = nearest_body(self._world, self._body, pose, (now_ns - self._start_ns) / NS_PER_S)
        if self.closest is None or now.distance_m < self.closest.distance_m:
            self.closest = now
        if now.touches and self._touched_name != now.name:
            self.contacts.append(now.name)
        self._touched_name = now.name if now.touches else None


class Simulation:
    """Emulator and referee together. A context manager that opens and closes the emulator's end of the
    link.

    feedback_lost_ns: from then on the base neither hears nor answers; None: never.
    """

    def __init__(self, emulator: Emulator, referee: Referee, feedback_lost_ns: int | None = None) -> None:
        self._emulator = emulator
        self._feedback_lost_ns = feedback_lost_ns
        self._next_check_ns = 0
        self.referee = referee

    def __enter__(self) -> Self:
        self._emulator.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._emulator.__exit__(kind, error, trace)

    @property
    def body_pose(self) -> PlanarPose:
        """The true pose of the robot."""
        return self._emulator.plant.pose

    def advance_to(self, now_ns: int) -> None:
        """Advance everything outside to now_ns."""
        self._emulator.advance_to(now_ns)
        if self._feedback_lost_ns is not None and now_ns >= self._feedback_lost_ns:
            self._emulator.freeze()
        if now_ns >= self._next_check_ns:
            self.referee.watch(self.body_pose, now_ns)
            self._next_check_ns = now_ns + CHECK_PERIOD_NS
