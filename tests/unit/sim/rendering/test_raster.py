from __future__ import annotations

import math

import numpy as np
import pytest

from hal.geometry import camera_in_floor
from hal.types import CameraMount, Intrinsics, PlanarPose, Pose
from sim.models.mesh import Faces, box, join, normals, prism, quad
from sim.rendering.raster import Rasteriser
from sim.world import Geometry

K = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
LEVEL = CameraMount(0.0, 0.0, 0.5, 0.0)
EYE = camera_in_floor(PlanarPose(0.0, 0.0, 0.0), LEVEL)


def geometry(*parts: Faces) -> Geometry:
    faces = join(list(parts))
    owner = np.repeat(np.arange(1, len(parts) + 1), [len(part) for part in parts]).astype(np.uint16)
    zeros = np.zeros(len(faces), np.int32)
    return Geometry(faces.corners_m, normals(faces.corners_m), faces.windows, zeros, owner)


def wall(x_m: float, half_m: float = 50.0) -> Faces:
    """A plane across the view, x_m ahead."""
    y, z = half_m, half_m
    return quad([(x_m, y, z), (x_m, -y, z), (x_m, -y, -z), (x_m, y, -z)], "plain/grey")


def test_a_wall_across_the_view_has_one_depth() -> None:
    raster = Rasteriser(K)
    raster.draw(geometry(wall(3.0)), EYE)
    assert raster.inverse_depth == pytest.approx(np.full((48, 64), 1.0 / 3.0), rel=1e-6)
    assert (raster.labels == 1).all()


def test_floor_depth_by_hand() -> None:
    floor = quad([(-9, 90, 0), (90, 90, 0), (90, -90, 0), (-9, -90, 0)], "plain/grey")
    raster = Rasteriser(K)
    raster.draw(geometry(floor), EYE)
    # A level camera 0.5 m above the floor: z = 0.5 * fy / (v - cy).
    for row in (26, 30, 47):
        assert 1.0 / raster.inverse_depth[row, 10] == pytest.approx(0.5 * 60.0 / (row - 23.5), rel=1e-5)
    assert (raster.labels[:24] == 0).all()
    assert (raster.inverse_depth[:24] == 0.0).all()


def test_the_nearer_face_wins_in_any_order() -> None:
    near, far = wall(2.0, half_m=0.8), wall(5.0)
    for parts in ((near, far), (far, near)):
        raster = Rasteriser(K)
        raster.draw(geometry(*parts), EYE)
        assert 1.0 / raster.inverse_depth[24, 32] == pytest.approx(2.0, rel=1e-6)
        assert 1.0 / raster.inverse_depth[2, 2] == pytest.approx(5.0, rel=1e-6)


def test_a_pixel_belongs_to_a_face_if_its_centre_lies_inside() -> None:
    # At 3 m, one pixel is 5 cm: from u = 21.5 + 0.4 to 41.5 + 0.4 around the middle.
    left, right = -0.05 * (21.9 - 31.5), -0.05 * (41.9 - 31.5)
    face = quad([(3, left, 9), (3, right, 9), (3, right, -9), (3, left, -9)], "plain/grey")
    raster = Rasteriser(K)
    raster.draw(geometry(face), EYE)
    covered = np.flatnonzero(raster.labels[20])
    assert (covered[0], covered[-1]) == (22, 41)


def test_faces_turned_away_are_not_drawn() -> None:
    raster = Rasteriser(K)
    drawn = raster.draw(geometry(box((1, 1, 1), "plain/grey", (3.0, 0.0, 0.0))), EYE)
    # Straight ahead of a level camera inside its height: only the near side shows.
    assert len(drawn) == 1
    assert raster.labels.max() == 1


def test_a_face_that_reaches_behind_the_eye_is_cut_not_lost() -> None:
    # A wall along the way on the left, from 5 m behind to 5 m ahead.
    side = quad([(-5, 1.0, 9), (5, 1.0, 9), (5, 1.0, -9), (-5, 1.0, -9)], "plain/grey")
    raster = Rasteriser(K)
    raster.draw(geometry(side), EYE)
    for column in (0, 8, 16):
        assert 1.0 / raster.inverse_depth[5, column] == pytest.approx(60.0 / (31.5 - column), rel=1e-5)
    # It ends where it is 5 m away: u = 31.5 - 12.
    assert raster.labels[5, 19] == 1
    assert raster.labels[5, 20] == 0


def test_faces_with_a_common_edge_leave_neither_gap_nor_overlap() -> None:
    tower = prism(16, (0.5, 0.5), (-3.0, 4.0), "plain/grey").moved(np.eye(3), np.array([2.013, 0.021, 0.0]))
    raster = Rasteriser(K)
    drawn = raster.draw(geometry(tower), EYE)
    shown = raster.labels[24] > 0
    first, last = np.flatnonzero(shown)[[0, -1]]
    assert shown[first : last + 1].all()
    assert (np.diff(np.flatnonzero(np.diff(raster.labels[24].astype(int)) != 0)) > 0).all()
    assert len(drawn) >= 6


def test_small_and_large_faces_meet_in_one_depth_buffer() -> None:
    # A small box in front of a wall and another behind it.
    before = box((0.1, 0.1, 0.1), "plain/grey", (2.0, 0.0, 0.45))
    behind = box((0.1, 0.1, 0.1), "plain/grey", (4.0, 0.3, 0.45))
    raster = Rasteriser(K)
    drawn = raster.draw(geometry(wall(3.0), before, behind), EYE)
    assert drawn.small.any()
    assert 1.0 / raster.inverse_depth[24, 32] == pytest.approx(1.95, rel=1e-5)
    depths = np.unique(1.0 / raster.inverse_depth.astype(np.float64)).round(4)
    assert depths.tolist() == [1.95, 3.0]
    assert set(drawn.small_pixels) == set(np.flatnonzero(raster.inverse_depth > 0.4))


def test_camera_turned_and_moved() -> None:
    pose = PlanarPose(2.0, 1.0, math.pi / 2)
    raster = Rasteriser(K)
    across = quad([(-50, 6, 50), (50, 6, 50), (50, 6, -50), (-50, 6, -50)], "plain/grey")
    raster.draw(geometry(across), camera_in_floor(pose, CameraMount(0.25, 0.0, 0.5, 0.0)))
    assert raster.inverse_depth == pytest.approx(np.full((48, 64), 1.0 / 4.75), rel=1e-6)


def test_empty_view_draws_nothing() -> None:
    raster = Rasteriser(K)
    behind = Pose(EYE.rotation, np.array([10.0, 0.0, 0.5]))
    drawn = raster.draw(geometry(box((1, 1, 1), "plain/grey", (3.0, 0.0, 0.0))), behind)
    assert len(drawn) == 0
    assert not raster.labels.any()


def test_a_second_picture_forgets_the_first() -> None:
    raster = Rasteriser(K)
    raster.draw(geometry(wall(1.0)), EYE)
    raster.draw(geometry(wall(4.0)), EYE)
    assert raster.inverse_depth == pytest.approx(np.full((48, 64), 0.25), rel=1e-6)
