from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.decision import DecisionConfig
from config.robot import Robot
from controller.decision.bodies import Bodies, no_bodies
from controller.governor.ground import GroundMemory
from hal.geometry import body_in_floor
from hal.types import CameraMount, PlanarPose
from tests.support.floor_bodies import box
from vision.scene import FreeSpace

MOUNT = CameraMount(0.45, 0.0, 0.60, math.radians(4.0))
MS = 1_000_000
NOBODY = no_bodies(0)


def scan(nearest_m: float = math.inf, known_m: float = 10.0, ahead_only: float | None = None) -> FreeSpace:
    """80 bands; with ahead_only the surface stands within that tangent of the middle alone."""
    bearing = np.linspace(-0.68, 0.68, 80)
    nearest = np.full(80, nearest_m)
    if ahead_only is not None:
        nearest[np.abs(bearing) > ahead_only] = np.inf
    return FreeSpace(bearing, 0.68 / 80, nearest, np.minimum(nearest, known_m))


class Walkabout:
    """A robot that is put somewhere and looks; 33 ms a look."""

    def __init__(self) -> None:
        self.memory = GroundMemory(Robot(), MOUNT, DecisionConfig())
        self.now_ns = 0
        self.at(0.0)

    def at(self, x_m: float, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        self.pose = PlanarPose(x_m, y_m, heading_rad)
        self.memory.move(self.pose, self.now_ns)

    def drive(self, to_x_m: float, free: FreeSpace | None = None) -> None:
        for x_m in np.linspace(self.pose.x_m, to_x_m, max(2, round(abs(to_x_m - self.pose.x_m) / 0.03))):
            self.at(float(x_m))
            self.look(free or scan(), standing=False)

    def look(self, free: FreeSpace, times: int = 1, moving: Bodies = NOBODY, standing: bool = False) -> None:
        for _ in range(times):
            self.now_ns += 33 * MS
            self.memory.look(free, self.pose, self.now_ns, moving, standing)

    def free(self, x_m: float, y_m: float, since_ns: int = 0) -> bool:
        return bool(self.memory.free(np.array([[x_m, y_m]]), since_ns)[0])

    def blocked(self, x_m: float, y_m: float) -> bool:
        return bool(self.memory.blocked(np.array([[x_m, y_m]]), self.now_ns)[0])


def test_free_at_the_start_is_a_disc_by_consent() -> None:
    robot = Walkabout()
    assert robot.memory.consent_m == pytest.approx(2.05)
    for angle in np.linspace(0.0, 6.2, 9):
        assert robot.free(2.0 * math.cos(angle), 2.0 * math.sin(angle))
        assert not robot.free(2.2 * math.cos(angle), 2.2 * math.sin(angle))


def test_floor_is_free_where_it_was_seen_without_gaps() -> None:
    robot = Walkabout()
    robot.look(scan())
    x, y = np.meshgrid(np.arange(2.2, 4.0, 0.05), np.arange(-0.6, 0.6, 0.05))
    assert robot.memory.free(np.stack((x.ravel(), y.ravel()), axis=1)).all()
    assert not robot.free(3.0, 2.2), "outside the view"
    assert not robot.free(4.6, 0.0), "too far to be remembered"


def test_nothing_is_free_behind_a_surface_or_where_nothing_was_seen() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=2.5))
    assert robot.free(2.7, 0.0)
    assert not robot.free(3.2, 0.0)
    blind = Walkabout()
    blind.look(scan(known_m=0.0))
    assert not blind.free(2.7, 0.0)


def test_floor_under_the_nose_is_known_from_further_back_only() -> None:
    robot = Walkabout()
    robot.at(4.0)
    robot.look(scan(), times=5)
    # 0.7 m ahead of the camera no floor is seen, however often it is looked at.
    assert not robot.free(5.15, 0.0)
    assert robot.free(5.85, 0.0)
    driven = Walkabout()
    driven.drive(4.0)
    assert driven.free(5.15, 0.0)


def test_a_surface_needs_two_sightings_and_is_kept_out_of_view() -> None:
    robot = Walkabout()
    robot.at(0.0)
    robot.look(scan(nearest_m=2.0))
    assert not robot.blocked(2.45, 0.3)
    robot.look(scan(nearest_m=2.0))
    assert robot.blocked(2.45, 0.3)
    # Looking elsewhere for a minute changes nothing.
    robot.at(0.0, 0.0, math.pi / 2.0)
    robot.look(scan(), times=1800)
    assert robot.blocked(2.45, 0.3)


def test_a_surface_that_is_seen_through_goes() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=2.0), times=5)
    assert robot.blocked(2.45, 0.0)
    robot.look(scan(), times=6)
    assert not robot.blocked(2.45, 0.0)
    assert robot.free(2.45, 0.0)


def test_a_low_thing_that_went_below_the_view_is_still_there() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=1.4), times=5)
    assert robot.blocked(1.85, 0.0)
    # 0.6 m ahead of the camera it is too low to be seen: the view above it is free.
    robot.at(0.8)
    robot.look(scan(), times=30)
    assert robot.blocked(1.85, 0.0)


def test_moving_body_leaves_no_lasting_mark() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=2.0), times=5, moving=box(2.6, 0.0, 0.0, 1.0, half_across_m=3.0))
    assert robot.blocked(2.45, 0.0)
    robot.at(0.0, 0.0, math.pi / 2.0)
    robot.look(scan(), times=63)
    assert not robot.blocked(2.45, 0.0)


