from __future__ import annotations

import math

import numpy as np
import pytest

from config.camera import SimulatedCameraConfig
from config.own_parts import OwnPart
from config.scenario import load_scenario
from hal.box_view import box_view
from hal.clocks import MonotonicClock, SimulatedClock
from hal.errors import FrameTimeout
from hal.geometry import camera_in_floor
from hal.types import CameraMount, PlanarPose
from sim.rendering.camera import SimulatedCamera
from sim.world import World

SMALL = SimulatedCameraConfig(width=160, height=120, fx=150.0, fy=150.0, cx=79.5, cy=59.5)
CLEAN = SMALL.model_copy(
    update={"depth_noise": "none", "hole_ratio": 0.0, "depth_edges": False, "colour_noise": False}
)
MOUNT = CameraMount(0.45, 0.0, 0.6, math.radians(4.0))
WORLD = World(load_scenario("crossing"), seed=2)
NS = 1_000_000_000


def drive(stamp_ns: int) -> PlanarPose:
    return PlanarPose(0.5 * stamp_ns / NS, 0.0, 0.0)


def camera(config: SimulatedCameraConfig = SMALL, start_ns: int = 0, seed: int = 2) -> SimulatedCamera:
    world = WORLD if seed == 2 else World(WORLD.scenario, seed)
    return SimulatedCamera(world, config, MOUNT, SimulatedClock(start_ns), drive)


def test_frames_are_due_at_even_times_without_drift() -> None:
    source = camera(start_ns=7 * NS)
    frames = [source.read(timeout_s=1.0) for _ in range(7)]
    assert [frame.captured_ns for frame in frames] == [7 * NS + round(k * NS / 30) for k in range(7)]
    assert [frame.sequence for frame in frames] == list(range(7))
    assert source.next_capture_ns == 7 * NS + round(7 * NS / 30)


def test_the_clock_has_moved_to_the_exposure() -> None:
    clock = SimulatedClock(0)
    source = SimulatedCamera(WORLD, SMALL, MOUNT, clock, drive)
    source.read(timeout_s=0.0)
    source.read(timeout_s=1.0)
    assert clock.now_ns() == round(NS / 30)


def test_a_frame_that_is_not_due_times_out_after_the_timeout() -> None:
    clock = SimulatedClock(0)
    source = SimulatedCamera(WORLD, SMALL, MOUNT, clock, drive)
    source.read(timeout_s=0.0)
    with pytest.raises(FrameTimeout):
        source.read(timeout_s=0.01)
    assert clock.now_ns() == 10_000_000
    assert source.read(timeout_s=0.1).sequence == 1


def test_frames_that_nobody_asked_for_are_lost() -> None:
    clock = SimulatedClock(0)
    source = SimulatedCamera(WORLD, SMALL, MOUNT, clock, drive)
    source.read(timeout_s=0.0)
    clock.sleep_until_ns(round(3.4 * NS / 30))
    late = source.read(timeout_s=0.0)
    assert late.sequence == 3
    assert late.captured_ns == round(3 * NS / 30)


def test_simulated_camera_runs_on_the_monotonic_clock_too() -> None:
    clock = MonotonicClock()
    source = SimulatedCamera(WORLD, SMALL, MOUNT, clock, lambda _: PlanarPose(0.0, 0.0, 0.0))
    before_ns = clock.now_ns()
    frames = [source.read(timeout_s=1.0) for _ in range(3)]
    assert before_ns - round(NS / 30) <= frames[0].captured_ns
    assert frames[0].captured_ns < frames[1].captured_ns < frames[2].captured_ns <= clock.now_ns()


def test_a_frame_is_what_the_interface_says() -> None:
    frame = camera().read(timeout_s=0.0)
    assert frame.colour.shape == (120, 160, 3)
    assert frame.colour.dtype == np.uint8
    assert frame.depth.shape == (120, 160)
    assert frame.depth.dtype == np.uint16
    assert frame.depth_scale_m == 0.001
    assert frame.intrinsics == camera().intrinsics


def test_without_noise_depth_is_the_truth_in_millimetres() -> None:
    source = camera(CLEAN)
    frame = source.read(timeout_s=0.0)
    assert source.last_picture is not None
    exact = source.last_picture.depth_m()
    valid = frame.depth > 0
    assert valid.mean() > 0.5
    assert np.abs(frame.depth[valid] * 0.001 - exact[valid]).max() <= 0.00051
    assert (exact[~valid] > 10.0).all()
    assert np.array_equal(frame.colour, source.last_picture.colour)


