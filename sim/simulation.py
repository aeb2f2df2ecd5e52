"""A whole outside in one object: the emulated base on its plant, in a world that moves by itself."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from config.robot import Body
from hal.api import Closing
from hal.clocks import NS_PER_S
from hal.types import PlanarPose
from sim.contact import Clearance, nearest_body
from sim.plant import TrackedPlant
from sim.world import World

# Contact is looked for this often: 1.5 cm of the fastest approach of two bodies at 1.5 m/s each.
CHECK_PERIOD_NS = NS_PER_S // 200


class Emulator(Closing, Protocol):
    """A chassis emulator: answers on its link as the real base would."""

    @property
    def plant(self) -> TrackedPlant:
        """The body that it moves."""
        ...

    def advance_to(self, now_ns: int) -> None:
        """Obey, move and answer up to now_ns."""
        ...

    def press_estop(self) -> None:
        """Whatever this base has for an emergency stop is triggered."""
        ...

    def release_estop(self) -> None:
        """It is no longer."""
        ...

    def restart(self) -> None:
        """Power interrupted for a moment."""
        ...

    def freeze(self) -> None:
        """Hears and says nothing; its own time-out runs."""
        ...

    def thaw(self) -> None:
        """Goes on."""
        ...


class Referee:
    """Watches the true clearance between the robot and everything at its height."""

    def __init__(self, world: World, body: Body, start_ns: int) -> None:
        self._world = world
        self._body = body
        self._start_ns = start_ns
        self._touching: str | None = None
        self.contacts: list[str] = []
        self.closest: Clearance | None = None

    def watch(self, pose: PlanarPose, now_ns: int) -> None:
        """Look once. A contact counts when it begins."""
        now = nearest_body(self._world, self._body, pose, (now_ns - self._start_ns) / NS_PER_S)
        if self.closest is None or now.distance_m < self.closest.distance_m:
            self.closest = now
        if now.touches and self._touching != now.name:
            self.contacts.append(now.name)
        self._touching = now.name if now.touches else None


class Simulation:
    """Context manager; opens and closes the emulator's end of the link."""

    def __init__(self, emulator: Emulator, referee: Referee) -> None:
        self._emulator = emulator
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
        """Where the robot truly stands."""
        return self._emulator.plant.pose

    def advance_to(self, now_ns: int) -> None:
        """Let everything outside go on until now_ns."""
        self._emulator.advance_to(now_ns)
        if now_ns >= self._next_check_ns:
            self.referee.watch(self.body_pose, now_ns)
            self._next_check_ns = now_ns + CHECK_PERIOD_NS
