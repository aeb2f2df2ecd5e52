"""Undistortion and registration against points worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.registration import DepthRegistration
from hal.cameras.tum_replay import TumReplay
from hal.cameras.undistort import Undistorter
from hal.types import Intrinsics, Pose
from tests.support.recordings import colour_files, depth_files, set_key, write_recording

CAMERA = Intrinsics(640, 480, 500.0, 500.0, 320.0, 240.0)
STILL = Pose(np.eye(3), np.zeros(3))


def test_colour_and_depth_move_to_where_the_pinhole_camera_sees_them() -> None:
    # Pixel (420, 240) of the pinhole camera: x = 100 / 500 = 0.2, r^2 = 0.04. With k1 = 0.5 the lens
    # puts that ray at x (1 + k1 r^2) = 0.2 * 1.02 = 0.204, pixel 320 + 102 = 422.
    undistorter = Undistorter(CAMERA, [0.5, 0.0, 0.0, 0.0, 0.0])
    colour = np.zeros((480, 640, 3), np.uint8)
    colour[240, 422] = 200
    depth = np.zeros((480, 640), np.uint16)
    depth[240, 422] = 4321
    assert undistorter.colour(colour)[240, 420].tolist() == [200, 200, 200]
    assert undistorter.depth(depth)[240, 420] == 4321


def test_depth_is_never_a_mean_of_two_surfaces() -> None:
    undistorter = Undistorter(CAMERA, [0.3, -0.9, -0.005, 0.003, 1.2])
    depth = np.where(np.arange(640) % 2 == 0, 1000, 3000).astype(np.uint16) * np.ones((480, 1), np.uint16)
    assert set(np.unique(undistorter.depth(depth))) <= {0, 1000, 3000}


def test_outside_the_sensor_depth_is_unknown_and_colour_makes_no_edge() -> None:
    # With k1 > 0 the pinhole image's corners look past the rim of the sensor.
    undistorter = Undistorter(CAMERA, [0.5, 0.0, 0.0, 0.0, 0.0])
    assert undistorter.depth(np.full((480, 640), 1000, np.uint16))[0, 0] == 0
    assert np.all(undistorter.colour(np.full((480, 640, 3), 77, np.uint8)) == 77)


def test_no_distortion_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    colour = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    depth = rng.integers(0, 65536, (480, 640)).astype(np.uint16)
    undistorter = Undistorter(CAMERA, [0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(undistorter.colour(colour), colour)
    np.testing.assert_array_equal(undistorter.depth(depth), depth)


def test_registering_onto_the_same_camera_changes_nothing() -> None:
    depth = np.random.default_rng(4).integers(0, 20000, (480, 640)).astype(np.uint16)
    np.testing.assert_array_equal(DepthRegistration(CAMERA, CAMERA, STILL, 0.001)(depth), depth)


def test_a_point_is_drawn_where_the_colour_camera_sees_it() -> None:
    # (352, 256) at 2 m with f = 320 about (320, 240): x = 0.2 m, y = 0.1 m. Seen 5 cm further right in
    # colour: x = 0.25 m, u = 320 + 500 * 0.25 / 2 = 382.5, v = 240 + 500 * 0.1 / 2 = 265.
    depth_camera = Intrinsics(640, 480, 320.0, 320.0, 320.0, 240.0)
    depth = np.zeros((480, 640), np.uint16)
    depth[256, 352] = 2000
    registration = DepthRegistration(depth_camera, CAMERA, Pose(np.eye(3), np.array([0.05, 0.0, 0.0])), 0.001)
    rows, columns = np.nonzero(registration(depth))
    assert set(registration(depth)[rows, columns].tolist()) == {2000}
    assert (columns.min(), columns.max()) == (382, 383)
    assert (rows.min(), rows.max()) == (264, 266)


def test_a_displacement_ahead_changes_the_distance_too() -> None:
    depth = np.full((480, 640), 2000, np.uint16)
    registration = DepthRegistration(CAMERA, CAMERA, Pose(np.eye(3), np.array([0.0, 0.0, 0.1])), 0.001)
    assert registration(depth)[240, 320] == 2100


def test_a_turned_depth_camera_is_turned_back() -> None:
    # A quarter turn about z: what the depth camera sees to the right, the colour camera sees below.
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    depth = np.zeros((480, 640), np.uint16)
    depth[240, 420] = 1500
    registered = DepthRegistration(CAMERA, CAMERA, Pose(turn, np.zeros(3)), 0.001)(depth)
    assert registered[340, 320] == 1500


def test_where_two_surfaces_meet_the_nearer_one_wins() -> None:
    # 0.1 m to the right: at 1 m that is 50 px, at 4 m 12.5 px, so column 300 moves beyond column 320.
    depth = np.full((480, 640), 4000, np.uint16)
    depth[:, 300] = 1000
    registration = DepthRegistration(CAMERA, CAMERA, Pose(np.eye(3), np.array([0.1, 0.0, 0.0])), 0.001)
    registered = registration(depth)
    assert np.all(registered[:, 350] == 1000)
    assert registered[240, 360] == 4000


def test_a_finer_colour_image_gets_no_holes_also_from_noisy_depth() -> None:
    depth_camera = Intrinsics(640, 480, 385.0, 385.0, 320.0, 240.0)
    colour_camera = Intrinsics(640, 480, 615.0, 615.0, 320.0, 240.0)
    noise = np.random.default_rng(5).normal(0.0, 20.0, (480, 640))
    depth = (2000 + noise).astype(np.uint16)
    to_colour = Pose(np.eye(3), np.array([0.015, 0.0, 0.0]))
    registered = DepthRegistration(depth_camera, colour_camera, to_colour, 0.001)(depth)
    assert np.count_nonzero(registered == 0) == 0


def test_no_data_stays_no_data() -> None:
    depth = np.zeros((480, 640), np.uint16)
    assert not DepthRegistration(CAMERA, CAMERA, STILL, 0.001)(depth).any()


@pytest.mark.parametrize("ahead_m", [-0.05, 0.0, 0.05])
def test_depth_that_is_cut_off_stays_so(ahead_m: float) -> None:
    """65535 is as far or farther, wherever the colour camera is: no wall before it, and data."""
    depth = np.full((480, 640), 65_535, np.uint16)
    registration = DepthRegistration(CAMERA, CAMERA, Pose(np.eye(3), np.array([0.0, 0.0, ahead_m])), 1e-4)
    np.testing.assert_array_equal(registration(depth)[5:-5, 5:-5], 65_535)
    # What comes to lie beyond is cut off, too, and hides nothing nearer.
    depth[:, 320:] = 65_500
    moved = registration(depth)
    assert moved[240, 500] == min(65_500 + round(1e4 * ahead_m), 65_535)
    assert moved[240, 100] == 65_535


def test_depth_behind_the_colour_camera_is_not_drawn() -> None:
    depth = np.full((480, 640), 500, np.uint16)
    registration = DepthRegistration(CAMERA, CAMERA, Pose(np.eye(3), np.array([0.0, 0.0, -1.0])), 0.001)
    assert not registration(depth).any()


def test_a_replay_undistorts_colour_and_registered_depth_alike(tmp_path: Path) -> None:
    folder = write_recording(tmp_path, count=1)
    set_key(folder, "distortion", "[0.9, 0, 0, 0, 0]")
    # Pinhole column 49: x = 17.5 / 60 = 0.2917, the lens puts it at 0.2917 (1 + 0.9 * 0.085) = 0.314,
    # column 31.5 + 60 * 0.314 = 50.3. Column 47 comes from 47.9 likewise.
    colour = np.zeros((48, 64, 3), np.uint8)
    colour[:, 50:] = 200
    depth = np.full((48, 64), 1000, np.uint16)
    depth[:, 50:] = 3000
    assert cv2.imwrite(str(colour_files(folder)[0]), colour)
    assert cv2.imwrite(str(depth_files(folder)[0]), depth)
    with TumReplay(folder) as replay:
        frame = replay.read(0.0)
    assert frame.colour[23, 47, 0] == 0
    assert frame.colour[23, 49, 0] == 200
    assert frame.depth[23, 47] == 1000
    assert frame.depth[23, 49] == 3000
    assert frame.intrinsics.fx == 60.0


def test_a_replay_registers_depth_when_camera_yaml_gives_the_depth_camera(tmp_path: Path) -> None:
    folder = write_recording(tmp_path, count=1)
    depth = np.full((40, 60), 1000, np.uint16)
    depth[:, 30:] = 2000
    assert cv2.imwrite(str(depth_files(folder)[0]), depth)
    for key, value in {
        "depth_registered": "false",
        "depth_width": "60",
        "depth_height": "40",
        "depth_fx": "30.0",
        "depth_fy": "30.0",
        "depth_cx": "29.5",
        "depth_cy": "19.5",
    }.items():
        set_key(folder, key, value)
    with TumReplay(folder) as replay:
        frame = replay.read(0.0)
        assert not any("not registered" in note for note in replay.notes)
    assert frame.depth.shape == (48, 64)
    assert frame.depth[24, 30] == 1000
    assert frame.depth[24, 33] == 2000


def test_depth_that_was_registered_here_is_straight_already_and_not_undistorted_again(tmp_path: Path) -> None:
    folder = write_recording(tmp_path, count=1)
    depth = np.full((48, 64), 1000, np.uint16)
    depth[:, 50:] = 3000
    assert cv2.imwrite(str(depth_files(folder)[0]), depth)
    set_key(folder, "distortion", "[0.9, 0, 0, 0, 0]")
    set_key(folder, "depth_registered", "false")
    for key, value in {
        "depth_fx": "60.0",
        "depth_fy": "60.0",
        "depth_cx": "31.5",
        "depth_cy": "23.5",
    }.items():
        set_key(folder, key, value)
    with TumReplay(folder) as replay:
        np.testing.assert_array_equal(replay.read(0.0).depth, depth)


def test_unregistered_depth_without_its_camera_is_used_as_it_is_and_said(tmp_path: Path) -> None:
    folder = write_recording(tmp_path, count=1)
    set_key(folder, "depth_registered", "false")
    with TumReplay(folder) as replay:
        assert np.all(replay.read(0.0).depth == 1000)
        (note,) = [note for note in replay.notes if "not registered" in note]
    assert "depth_fx" in note


@pytest.mark.parametrize("pitch_deg", [-10.0, 4.0])
def test_a_positive_pitch_looks_down(tmp_path: Path, pitch_deg: float) -> None:
    folder = write_recording(tmp_path, count=1)
    set_key(folder, "camera_height_m", "0.5")
    set_key(folder, "camera_pitch_deg", str(pitch_deg))
    mount = TumReplay(folder).mount
    assert mount is not None
    assert mount.pitch_rad == math.radians(pitch_deg)