def test_frames_are_kept_when_the_next_is_drawn() -> None:
    source = camera()
    first = source.read(timeout_s=0.0)
    colour, depth = first.colour.copy(), first.depth.copy()
    source.read(timeout_s=1.0)
    assert np.array_equal(first.colour, colour)
    assert np.array_equal(first.depth, depth)


def test_two_runs_are_alike_to_the_byte() -> None:
    one, two = camera(), camera()
    for _ in range(4):
        a, b = one.read(timeout_s=1.0), two.read(timeout_s=1.0)
        assert a.colour.tobytes() == b.colour.tobytes()
        assert a.depth.tobytes() == b.depth.tobytes()


def test_another_seed_looks_different() -> None:
    a, b = camera(CLEAN).read(timeout_s=0.0), camera(CLEAN, seed=3).read(timeout_s=0.0)
    assert not np.array_equal(a.colour, b.colour)


def test_the_camera_goes_where_the_body_goes() -> None:
    source = camera()
    pose = source.camera_pose(4 * NS)
    expected = camera_in_floor(PlanarPose(2.0, 0.0, 0.0), MOUNT)
    assert pose.translation_m == pytest.approx(expected.translation_m)
    assert pose.rotation == pytest.approx(expected.rotation)


def test_vibration_pitches_to_and_fro() -> None:
    source = camera(SMALL.model_copy(update={"vibration_deg": 0.5, "vibration_hz": 10.0}))

    def pitch_deg(stamp_ns: int) -> float:
        return math.degrees(math.asin(-source.camera_pose(stamp_ns).rotation[2, 2]))

    assert pitch_deg(0) == pytest.approx(4.0)
    assert pitch_deg(NS // 40) == pytest.approx(4.5)
    assert pitch_deg(3 * NS // 40) == pytest.approx(3.5)


def test_simulated_camera_is_a_context_manager() -> None:
    with camera() as source:
        assert source.read(timeout_s=0.0).sequence == 0


BUMPER = OwnPart(name="bumper", from_m=(0.70, -0.20, 0.35), to_m=(0.85, 0.20, 0.50))
MAST = OwnPart(name="mast", from_m=(0.60, -0.02, 0.0), to_m=(0.64, 0.02, 1.0))


def test_parts_of_the_robot_are_drawn_where_they_are_seen_and_nowhere_else() -> None:
    sees = SimulatedCamera(WORLD, CLEAN, MOUNT, SimulatedClock(0), drive, own_parts=[BUMPER, MAST])
    plain, own = camera(CLEAN).read(0.1), sees.read(0.1)
    views = [box_view(part, MOUNT, sees.intrinsics) for part in (BUMPER, MAST)]
    seen = views[0].seen | views[1].seen
    assert 0.05 < seen.mean() < 0.5
    np.testing.assert_array_equal(own.depth[~seen], plain.depth[~seen])
    np.testing.assert_array_equal(own.colour[~seen], plain.colour[~seen])
    nearest_m = np.min([np.where(view.seen, view.enter_m, np.inf) for view in views], axis=0)
    # Nearer than depth_min_m a camera measures nothing.
    measured = seen & (nearest_m > CLEAN.depth_min_m + 0.01)
    assert np.count_nonzero(measured) > 50
    np.testing.assert_allclose(own.depth[measured] * own.depth_scale_m, nearest_m[measured], atol=0.01)
    assert not own.depth[seen & (nearest_m < CLEAN.depth_min_m - 0.01)].any()
    picture = sees.last_picture
    assert picture is not None
    assert not picture.instance_mask()[seen].any()


def test_they_move_with_the_camera_and_have_marks() -> None:
    sees = SimulatedCamera(WORLD, CLEAN, MOUNT, SimulatedClock(0), drive, own_parts=[BUMPER])
    seen = box_view(BUMPER, MOUNT, sees.intrinsics).seen
    first, *_, last = (sees.read(0.1) for _ in range(6))
    np.testing.assert_array_equal(last.colour[seen], first.colour[seen])
    assert (last.colour[~seen] != first.colour[~seen]).mean() > 0.1
    assert first.colour[seen].std() > 40.0
