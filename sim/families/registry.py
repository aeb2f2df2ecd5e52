"""All scenario families by name. Each is a seeded generator of worlds and of the faults in them."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from config.faults import Faults, LateWindow, Window
from config.scenario import Scenario
from sim.families import close_by, crossing, oncoming, same_way, standing
from sim.families.layout import Random

# The tracks of every family lose a tenth of a turn, unless its own faults say otherwise.
USUAL_SLIP = 0.1


@dataclass(frozen=True, slots=True)
class Case:
    """The world of one mission. family: its scenario family, or the file of a user's own scenario."""

    family: str
    seed: int
    scenario: Scenario

    @property
    def faults(self) -> Faults:
        """What goes wrong in it."""
        return self.scenario.faults

    @property
    def glass(self) -> frozenset[str]:
        """Names of the bodies that depth does not see."""
        return frozenset(body.name for body in self.scenario.bodies if body.glass)

    @property
    def expects_arrival(self) -> bool:
        """Whether a robot that drives well reaches its target: nothing blocks it, and its base answers."""
        return self.scenario.outcome == "target" and self.faults.feedback_lost_s is None


@dataclass(frozen=True, slots=True)
class _Family:
    world: Callable[[Random], Scenario]
    faults: Callable[[Random], Faults] = lambda _: Faults()


def _silent(random: Random) -> Faults:
    return Faults(no_frames=(_half_second_to_three(random),))


def _frozen(random: Random) -> Faults:
    return Faults(frozen_frames=(_half_second_to_three(random),))


def _half_second_to_three(random: Random) -> Window:
    start_s = float(random.uniform(2.0, 8.0))
    return Window(start_s=start_s, end_s=start_s + float(random.uniform(0.5, 3.0)))


def _late(random: Random) -> Faults:
    start_s = float(random.uniform(1.0, 6.0))
    end_s = start_s + float(random.uniform(2.0, 8.0))
    delay_s = float(random.uniform(0.05, 0.3))
    return Faults(late_frames=(LateWindow(start_s=start_s, end_s=end_s, delay_s=delay_s),))


def _slip(random: Random) -> Faults:
    return Faults(yaw_slip=float(random.uniform(0.05, 0.2)), distance_slip=float(random.uniform(-0.01, 0.03)))


def _feedback(random: Random) -> Faults:
    return Faults(feedback_lost_s=float(random.uniform(2.0, 8.0)))


_FAMILIES: dict[str, _Family] = {
    "head_on_person": _Family(oncoming.head_on_person),
    "head_on_robot": _Family(oncoming.head_on_robot),
    "crossing_left": _Family(crossing.crossing_left),
    "crossing_right": _Family(crossing.crossing_right),
    "behind_shelf": _Family(crossing.behind_shelf),
    "cut_in": _Family(same_way.cut_in),
    "overtaking": _Family(same_way.overtaking),
    "lead_brakes": _Family(same_way.lead_brakes),
    "static_crate": _Family(standing.static_crate),
    "crate_beside": _Family(standing.crate_beside),
    "low_pallet": _Family(standing.low_pallet),
    "thin_pole": _Family(standing.thin_pole),
    "plain_wall": _Family(standing.plain_wall),
    "hanging_beam": _Family(standing.hanging_beam),
    "group": _Family(oncoming.group),
    "turns_back": _Family(oncoming.turns_back),
    "grazing": _Family(oncoming.grazing),
    "crowd_junction": _Family(crossing.crowd_junction),
    "curved_path": _Family(crossing.curved_path),
    "crate_beside_bend": _Family(close_by.crate_beside_bend),
    "empty_aisle": _Family(standing.empty_aisle),
    "narrow_aisle": _Family(close_by.narrow_aisle),
    "glass_front": _Family(standing.glass_front),
    "camera_dropout": _Family(crossing.crossing_left, _silent),
    "camera_frozen": _Family(crossing.crossing_right, _frozen),
    "odometry_slip": _Family(crossing.curved_path, _slip),
    "late_frames": _Family(crossing.crossing_left, _late),
    "feedback_lost": _Family(crossing.crossing_right, _feedback),
}

FAMILY_NAMES: tuple[str, ...] = tuple(_FAMILIES)


def generate(family: str, seed: int) -> Case:
    """The mission of a family for a seed, always the same. Raises KeyError for an unknown family."""
    entry = _FAMILIES[family]
    random = np.random.default_rng((zlib.crc32(family.encode()), seed))
    world = entry.world(random)
    faults = entry.faults(random)
    if faults.yaw_slip is None:
        faults = faults.model_copy(update={"yaw_slip": USUAL_SLIP})
    return Case(family, seed, world.model_copy(update={"name": f"{family}-{seed}", "faults": faults}))