def test_surface_that_vanishes_before_a_standing_robot_is_forgotten_and_others_are_kept() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=2.0, ahead_only=0.2), times=5, standing=False)
    robot.look(scan(nearest_m=2.0, ahead_only=0.2), times=10, standing=True)
    robot.look(scan(known_m=0.0), times=70, standing=True)
    assert not robot.blocked(2.45, 0.0)
    robot.look(scan(nearest_m=2.0, ahead_only=0.2), times=10, standing=True)
    robot.look(scan(known_m=0.0), times=1, standing=False)
    robot.look(scan(known_m=0.0), times=200, standing=False)
    assert robot.blocked(2.45, 0.0)


def test_floor_that_a_person_had_hidden_is_free_once_they_have_gone() -> None:
    robot = Walkabout()
    robot.at(5.0)
    robot.look(scan(nearest_m=0.6, known_m=10.0), times=5, standing=True)
    assert not robot.free(6.4, 0.0)
    robot.look(scan(), times=10, standing=True)
    assert robot.free(6.4, 0.0)
    # While it drives, a view over low things is no proof.
    driving = Walkabout()
    driving.at(5.0)
    driving.look(scan(nearest_m=0.6, known_m=10.0), times=5, standing=False)
    driving.look(scan(), times=10, standing=False)
    assert not driving.free(6.4, 0.0)


def test_the_body_stands_on_free_floor() -> None:
    robot = Walkabout()
    robot.at(3.0, 1.0, 0.5)
    for ahead, left in ((0.5, 0.38), (0.5, -0.38), (-0.5, 0.38), (-0.5, -0.38), (0.0, 0.0)):
        x_m, y_m, _ = body_in_floor(PlanarPose(3.0, 1.0, 0.5)).apply(np.array([ahead, left, 0.0])).tolist()
        assert robot.free(x_m, y_m)


def test_memory_ends_with_the_way_made_and_with_time_where_asked() -> None:
    robot = Walkabout()
    robot.drive(3.0)
    assert robot.free(2.0, 0.5)
    assert not robot.free(2.0, 0.5, since_ns=robot.now_ns + 1)
    # To and fro over the same floor, looking at nothing: after eight metres nobody knows any more.
    for x_m in (1.0, 3.0, 1.0, 3.0, 1.0):
        robot.drive(x_m, scan(known_m=0.0))
    assert not robot.free(2.0, 1.2)


def test_far_places_that_share_a_cell_are_not_mixed_up() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=2.0), times=5)
    assert robot.blocked(2.45, 0.0)
    assert not robot.blocked(2.45 + 12.8, 0.0)
    assert not robot.free(0.05 + 12.8, 0.05)
    # Once there, its cells are those of the new place: the old one is forgotten, not moved along.
    robot.at(12.8)
    robot.look(scan())
    assert robot.free(2.45 + 12.8, 0.0)
    assert not robot.blocked(2.45 + 12.8, 0.0)
    assert not robot.blocked(2.45, 0.0)


def test_a_scan_without_bands_is_nothing_seen() -> None:
    robot = Walkabout()
    robot.at(5.0)
    empty = FreeSpace(np.zeros(0), 0.01, np.zeros(0), np.zeros(0))
    robot.look(empty)
    assert not robot.free(7.0, 0.0)


def test_a_cell_that_comes_to_hold_another_place_keeps_nothing_of_the_old_one() -> None:
    robot = Walkabout()
    robot.look(scan(nearest_m=1.0), times=4, standing=True)
    lap_m = 12.8  # 128 cells of 10 cm
    assert robot.blocked(1.45, 0.05)
    at = robot.memory._cells(np.array([[1.45 + lap_m, 0.05]]))
    fields = {name: field for name, field in vars(robot.memory).items() if isinstance(field, np.ndarray)}
    kept = {name: field for name, field in fields.items() if field.shape == (128, 128)}
    new = GroundMemory(Robot(), MOUNT, DecisionConfig())
    differing = [name for name, field in kept.items() if field[at] != vars(new)[name][at]]
    assert (len(kept), differing) == (8, [])


@pytest.mark.parametrize(("floor_from_m", "kept"), [(0.0, False), (2.0, True)])
def test_surface_below_the_view_of_a_high_camera_is_kept(floor_from_m: float, kept: bool) -> None:
    """A pallet that was seen 2.1 m ahead of the camera, and no more from 1.95 m on."""
    walk = Walkabout()
    for x_m in (0.0, 0.1, 0.2):
        walk.at(x_m)
        walk.look(replace(scan(2.3 - x_m, ahead_only=0.2), floor_from_m=floor_from_m), times=3)
    assert walk.blocked(2.77, 0.0)
    walk.at(0.37)
    walk.drive(0.8, replace(scan(), floor_from_m=floor_from_m))
    assert walk.blocked(2.77, 0.0) == kept
    assert walk.free(2.77, 0.0) == (not kept)


def test_the_disc_of_consent_reaches_to_where_the_floor_comes_into_view_but_not_far() -> None:
    for floor_from_m, reach_m in ((0.0, 1.3), (1.9, 1.9), (6.0, 2.5)):
        walk = Walkabout()
        walk.look(replace(scan(known_m=0.0), floor_from_m=floor_from_m), standing=True)
        walk.memory.renew_consent(walk.now_ns)
        assert walk.memory.consent_m == pytest.approx(0.45 + reach_m + 0.3)
        assert walk.free(0.45 + reach_m, 0.0)
        assert not walk.free(0.45 + reach_m + 0.6, 0.0)
