"""The odometry of a base in a bag, and where its camera sits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hal.cameras.bag_replay import BagReplay
from hal.errors import BadRecording
from tests.support.bags import (
    COLOUR_FRAME,
    FORMATS,
    ODOMETRY,
    Entry,
    Format,
    Ros,
    camera_entries,
    small_bag,
    without,
    write_bag,
)
from tests.support.recordings import PERIOD_NS, START_NS, small_frame

FRAMES = [small_frame(number) for number in range(4)]


@pytest.mark.parametrize("choice", ["file", "groundtruth"])
def test_odometry_that_was_not_recorded_cannot_be_asked_for(choice: str, tmp_path: Path) -> None:
    with pytest.raises(BadRecording, match=r"odometry|groundtruth"):
        BagReplay(small_bag(tmp_path), choice)  # type: ignore[arg-type]  # parametrize knows only str


def moving(ros: Ros) -> list[Entry]:
    """The base stands a quarter turn to the left at (1, 2), its camera 0.4 m ahead and 0.6 m up, level."""
    half = np.sqrt(0.5)
    optical = (-0.5, 0.5, -0.5, 0.5)
    return [
        ("/tf_static", START_NS, ros.transform("base_link", "camera_link", (0.4, 0.0, 0.6), (0, 0, 0, 1))),
        ("/tf_static", START_NS, ros.transform("camera_link", COLOUR_FRAME, (0.0, 0.0, 0.0), optical)),
        *(
            (ODOMETRY, at_ns, ros.odometry(at_ns, (1.0, 2.0, 0.0), (0.0, 0.0, half, half)))
            for at_ns in (START_NS, START_NS + PERIOD_NS)
        ),
        *camera_entries(ros, FRAMES),
    ]


@pytest.mark.parametrize("of", FORMATS)
def test_the_odometry_of_the_base_becomes_that_of_the_camera(of: Format, tmp_path: Path) -> None:
    replay = BagReplay(write_bag(tmp_path, of, moving), "file")
    assert replay.odometry is not None
    assert (replay.odometry.name, len(replay.odometry)) == (ODOMETRY, 2)
    pose = replay.odometry.camera_pose(START_NS + PERIOD_NS // 2)
    assert pose is not None
    # It looks to the left of where the world's x points, its right is that x, its down is the world's.
    assert pose.rotation == pytest.approx(np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), abs=1e-9)
    assert pose.translation_m == pytest.approx([1.0, 2.4, 0.6])


def test_poses_out_of_order_with_a_rounded_quaternion_and_no_name_of_the_base(tmp_path: Path) -> None:
    """A pose that comes a second time says nothing new; base_link is what the base is called."""

    def entries(ros: Ros) -> list[Entry]:
        stamps = (START_NS + PERIOD_NS, START_NS, START_NS)
        poses = [
            ros.odometry(at_ns, (float(k), 0.0, 0.0), (0.0, 0.0, 0.0, 1.005), child="")
            for k, at_ns in enumerate(stamps)
        ]
        arrivals = [(ODOMETRY, START_NS + k * PERIOD_NS, pose) for k, pose in enumerate(poses)]
        return [*without(moving(ros), ODOMETRY), *arrivals]

    odometry = BagReplay(write_bag(tmp_path, "mcap", entries), "file").odometry
    assert odometry is not None
    first, last = (odometry.camera_pose(START_NS + k * PERIOD_NS) for k in (0, 1))
    assert first is not None
    assert last is not None
    assert first.translation_m == pytest.approx([1.4, 0.0, 0.6])
    assert last.translation_m == pytest.approx([0.4, 0.0, 0.6])
    assert np.linalg.det(first.rotation) == pytest.approx(1.0, abs=1e-9)


def test_an_attitude_that_is_no_rotation_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        angles = ros.odometry(START_NS + 1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.9))
        return [*moving(ros), (ODOMETRY, START_NS + 9 * PERIOD_NS, angles)]

    with pytest.raises(BadRecording, match="pose 3 is none"):
        BagReplay(write_bag(tmp_path, "mcap", entries), "file")


def test_odometry_of_an_unknown_mounting_is_not_used(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", lambda ros: without(moving(ros), "/tf_static"))
    replay = BagReplay(path)
    assert replay.odometry is None
    assert "odometry is not used" in replay.notes[-1]
    with pytest.raises(BadRecording, match="not recorded in /tf_static"):
        BagReplay(path, "file")


def test_which_of_several_is_asked_only_where_one_is_wanted(tmp_path: Path) -> None:
    """robot_localization publishes a second one on most robots."""

    def entries(ros: Ros) -> list[Entry]:
        second = [("/odometry/filtered", t, one) for topic, t, one in moving(ros) if topic == ODOMETRY]
        return [*moving(ros), *second]

    path = write_bag(tmp_path, "mcap", entries)
    with pytest.raises(BadRecording, match="several topics could be the odometry"):
        BagReplay(path)
    assert BagReplay(path, "none").odometry is None


def test_an_impossible_pose_is_refused(tmp_path: Path) -> None:
    def entries(ros: Ros) -> list[Entry]:
        lost = ros.odometry(START_NS + 1, (np.nan, 0.0, 0.0), (0, 0, 0, 1))
        return [*moving(ros), (ODOMETRY, START_NS + 9 * PERIOD_NS, lost)]

    with pytest.raises(BadRecording, match="pose 3 is none; replay it with --odometry none"):
        BagReplay(write_bag(tmp_path, "mcap", entries), "file")
