"""Surfaces into the filters of their tracks: what is left to see of a mover, and where."""

from __future__ import annotations

import numpy as np
import pytest

from config.perception import DepthNoise, MotionSettings
from tests.support.detections import detection
from tests.support.grids import grid_of, labelled, nearest, plate
from vision.bodies import sightings
from vision.bodies.tracks import Tracks
from vision.depth import occlusion, regions
from vision.depth.connected import MIN_PART_CELLS


def seen_of(left_m: float, right_m: float, moving: bool = True) -> Tracks:
    """A body 0.6 m wide that was seen whole 3 m away; now only what is between left_m and right_m."""
    tracks = Tracks()
    tracks.start(np.array([[0.0, 0.0, 3.0]]), 0.2, 1.5, 1.0, 0)
    tracks.moving[:] = moving
    for frame, (low, high) in enumerate(((-0.3, 0.3), (left_m, right_m))):
        depth_m = plate(3.0, (low, high), (-0.6, 0.6))
        grid, labels = grid_of(depth_m), labelled(depth_m > 0.0)
        measured = occlusion.with_occlusion(grid, labels, regions.measure(grid, labels, 1))
        sightings.update_from_surfaces(tracks, detection(grid, frame), measured, DepthNoise())
    return tracks


def test_area_is_kept_if_it_neither_doubles_nor_halves() -> None:
    tracks = Tracks()
    tracks.start(np.zeros((6, 3)), 0.2, 1.5, 0.0, 0)
    tracks.cells = np.array([100, 100, 100, 100, 0, 100])
    cells = np.array([200, 201, 50, 49, 100, 0])  # the fifth has come out from behind something
    assert sightings.keeps_area(tracks, cells).tolist() == [True, False, True, False, True, False]


@pytest.mark.parametrize(("right_m", "nearly_hidden"), [(-0.2, True), (0.0, False)])
def test_a_mover_of_which_less_than_two_fifths_are_left_to_see_is_a_sliver(
    right_m: float, nearly_hidden: bool
) -> None:
    tracks = seen_of(-0.3, right_m)
    assert tracks.nearly_hidden.tolist() == [nearly_hidden]
    whole_m = tracks.box_m[0, 2] - tracks.box_m[0, 0]
    assert (abs(whole_m - 0.6) < 0.1) == nearly_hidden  # a small rest says nothing of how wide its body is


def test_standing_track_is_not_nearly_hidden() -> None:
    assert not seen_of(-0.3, -0.2, moving=False).nearly_hidden.any()


def test_mover_that_leaves_the_image_is_not_nearly_hidden() -> None:
    """Its rest is where it is seen to be, and the others are outside."""
    assert not seen_of(-1.6, -1.5).nearly_hidden.any()


def reaching_in(moving: bool) -> float:
    """Velocity across, as filtered, of a body 3 m away whose right side comes into the view at 1.2 m/s."""
    tracks = Tracks()
    tracks.start(np.array([[-1.4, 0.0, 3.0]]), 0.2, 1.5, 1.0, 0)
    tracks.moving[:] = moving
    for frame in range(12):
        tracks.predict(1.0 / 30.0, 0.12, None)
        depth_m = plate(3.0, (-2.0, -1.2 + 0.04 * frame), (-0.6, 0.6))
        grid, labels = grid_of(depth_m), labelled(depth_m > 0.0)
        measured = occlusion.with_occlusion(grid, labels, regions.measure(grid, labels, 1))
        sightings.update_from_surfaces(tracks, detection(grid, frame), measured, DepthNoise())
    return float(tracks.state[0, 3])


def test_a_cut_surface_measures_the_velocity_of_a_known_mover_roughly() -> None:
    assert 0.3 < reaching_in(moving=True) < 1.2  # its middle goes half as fast as its rim
    assert reaching_in(moving=False) == 0.0  # of what stands a new rim is no motion


@pytest.mark.parametrize(("board_m", "whole"), [(9.0, True), (1.5, False)])
def test_an_overlapped_surface_alone_proves_no_motion(board_m: float, whole: bool) -> None:
    """Somebody who passes before a crate hides more and more of it: its middle goes, but it stands."""
    tracks = Tracks()
    tracks.start(np.array([[0.0, 0.0, 3.0]]), 0.2, 1.5, 0.0, 0)
    for frame in range(6):
        crate, board = plate(3.0, (-0.3, 0.3), (-0.3, 0.3)), plate(board_m, (0.12, 1.0), (-1.0, 1.0))
        depth_m = nearest(crate, board)
        grid, labels = grid_of(depth_m), labelled(depth_m == 3.0)
        measured = occlusion.with_occlusion(grid, labels, regions.measure(grid, labels, 1))
        sightings.update_from_surfaces(tracks, detection(grid, frame), measured, DepthNoise())
    assert (tracks.velocity_measured_s[0] > 0.1) == whole


def test_unseen_track_changes_only_its_times() -> None:
    tracks = Tracks()
    tracks.start(np.array([[0.0, 0.0, 3.0]]), 0.2, 1.5, 0.0, 0)
    tracks.velocity_measured_s[:] = 0.4
    few = np.zeros((60, 80), np.int32)
    few[30, 40 : 40 + MIN_PART_CELLS - 1] = 1
    grid = grid_of(np.where(few > 0, 2.0, 0.0))
    sightings.update_from_surfaces(tracks, detection(grid, 1), regions.measure(grid, few, 1), DepthNoise())
    assert tracks.velocity_measured_s.tolist() == [0.0]
    assert tracks.sightings.tolist() == [0]
    assert tracks.seen_ns.tolist() == [0]
    assert tracks.cells.tolist() == [0]
    np.testing.assert_array_equal(tracks.state[0], [0.0, 0.0, 3.0, 0.0, 0.0, 0.0])
    assert not tracks.box_m.any()
    nobody = Tracks()
    sightings.update_from_surfaces(
        nobody, detection(grid, 1), regions.measure(grid, np.zeros_like(few), 0), DepthNoise()
    )
    assert len(nobody) == 0


def test_a_velocity_that_nothing_has_is_forgotten_unless_it_is_that_of_a_known_mover() -> None:
    """2.5 m/s where 2.4 are possible: at once, not on a way through all that is possible."""
    tracks = Tracks()
    tracks.start(np.zeros((3, 3)), 0.2, 1.5, 0.0, 0)
    tracks.covariance[:, 0, 3] = tracks.covariance[:, 3, 0] = 0.02
    tracks.covariance[:, 3:, 3:] = tracks.surface_covariance[:, 3:, 3:] = 0.04 * np.eye(3)
    tracks.state[:, :4] = tracks.surface_state[:, :4] = (1.0, 0.5, 8.0, 0.0)
    tracks.state[:, 5] = -2.5, -2.3, -2.5
    tracks.surface_state[:, 5] = -2.3, -2.5, -2.5
    tracks.moving[2] = True
    sightings.forget_implausible(tracks, MotionSettings(max_speed_mps=1.5))
    assert tracks.state[:, 5].tolist() == [0.0, -2.3, -2.5]
    assert tracks.surface_state[:, 5].tolist() == [-2.3, 0.0, -2.5]
    np.testing.assert_array_equal(tracks.state[:, :3], [[1.0, 0.5, 8.0]] * 3)
    np.testing.assert_allclose(tracks.covariance[0], np.diag([0.04] * 3 + [2.25] * 3))
    np.testing.assert_allclose(tracks.covariance[1, 3:, 3:], 0.04 * np.eye(3))
    np.testing.assert_allclose(tracks.surface_covariance[:, 5, 5], [0.04, 2.25, 0.04])
