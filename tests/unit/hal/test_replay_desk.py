"""The real recording that ships with the project: it must replay from a fresh clone."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.pose_file import PoseFile
from hal.cameras.tum_replay import TumReplay
from hal.errors import EndOfStream
from hal.types import FloatArray, Intrinsics, Pose, RgbdFrame
from tests.support.recordings import DESK_RPY

FRAMES = 10
LIMIT_BYTES = 6_000_000


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    with TumReplay(DESK_RPY) as replay:
        read = [replay.read(1.0) for _ in range(FRAMES)]
        with pytest.raises(EndOfStream):
            replay.read(1.0)
        assert replay.skipped == ()
        assert (replay.unpaired_colour, replay.unpaired_depth, replay.duplicates) == (0, 0, 0)
    return read


def test_all_ten_frames_come_with_the_times_of_the_original(frames: list[RgbdFrame]) -> None:
    assert [frame.sequence for frame in frames] == list(range(FRAMES))
    assert frames[0].captured_ns == 1305031236_729693000
    assert frames[-1].captured_ns == 1305031237_029714000
    assert all(0.03 < 1e-9 * (b.captured_ns - a.captured_ns) < 0.04 for a, b in pairwise(frames))


def test_calibration_and_scale_are_the_published_ones(frames: list[RgbdFrame]) -> None:
    assert frames[0].intrinsics == Intrinsics(640, 480, 517.3, 516.5, 318.6, 255.3)
    assert frames[0].depth_scale_m == 1 / 5000


def test_depth_is_that_of_a_desk(frames: list[RgbdFrame]) -> None:
    for frame in frames:
        depth_m = frame.depth[frame.depth > 0] * frame.depth_scale_m
        assert depth_m.size > 0.6 * frame.depth.size
        assert depth_m.min() > 0.4
        assert depth_m.max() < 10.0


def test_undistorted_images_and_true_poses_agree(frames: list[RgbdFrame]) -> None:
    """Depth of the first frame, carried by the true motion, lands where optical flow finds the texture.

    The published calibration, the undistortion, the depth scale, the direction of the poses and the
    pairing in time all go into this; with the images left distorted, or the poses inverted, it fails.
    """
    poses = PoseFile(DESK_RPY / "groundtruth.txt")
    first, last = frames[0], frames[2]
    start, end = poses.camera_pose(first.captured_ns), poses.camera_pose(last.captured_ns)
    assert start is not None
    assert end is not None
    errors_px = flow_error_px(first, last, end.inverse() @ start)
    standing_px = flow_error_px(first, last, Pose(np.eye(3), np.zeros(3)))
    inverted_px = flow_error_px(first, last, start.inverse() @ end)
    assert np.median(errors_px) < 2.0
    assert np.median(standing_px) > 10.0
    assert np.median(inverted_px) > 20.0


def flow_error_px(first: RgbdFrame, second: RgbdFrame, motion: Pose) -> FloatArray:
    """Distance between tracked corners and where motion (first in second) projects them, (N,)."""
    grey = [cv2.cvtColor(frame.colour, cv2.COLOR_BGR2GRAY) for frame in (first, second)]
    corners = cv2.goodFeaturesToTrack(grey[0], 200, 0.01, 10)
    found, status, _ = cv2.calcOpticalFlowPyrLK(grey[0], grey[1], corners, np.zeros_like(corners))
    start_px, end_px = corners.reshape(-1, 2).astype(np.float64), found.reshape(-1, 2).astype(np.float64)
    z = first.depth[start_px[:, 1].astype(int), start_px[:, 0].astype(int)] * first.depth_scale_m
    usable = (status.reshape(-1) == 1) & (z > 0)
    k = first.intrinsics
    rays = np.column_stack(
        [(start_px[:, 0] - k.cx) / k.fx, (start_px[:, 1] - k.cy) / k.fy, np.ones(len(start_px))]
    )
    moved = motion.apply(rays * z[:, None])[usable]
    projected = np.column_stack(
        [k.fx * moved[:, 0] / moved[:, 2] + k.cx, k.fy * moved[:, 1] / moved[:, 2] + k.cy]
    )
    assert math.isfinite(projected.sum())
    distances: FloatArray = np.linalg.norm(projected - end_px[usable], axis=1)
    return distances


def test_source_licence_and_citation_stand_beside_it() -> None:
    text = (DESK_RPY / "README.md").read_text() + (DESK_RPY / "LICENSE").read_text()
    for needed in (
        "CC BY 4.0",
        "Sturm",
        "IROS",
        "2012",
        "cvg.cit.tum.de",
        "creativecommons.org/licenses/by/4.0",
    ):
        assert needed in text


def test_the_recording_in_the_repository_stays_small() -> None:
    files: list[Path] = [path for path in DESK_RPY.rglob("*") if path.is_file()]
    assert len(files) == 2 * FRAMES + 6
    assert sum(path.stat().st_size for path in files) <= LIMIT_BYTES
